# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Changepoints as knots of a constant-acceleration, constant-turn-rate law: put them where the trends change.

Within a primitive each vehicle's speed and course are nearly linear in time (paper IV-B). The sampler says how many
primitives there are and about where they change; features taken over windows of a second or two cannot say exactly
where. So its changepoints are shifted, by less than a second, to where continuous piecewise-linear functions with knots
at the changepoints describe speed and course best; changepoints that this description does not miss are dropped, and
places where the posterior sees some chance of one, and which it does miss, are added.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy import special

from scenario_gen.method.segmentation.hdp_hmm.problem import moving_mean
from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.kernels import F2, I, I1, kernel, OUT1
from scenario_gen.types import ALWAYS, canonical_presence, Vehicle

COURSE_NOISE = 0.3
COURSE_WINDOW = 0.9


@kernel(F2, F2, I1, I, I1, OUT1)
def knot_misfits(
    signals: Floats, weights: Floats, knots: Ints, moved: int, places: Ints, out: Floats
) -> None:
    """Weighted squared misfit of continuous piecewise-linear functions, for each place of one knot.

    The hat functions' normal equations are tridiagonal: accumulated and eliminated in one pass.

    Args:
        signals: (n, T).
        weights: (n, T), the inverse of each sample's standard deviation.
        knots: (K,) rising sample indices; the first and last bound the stretch looked at.
        moved: index of the knot that is put at each of `places`; -1: none, and `places` has one entry that is not used.
        places: (P,) between the neighbours of that knot.
        out: (P,).
    """
    count = len(knots)
    at = knots.copy()
    diagonal, beside, right = np.empty(count), np.empty(count), np.empty(count)
    for place in range(len(places)):
        if moved >= 0:
            at[moved] = places[place]
        total = 0.0
        for row in range(signals.shape[0]):
            for k in range(count):
                diagonal[k], beside[k], right[k] = 1e-9, 0.0, 0.0
            for k in range(count - 1):
                a, b = at[k], at[k + 1]
                for t in range(a, b + (1 if k == count - 2 else 0)):
                    w = weights[row, t] ** 2
                    y = signals[row, t]
                    h = (t - a) / (b - a)
                    diagonal[k] += w * (1.0 - h) ** 2
                    beside[k] += w * h * (1.0 - h)
                    diagonal[k + 1] += w * h * h
                    right[k] += w * (1.0 - h) * y
                    right[k + 1] += w * h * y
                    total += w * y * y
            for k in range(count):
                if k > 0:
                    ratio = beside[k - 1] / diagonal[k - 1]
                    diagonal[k] -= ratio * beside[k - 1]
                    right[k] -= ratio * right[k - 1]
                total -= right[k] ** 2 / diagonal[k]
        out[place] = total


