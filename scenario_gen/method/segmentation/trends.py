# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Changepoints as knots of a constant-acceleration, constant-turn-rate law.

Within a primitive each vehicle's speed and course are nearly linear in time (paper IV-B). The
sampler finds the number of primitives and roughly where they change; features of windows of a
second or two cannot locate the change exactly. So its changepoints are shifted, by less than a
second, to where continuous piecewise-linear functions with knots at the changepoints fit speed and
course best. Changepoints that the fit does not need are dropped. Places with some posterior
probability of a changepoint are added if the fit needs them.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy import special

from scenario_gen.method.segmentation.hdp_hmm.problem import moving_mean
from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.kernels import F2, I, I1, kernel, OUT1
from scenario_gen.types import Motion

COURSE_NOISE_MPS = 0.3  # standard deviation of the speed across the course
COURSE_WINDOW_S = 0.9


class _Normal(NamedTuple):
    """Tridiagonal normal equations of the values at K knots."""

    diagonal: Floats
    off: Floats
    right: Floats


@kernel(inline=True)
def _accumulate(
    signal: Floats, weight: Floats, knots: Ints, normal: _Normal, total: float
) -> float:
    """Fill the normal equations of hat functions at the knots; return total + sum of squares."""
    diagonal, off, right = normal
    diagonal[:], off[:], right[:] = 1e-9, 0.0, 0.0
    count = len(knots)
    for k in range(count - 1):
        a, b = knots[k], knots[k + 1]
        for t in range(a, b + (1 if k == count - 2 else 0)):
            w = weight[t] ** 2
            y = signal[t]
            h = (t - a) / (b - a)
            diagonal[k] += w * (1.0 - h) ** 2
            off[k] += w * h * (1.0 - h)
            diagonal[k + 1] += w * h * h
            right[k] += w * (1.0 - h) * y
            right[k + 1] += w * h * y
            total += w * y * y
    return total


@kernel(inline=True)
def _eliminate(normal: _Normal, total: float) -> float:
    """Return the least squared misfit, given the weighted sum of squares, in one pass."""
    diagonal, off, right = normal
    for k in range(len(diagonal)):
        if k > 0:
            ratio = off[k - 1] / diagonal[k - 1]
            diagonal[k] -= ratio * off[k - 1]
            right[k] -= ratio * right[k - 1]
        total -= right[k] ** 2 / diagonal[k]
    return total


@kernel(F2, F2, I1, I, I1, OUT1)
def knot_misfits(
    signals: Floats, weights: Floats, knots: Ints, moved: int, places: Ints, out: Floats
) -> None:
    """Fill the weighted squared misfit of piecewise-linear functions, for each place of one knot.

    Args:
        signals: (n, T).
        weights: (n, T), the inverse of each sample's standard deviation.
        knots: (K,) rising sample indices; the first and last bound the samples that count.
        moved: index of the knot that is put at each of `places`; -1: none, and `places` has one
            entry that is not used.
        places: (P,) between the neighbours of that knot.
        out: (P,).
    """
    count = len(knots)
    current = knots.copy()
    normal = _Normal(np.empty(count), np.empty(count), np.empty(count))
    for place in range(len(places)):
        if moved >= 0:
            current[moved] = places[place]
        total = 0.0
        for row in range(signals.shape[0]):
            total = _accumulate(signals[row], weights[row], current, normal, total)
            total = _eliminate(normal, total)
        out[place] = total


Memo = dict[tuple[int, ...], tuple[float, int]]  # gain and place of a knot between others


