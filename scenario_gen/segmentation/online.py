# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Segmentation while samples arrive: the trends' half of the method, in bounded memory.

A batch sampler looks at the whole past at once. Online, the same description of speeds and courses by lines with knots
is kept over a short window: a knot that gains more than noise could is a changepoint, once enough samples after it
confirm it; confirmed changepoints never move again. Which primitive a finished segment is, `assign` can say.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np

from scenario_gen.arrays import Floats
from scenario_gen.errors import InputError
from scenario_gen.parameters import parameter, Parameters
from scenario_gen.segmentation.trends import Trends


@dataclass(frozen=True)
class OnlineConfig(Parameters):
    """How the online segmenter decides."""

    window: float = parameter(30.0, "past that is kept at most", unit="s", low=5.0, high=600.0)
    delay: float = parameter(1.0, "least age at which a changepoint is confirmed", unit="s", low=0.3, high=10.0)
    look_back: float = parameter(6.0, "age beyond which no changepoint is looked for any more", unit="s", low=1.0, high=60.0)
    every: int = parameter(2, "samples between two looks", low=1, high=100)
    significance_level: float = parameter(
        1e-6, "probability with which noise alone looks like a changepoint", low=1e-12, high=0.5, was="chance_alone"
    )
    min_segment: float = parameter(0.5, "least distance between changepoints", unit="s", low=0.2, high=10.0)


@dataclass(frozen=True)
class Changepoint:
    """A confirmed changepoint: the index of its sample, counted from the first one pushed, and when it was confirmed."""

    sample: int
    confirmed: int


class OnlineSegmenter:
    """Extends a segmentation sample by sample; memory and time per sample do not grow with the samples seen."""

    def __init__(self, vehicles: int, dt: float, config: OnlineConfig = OnlineConfig()) -> None:
        """Start with no samples of `vehicles` vehicles, `dt` seconds apart."""
        self._config = config
        self._dt = dt
        self._vehicles = vehicles
        self._samples: deque[Floats] = deque(maxlen=round(config.window / dt))
        self._count = 0
        self._confirmed: deque[int] = deque(maxlen=2)

    def push(self, position: Floats, speed: Floats) -> list[Changepoint]:
        """Take one sample of every vehicle and return the changepoints it confirms.

        Args:
            position: (N, 2) m.
            speed: (N,) m/s.

        Raises:
            InputError: the shapes are wrong or a value is not finite.
        """
        row = np.column_stack([np.asarray(position, np.float64), np.asarray(speed, np.float64)])
        if row.shape != (self._vehicles, 3) or not np.isfinite(row).all():
            raise InputError(
                f"sample {self._count} must hold finite positions (N, 2) and speeds (N,) of {self._vehicles} vehicles"
            )
        self._samples.append(row)
        self._count += 1
        if self._count % self._config.every or len(self._samples) < 2.0 * self._config.delay / self._dt:
            return []
        return self._look()

    def _look(self) -> list[Changepoint]:
        """Look for changepoints after the last confirmed one."""
        config = self._config
        first = self._count - len(self._samples)
        stack = np.array(self._samples).transpose(1, 0, 2)
        trends = Trends.of(stack[:, :, :2], stack[:, :, 2], self._dt)
        least = trends.threshold(config.significance_level)
        gap = max(2, round(config.min_segment / self._dt))
        fixed = [c - first for c in self._confirmed if c - first >= gap]
        start = max((fixed[-1] if fixed else 0) + gap, trends.samples - round(config.look_back / self._dt))
        free = np.arange(start, trends.samples - gap)
        points = trends.add(fixed, free, least, gap)
        points = fixed + trends.settle(points, gap, gap)[len(fixed) :]
        ripe = trends.samples - round(config.delay / self._dt)
        found = [
            Changepoint(first + c, self._count - 1)
            for i, c in enumerate(points)
            if c >= start and c <= ripe and trends.gain(points, i) > least
        ]
        self._confirmed.extend(c.sample for c in found)
        while len(self._confirmed) == 2 and len(self._samples) > 1 and first < self._confirmed[0] - gap:
            self._samples.popleft()
            first += 1
        return found