@dataclass(frozen=True, eq=False)
class Trends:
    """The signals whose trends count: speed [m/s] and course [rad] of every vehicle.

    Attributes:
        signals: (2N, T), each less its mean.
        weights: (2N, T), inverse standard deviations; 0 for the course of a vehicle that hardly moves.
    """

    signals: Floats
    weights: Floats
    _cache: dict[tuple[int, ...], tuple[float, int]] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        position: Floats,
        speed: Floats,
        dt: float,
        vehicles: Sequence[Vehicle],
        present: Ints = ALWAYS,
    ) -> "Trends":
        """Take the trends of N vehicles; noise is at least that of its type in speed, and 0.3 m/s across the course.

        Args:
            position: (N, T, 2) m.
            speed: (N, T) m/s.
            dt: s.
            vehicles: N, whose types say what is noise and how slow one is that has no course.
            present: (N, 2) first and last sample of each vehicle; outside of them nothing has weight.
        """
        signals, weights = [], []
        samples = speed.shape[1]
        for i, (first, last) in enumerate(
            canonical_presence(present, len(speed), samples, "trends").tolist()
        ):
            xy, v, kind = (
                position[i, first : last + 1],
                speed[i, first : last + 1],
                vehicles[i].kind,
            )
            beyond = (first, samples - 1 - last)
            bend = np.diff(v, 2)
            noise = max(
                kind.speed_noise,
                1.4826 * float(np.median(np.abs(bend))) / np.sqrt(6.0) if len(bend) else 0.0,
            )
            signals.append(np.pad(v, beyond, mode="edge"))
            weights.append(np.pad(np.full(len(v), 1.0 / noise), beyond))
            angle, pace = course(xy, v, dt, kind.least_course)
            signals.append(np.pad(angle, beyond, mode="edge"))
            sure = np.where(pace > kind.least_course, pace / COURSE_NOISE, 0.0)
            edge = round(COURSE_WINDOW / dt) // 2
            sure[:edge] = sure[len(sure) - edge :] = 0.0  # half a window has three times the noise
            weights.append(np.pad(sure, beyond))
        stack = np.array(signals)
        return cls(
            np.ascontiguousarray(stack - stack.mean(axis=1, keepdims=True)), np.array(weights)
        )

    def threshold(self, chance: float) -> float:
        """Return the gain that noise alone exceeds with probability `chance`: a quantile of χ² with one degree per signal."""
        return float(special.chdtri(len(self.signals), chance))

    @property
    def samples(self) -> int:
        """T."""
        return int(self.signals.shape[1])

    def misfits(self, knots: list[int], moved: int, places: Ints) -> Floats:
        """(P,) misfit for each place of knot number `moved` (-1: the misfit as it is)."""
        out = np.empty(len(places))
        knot_misfits(
            self.signals, self.weights, np.array(knots, dtype=np.int64), moved, places, out
        )
        return out

    def gain(self, points: list[int], i: int) -> float:
        """Return how much worse the description is without changepoint i."""
        knots, j = self._around(points, i)
        return self._best(knots[:j] + knots[j + 1 :], j, np.array([knots[j]]))[0]

    def _around(self, points: list[int], i: int) -> tuple[list[int], int]:
        """Knots that bear on changepoint i: two on either side; and its index among them."""
        every = [0, *points, self.samples - 1]
        low = max(i + 1 - 2, 0)
        return every[low : i + 4], i + 1 - low

    def _best(self, knots: list[int], j: int, places: Ints) -> tuple[float, int]:
        """Return the largest gain of one more knot before knot number j, and where."""
        key = (*knots, -1, j, int(places[0]), int(places[-1]), len(places))
        if key not in self._cache:
            without = self.misfits(knots, -1, places[:1])[0]
            costs = self.misfits([*knots[:j], int(places[0]), *knots[j:]], j, places)
            self._cache[key] = (float(without - costs.min()), int(places[costs.argmin()]))
        return self._cache[key]

    def settle(self, points: list[int], reach: int, gap: int, rounds: int = 3) -> list[int]:
        """Shift each changepoint by up to `reach` samples to where the trends change; at least `gap` samples apart."""
        home, points = list(points), list(points)
        for _ in range(rounds):
            before = list(points)
            for i in range(len(points)):
                knots, j = self._around(points, i)
                low = max(home[i] - reach, knots[j - 1] + gap)
                high = min(home[i] + reach, knots[j + 1] - gap)
                if low <= high:
                    places = np.arange(low, high + 1)
                    points[i] = int(places[self.misfits(knots, j, places).argmin()])
            if points == before:
                break
        return points

    def drop(self, points: list[int], least_gain: float, most: int) -> list[int]:
        """Drop changepoints, always the least useful one, until each gains `least_gain` and there are `most` at most."""
        points = list(points)
        while points:
            gains = [self.gain(points, i) for i in range(len(points))]
            i = int(np.argmin(gains))
            if gains[i] >= least_gain and len(points) <= most:
                break
            del points[i]
        return points

    def add(self, points: list[int], candidates: Ints, least_gain: float, gap: int) -> list[int]:
        """Add candidates (C,), always the most useful one, while one gains `least_gain`."""
        points = list(points)
        while True:
            every = [0, *points, self.samples - 1]
            best = (least_gain, 0, 0)
            for i in range(len(points) + 1):
                places = candidates[
                    (candidates >= every[i] + gap) & (candidates <= every[i + 1] - gap)
                ]
                if len(places):
                    low = max(i - 1, 0)
                    gain, place = self._best(every[low : i + 3], i + 1 - low, places)
                    best = max(best, (gain, place, i))
            if best[0] <= least_gain:
                return points
            points.insert(best[2], best[1])


def course(
    position: Floats, speed: Floats, dt: float, least: float = 1.0
) -> tuple[Floats, Floats]:
    """Course over ground [rad], unwrapped and held where it is slower than `least` [m/s], and smoothed speed [m/s], each (T,)."""
    half = max(1, min(round(COURSE_WINDOW / dt) // 2, (len(speed) - 1) // 2))
    steps = np.arange(-half, half + 1)
    padded = np.pad(position, ((half, half), (0, 0)), mode="reflect", reflect_type="odd")
    velocity = (sliding_window_view(padded, 2 * half + 1, axis=0) @ steps) / ((steps @ steps) * dt)
    pace = moving_mean(speed, 2 * half + 1)
    moves = pace > least
    angle = np.arctan2(velocity[:, 1], velocity[:, 0])
    if moves.any():
        last = np.maximum.accumulate(np.where(moves, np.arange(len(speed)), 0))
        angle = angle[np.maximum(last, int(np.argmax(moves)))]
    return np.unwrap(angle), pace