@dataclass(frozen=True, eq=False)
class Trends:
    """The signals whose trends count: speed [m/s] and course [rad] of every vehicle.

    Attributes:
        signals: (2N, T), each minus its mean.
        weights: (2N, T), inverse standard deviations; 0 for the course of a slow vehicle.
    """

    signals: Floats
    weights: Floats

    @classmethod
    def of(cls, encounter: Motion) -> "Trends":
        """Return the trends of N vehicles, whose types say which speeds have no course.

        The standard deviation is at least that of the vehicle's type in speed, and 0.3 m/s across
        the course. Samples at which a vehicle is absent have weight 0.
        """
        signals, weights = list[Floats](), list[Floats]()
        samples, dt = encounter.speed.shape[1], encounter.dt
        for i, vehicle in enumerate(encounter.vehicles):
            present, kind = encounter.present_slice(i), vehicle.kind
            v = encounter.speed[i, present]
            noise, bend = kind.speed_noise, np.diff(v, 2)
            if len(bend):
                noise = max(noise, 1.4826 * float(np.median(np.abs(bend))) / np.sqrt(6.0))
            angle, pace = course(encounter.position[i, present], v, dt, kind.least_course)
            weight = np.where(pace > kind.least_course, pace / COURSE_NOISE_MPS, 0.0)
            edge = round(COURSE_WINDOW_S / dt) // 2
            weight[:edge] = 0.0  # half a window has three times the noise
            weight[len(weight) - edge :] = 0.0
            padding = (present.start, samples - present.stop)
            signals += [np.pad(v, padding, mode="edge"), np.pad(angle, padding, mode="edge")]
            weights += [np.pad(np.full(len(v), 1.0 / noise), padding), np.pad(weight, padding)]
        stack = np.array(signals)
        centred = np.ascontiguousarray(stack - stack.mean(axis=1, keepdims=True))
        return cls(centred, np.array(weights))

    def threshold(self, probability: float) -> float:
        """Return the gain that noise alone exceeds with this probability.

        It is a quantile of the chi-squared distribution with one degree per signal.
        """
        return float(special.chdtri(len(self.signals), probability))

    @property
    def samples(self) -> int:
        """T."""
        return int(self.signals.shape[1])

    def misfits(self, knots: list[int], moved: int, places: Ints) -> Floats:
        """Return the misfit (P,) for each place of knot number `moved` (-1: none is moved)."""
        out = np.empty(len(places))
        rising = np.array(knots, dtype=np.int64)
        knot_misfits(self.signals, self.weights, rising, moved, places, out)
        return out

    def _gain(self, points: list[int], i: int, memo: Memo) -> float:
        """Return the increase of the misfit without changepoint i."""
        knots, j = self._neighbours(points, i)
        return self._best_knot(knots[:j] + knots[j + 1 :], j, np.array([knots[j]]), memo)[0]

    def _neighbours(self, points: list[int], i: int) -> tuple[list[int], int]:
        """Return the knots from two before to two after changepoint i, and its index."""
        knots = [0, *points, self.samples - 1]
        low = max(i + 1 - 2, 0)
        return knots[low : i + 4], i + 1 - low

    def _best_knot(self, knots: list[int], j: int, places: Ints, memo: Memo) -> tuple[float, int]:
        """Return the largest gain of a new knot before knot number j, and its place."""
        key = (*knots, -1, j, int(places[0]), int(places[-1]), len(places))
        if key not in memo:
            without = self.misfits(knots, -1, places[:1])[0]
            misfits = self.misfits([*knots[:j], int(places[0]), *knots[j:]], j, places)
            memo[key] = (float(without - misfits.min()), int(places[misfits.argmin()]))
        return memo[key]

    def align(self, points: list[int], reach: int, gap: int) -> list[int]:
        """Shift each changepoint by up to `reach` samples to where the trends change.

        Changepoints stay at least `gap` samples apart.
        """
        aligned = list(points)
        for _ in range(3):
            before = list(aligned)
            for i, point in enumerate(points):
                knots, j = self._neighbours(aligned, i)
                low = max(point - reach, knots[j - 1] + gap)
                high = min(point + reach, knots[j + 1] - gap)
                if low <= high:
                    places = np.arange(low, high + 1)
                    aligned[i] = int(places[self.misfits(knots, j, places).argmin()])
            if aligned == before:
                break
        return aligned

    def drop(self, points: list[int], min_gain: float, max_count: int) -> list[int]:
        """Drop the least useful changepoints until each gains `min_gain`.

        More are dropped if there are more than `max_count`.
        """
        points, memo = list(points), Memo()
        while points:
            gains = [self._gain(points, i, memo) for i in range(len(points))]
            i = int(np.argmin(gains))
            if gains[i] >= min_gain and len(points) <= max_count:
                break
            del points[i]
        return points

    def add(self, points: list[int], candidates: Ints, min_gain: float, gap: int) -> list[int]:
        """Add the most useful ones of candidates (C,) while they gain more than `min_gain`."""
        points, memo = list(points), Memo()
        while True:
            knots = [0, *points, self.samples - 1]
            best = (min_gain, 0, 0)
            for i in range(len(points) + 1):
                is_free = (candidates >= knots[i] + gap) & (candidates <= knots[i + 1] - gap)
                places = candidates[is_free]
                if len(places):
                    low = max(i - 1, 0)
                    neighbours = knots[low : i + 3]
                    gain, place = self._best_knot(neighbours, i + 1 - low, places, memo)
                    best = max(best, (gain, place, i))
            gain, place, i = best
            if gain <= min_gain:
                return points
            points.insert(i, place)


def course(
    position: Floats, speed: Floats, dt: float, least: float = 1.0
) -> tuple[Floats, Floats]:
    """Return the course over ground (T,) [rad], unwrapped, and the smoothed speed (T,) [m/s].

    The course is held where the vehicle is slower than `least` [m/s].
    """
    half = max(1, min(round(COURSE_WINDOW_S / dt) // 2, (len(speed) - 1) // 2))
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
