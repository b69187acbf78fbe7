# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Segmentation while samples arrive, by trends alone, in bounded memory.

Speeds and courses within a short window are described by lines with knots, as in `trends`. A knot
whose gain exceeds that of noise is a changepoint once enough samples after it confirm it; a
confirmed changepoint never moves. Single outliers are ignored.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.method.segmentation.features import (
    MIN_SPIKE_M,
    MIN_SPIKE_MPS,
    without_spikes,
)
from scenario_gen.method.segmentation.trends import Trends
from scenario_gen.numerics import Floats
from scenario_gen.types import Vehicle

UNCHECKED_SAMPLES = 2  # at the end: without later samples an outlier is not recognised


@dataclass(frozen=True)
class OnlineConfig(Parameters):
    """How the online segmenter decides."""

    window: float = parameter(30.0, "longest past that is stored", unit="s", low=5.0, high=600.0)
    delay: float = parameter(
        1.0, "minimum age at which a changepoint is confirmed", unit="s", low=0.3, high=10.0
    )
    look_back: float = parameter(
        6.0, "age above which no changepoint is searched for", unit="s", low=1.0, high=60.0
    )
    every: int = parameter(2, "samples between two searches", low=1, high=100)
    significance_level: float = parameter(
        1e-6, "probability with which noise alone looks like a changepoint", low=1e-12, high=0.5
    )
    min_segment: float = parameter(
        0.5, "minimum distance between changepoints", unit="s", low=0.2, high=10.0
    )


@dataclass(frozen=True)
class Changepoint:
    """A confirmed changepoint.

    Attributes:
        sample: its index, counted from the first sample pushed.
        confirmed: index of the sample that confirmed it.
        probability: of a changepoint rather than noise; see `knot_probability`.
    """

    sample: int
    confirmed: int
    probability: float


class OnlineSegmenter:
    """Extends a segmentation sample by sample, with bounded memory and time per sample."""

    def __init__(
        self, vehicles: int | Sequence[Vehicle], dt: float, config: OnlineConfig = OnlineConfig()
    ) -> None:
        """Start without samples; `vehicles` are given, or their number if all are cars.

        Samples are `dt` seconds apart.
        """
        self._config = config
        self._dt = dt
        if isinstance(vehicles, int):
            vehicles = [Vehicle(str(n)) for n in range(vehicles)]
        self._vehicles = vehicles
        self._samples: deque[Floats] = deque(maxlen=round(config.window / dt))
        self._count = 0
        self._confirmed: deque[int] = deque(maxlen=2)

    def push(self, position: Floats, speed: Floats) -> list[Changepoint]:
        """Add one sample of every vehicle, and return the changepoints that it confirms.

        Args:
            position: (N, 2) m.
            speed: (N,) m/s.

        Raises:
            InputError: the shapes are wrong or a value is not finite.
        """
        row = np.column_stack([np.asarray(position, np.float64), np.asarray(speed, np.float64)])
        if row.shape != (len(self._vehicles), 3) or not np.isfinite(row).all():
            raise InputError(
                f"sample {self._count} needs finite positions (N, 2) and speeds (N,) of "
                f"N = {len(self._vehicles)} vehicles"
            )
        self._samples.append(row)
        self._count += 1
        is_due = self._count % self._config.every == 0
        if not is_due or len(self._samples) < 2.0 * self._config.delay / self._dt:
            return []
        return self._search()

    def _search(self) -> list[Changepoint]:
        """Search for changepoints after the last confirmed one."""
        config = self._config
        first = self._count - len(self._samples)
        stack = np.array(self._samples).transpose(1, 0, 2)
        position = np.stack([without_spikes(xy, MIN_SPIKE_M) for xy in stack[:, :, :2]])
        speed = np.stack([without_spikes(v, MIN_SPIKE_MPS)[:, 0] for v in stack[:, :, 2:]])
        position, speed = position[:, :-UNCHECKED_SAMPLES], speed[:, :-UNCHECKED_SAMPLES]
        trends = Trends.of(position, speed, self._dt, self._vehicles)
        min_gain = trends.threshold(config.significance_level)
        gap = max(2, round(config.min_segment / self._dt))
        fixed = [c - first for c in self._confirmed if c - first >= gap]
        start = max(
            (fixed[-1] if fixed else 0) + gap,
            len(self._samples) - round(config.look_back / self._dt),
        )
        free = np.arange(start, trends.samples - gap)
        points = trends.add(fixed, free, min_gain, gap)
        points = fixed + trends.align(points, gap, gap)[len(fixed) :]
        newest = len(self._samples) - round(config.delay / self._dt)
        changepoints = []
        for i, c in enumerate(points):
            gain = trends.gain(points, i) if start <= c <= newest else 0.0
            if gain > min_gain:
                probability = knot_probability(gain, trends, points, i)
                changepoints.append(Changepoint(first + c, self._count - 1, probability))
        self._confirmed.extend(c.sample for c in changepoints)
        if len(self._confirmed) == 2:
            self._forget(self._confirmed[0] - gap - first)
        return changepoints

    def _forget(self, count: int) -> None:
        """Remove the oldest samples; at least one stays."""
        for _ in range(min(count, len(self._samples) - 1)):
            self._samples.popleft()


def knot_probability(gain: float, trends: Trends, points: list[int], i: int) -> float:
    """Return the probability of a changepoint, given its gain, against noise alone.

    With n samples between the neighbouring knots and d signals, the log odds are
    (gain - d log n) / 2 - log n. All n places have the same prior probability, and together that
    of no changepoint.

    Source: BIC (Kass & Raftery 1995, eq. 9).

    Args:
        gain: see `Trends.gain`.
        trends: the signals.
        points: all knots.
        i: index of the changepoint.
    """
    edges = [0, *points, trends.samples - 1]
    n = edges[i + 2] - edges[i]
    odds = 0.5 * (gain - len(trends.signals) * np.log(float(n))) - np.log(float(n))
    return float(1.0 / (1.0 + np.exp(-min(max(odds, -50.0), 50.0))))
