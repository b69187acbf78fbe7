# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Segmentation while samples arrive: the trends' half of the method, in bounded memory.

A batch sampler looks at the whole past at once. Online, the same description of speeds and courses by lines with knots
is kept over a short window: a knot that gains more than noise could is a changepoint, once enough samples after it
confirm it; confirmed changepoints never move again. Single samples far off their neighbours are left out.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.method.segmentation.features import POSITION_FLOOR, SPEED_FLOOR, without_spikes
from scenario_gen.method.segmentation.trends import Trends
from scenario_gen.numerics import Floats
from scenario_gen.types import Vehicle

UNJUDGED = 2  # samples at the end that may be outliers: nothing after them says


@dataclass(frozen=True)
class OnlineConfig(Parameters):
    """How the online segmenter decides."""

    window: float = parameter(30.0, "past that is kept at most", unit="s", low=5.0, high=600.0)
    delay: float = parameter(
        1.0, "least age at which a changepoint is confirmed", unit="s", low=0.3, high=10.0
    )
    look_back: float = parameter(
        6.0, "age beyond which no changepoint is looked for any more", unit="s", low=1.0, high=60.0
    )
    every: int = parameter(2, "samples between two looks", low=1, high=100)
    significance_level: float = parameter(
        1e-6, "probability with which noise alone looks like a changepoint", low=1e-12, high=0.5
    )
    min_segment: float = parameter(
        0.5, "least distance between changepoints", unit="s", low=0.2, high=10.0
    )


@dataclass(frozen=True)
class Changepoint:
    """A confirmed changepoint.

    Attributes:
        sample: its index, counted from the first sample pushed.
        confirmed: index of the sample that confirmed it.
        probability: that there is one rather than noise; see `chance_of_knot`.
    """

    sample: int
    confirmed: int
    probability: float


class OnlineSegmenter:
    """Extends a segmentation sample by sample; memory and time per sample do not grow with the samples seen."""

    def __init__(
        self, vehicles: int | Sequence[Vehicle], dt: float, config: OnlineConfig = OnlineConfig()
    ) -> None:
        """Start with no samples of so many cars, or of these vehicles, `dt` seconds apart."""
        self._config = config
        self._dt = dt
        self._vehicles = (
            [Vehicle(str(n)) for n in range(vehicles)] if isinstance(vehicles, int) else vehicles
        )
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
        if row.shape != (len(self._vehicles), 3) or not np.isfinite(row).all():
            raise InputError(
                f"sample {self._count} must hold finite positions (N, 2) and speeds (N,) of {len(self._vehicles)} vehicles"
            )
        self._samples.append(row)
        self._count += 1
        if (
            self._count % self._config.every
            or len(self._samples) < 2.0 * self._config.delay / self._dt
        ):
            return []
        return self._look()

    def _look(self) -> list[Changepoint]:
        """Look for changepoints after the last confirmed one."""
        config = self._config
        first = self._count - len(self._samples)
        stack = np.array(self._samples).transpose(1, 0, 2)
        position = np.stack([without_spikes(xy, POSITION_FLOOR) for xy in stack[:, :, :2]])
        speed = np.stack([without_spikes(v, SPEED_FLOOR)[:, 0] for v in stack[:, :, 2:]])
        trends = Trends.of(position[:, :-UNJUDGED], speed[:, :-UNJUDGED], self._dt, self._vehicles)
        least = trends.threshold(config.significance_level)
        gap = max(2, round(config.min_segment / self._dt))
        fixed = [c - first for c in self._confirmed if c - first >= gap]
        start = max(
            (fixed[-1] if fixed else 0) + gap,
            len(self._samples) - round(config.look_back / self._dt),
        )
        free = np.arange(start, trends.samples - gap)
        points = trends.add(fixed, free, least, gap)
        points = fixed + trends.settle(points, gap, gap)[len(fixed) :]
        ripe = len(self._samples) - round(config.delay / self._dt)
        changepoints = []
        for i, c in enumerate(points):
            if start <= c <= ripe and (gain := trends.gain(points, i)) > least:
                changepoints.append(
                    Changepoint(
                        first + c, self._count - 1, chance_of_knot(gain, trends, points, i)
                    )
                )
        self._confirmed.extend(c.sample for c in changepoints)
        while (
            len(self._confirmed) == 2
            and len(self._samples) > 1
            and first < self._confirmed[0] - gap
        ):
            self._samples.popleft()
            first += 1
        return changepoints


def chance_of_knot(gain: float, trends: Trends, points: list[int], i: int) -> float:
    """Probability of a changepoint where the description gains by one, against noise alone (BIC; Kass & Raftery 1995, eq. 9).

    With n samples between the neighbouring knots, d signals, and one of the n places beforehand as probable as another, and all
    together as probable as none, the log odds are (gain - d log n) / 2 - log n.

    Args:
        gain: see `Trends.gain`.
        trends: the signals.
        points: all knots.
        i: which of them.
    """
    edges = [0, *points, trends.samples - 1]
    n = edges[i + 2] - edges[i]
    odds = 0.5 * (gain - len(trends.signals) * np.log(float(n))) - np.log(float(n))
    return float(1.0 / (1.0 + np.exp(-min(max(odds, -50.0), 50.0))))
