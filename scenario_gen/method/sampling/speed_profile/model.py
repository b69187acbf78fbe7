# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Speeds of samples: the mean and a Gaussian process over time, conditioned on what must hold.

Two processes are added. Both have the kernel a(τ) a(τ') (1 - x) exp(-x / 2), x = ((τ - τ') / ℓ)²:
that of the derivative of a squared-exponential process, so displacements are bounded. The slow one
displaces the vehicle along its route by σ_s; the quick one is as strong and as quick as the
template's deviation from the mean. End speeds, length and stands are exact: they are conditions,
not corrections. A draw that leaves its bounds is moved to the nearest one that keeps them, in the
metric of the process' covariance: a quadratic program in its standard normal numbers, solved by
DAQP (Arnström, Bemporad, Axehill 2022).

A driver brakes and accelerates more strongly than another one. A phase of the mean speed u(τ) is
an interval of braking, or of acceleration, a(τ) = u'(τ). A driver who is stronger by a factor k
has k a(c + k (τ - c)) instead: the same change of speed in a shorter time. With the centroid c =
∫ τ a dτ / ∫ a dτ the place before and after the phase is the same at the same time, so the driver
arrives when the recorded one does. A phase is not extended into a stand, or beyond an end of the
recording, and not made stronger than drivers usually are.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import daqp
import numpy as np
from scipy import linalg, ndimage

from scenario_gen.method.sampling.gp import covariance_root, principal
from scenario_gen.method.sampling.speed_profile.mean import fixed_coefficients, MeanSpeed
from scenario_gen.method.sampling.speed_profile.spline import SpeedSpline
from scenario_gen.numerics import Bools, Floats, runs

MAX_FACTOR = 2.2  # of strength, and its inverse
_STEP_S = 0.05
_PHASE_MPS2 = 0.15  # acceleration from which a phase begins
_PHASE_MPS = 0.5  # least change of speed in a phase
_NODES_COUNT = 9
_USUAL_MPS2 = (3.0, 2.0)  # braking and acceleration up to which drivers are stronger


@dataclass(frozen=True, eq=False)
class Strength:
    """The change of the mean speed of a stronger or weaker driver.

    Attributes:
        log_factor: (K,) logarithms of factors.
        change: (2, K, n) change of the coefficients [m/s] in braking, and in acceleration.
    """

    log_factor: Floats
    change: Floats

    @classmethod
    def of(cls, spline: SpeedSpline, mean: Floats, longer: Floats) -> "Strength":
        """Prepare the changes.

        Args:
            spline: the basis.
            mean: (n,) coefficients [m/s] of the mean speed.
            longer: (n,) effect of each further metre.
        """
        log_factor = np.linspace(-1.0, 1.0, _NODES_COUNT) * np.log(MAX_FACTOR)
        change = np.zeros((2, _NODES_COUNT, spline.size))
        if mean.max(initial=0.0) <= 0.0:
            return cls(log_factor, change)
        inverse = np.linalg.inv(spline.design(spline.middle))
        inverse[spline.still] = 0.0
        for kind, sign in enumerate((-1.0, 1.0)):
            for phase in _phases(spline, mean, sign, _USUAL_MPS2[kind]):
                rows = [phase.change(factor, spline.middle) for factor in np.exp(log_factor)]
                change[kind] += np.array(rows) @ inverse.T
        change -= (change @ spline.length)[..., None] * longer
        return cls(log_factor, change)

    @property
    def effect(self) -> Floats:
        """(n, 2) mean effect of a unit of the logarithms on the coefficients [m/s]."""
        typical = 0.5 * self.log_factor[-1] * np.eye(2)
        rise = self.changes(typical) - self.changes(-typical)
        return np.asarray(rise.T / self.log_factor[-1])

    def changes(self, log_factor: Floats) -> Floats:
        """Return the change (S, n) of the coefficients for logarithms (S, 2) of factors."""
        spacing = self.log_factor[1] - self.log_factor[0]
        known = np.clip(log_factor, *self.log_factor[[0, -1]])
        distance = np.abs(known[..., None] - self.log_factor) / spacing
        weight = np.maximum(1.0 - distance, 0.0)  # linear interpolation
        return np.asarray(np.einsum("skj,kjn->sn", weight, self.change))


@dataclass(frozen=True, eq=False)
class _Phase:
    """A phase of braking or of acceleration.

    Attributes:
        time: (q,) seconds.
        gained: (q,) change of speed [m/s] since its begin.
        centre: its centroid [s].
        least: the least factor; a smaller one would extend it too far.
        most: the greatest factor; a greater one would be unusually strong.
    """

    time: Floats
    gained: Floats
    centre: float
    least: float
    most: float

    def change(self, factor: float, at: Floats) -> Floats:
        """Return by how much speeds (n,) [m/s] at times `at` (n,) [s] change with a factor."""
        factor = max(min(factor, self.most), self.least)
        scaled = self.centre + factor * (at - self.centre)
        return np.interp(scaled, self.time, self.gained) - np.interp(at, self.time, self.gained)


def _phases(spline: SpeedSpline, mean: Floats, sign: float, usual: float) -> Iterator[_Phase]:
    """Yield the phases of braking (sign -1) or of acceleration (1); `usual` [m/s²] limits them."""
    start, end = spline.breaks[[0, -1]].tolist()
    time = np.linspace(start, end, max(round((end - start) / _STEP_S), 2) + 1)
    speed, acceleration = spline.design(time) @ mean, spline.design(time, 1) @ mean
    for a, b in runs(sign * acceleration > _PHASE_MPS2):
        if b - a < 2 or abs(speed[b - 1] - speed[a]) < _PHASE_MPS:
            continue
        part = slice(a, b)
        weight = acceleration[part] / acceleration[part].sum()
        centre = float(weight @ time[part])
        standing = np.flatnonzero(speed <= 1e-3)
        low = time[standing[standing < a].max(initial=0)]
        high = time[standing[standing >= b].min(initial=len(time) - 1)]
        least = max(
            (centre - time[a]) / max(centre - low, 1e-9),
            (time[b - 1] - centre) / max(high - centre, 1e-9),
        )
        most = max(usual / float(np.abs(acceleration[part]).max()), 1.0)
        yield _Phase(time[part], speed[part] - speed[a], centre, float(least), most)


_DAQP_SOFT_CODE = 8  # of a constraint that may be violated at a price


@dataclass(frozen=True)
class _Process:
    """Choices of the processes, tuned against recorded drives (docs/benchmarks.md).

    Attributes:
        share: of the template's deviation from the mean that is drawn.
        window: s, for each of two passes over which its strength is averaged: a sudden change of
            strength is a jerk.
        min_length, max_length: s, of its length scale.
        quickness: ℓ² = quickness sd(r) / sd(r''), for the kernel smoothed by the spline.
        length_smoothing: s over which a change of the length is spread.
        jerk_room: a sample's largest jerk over the mean's bound.
        stand_overlap: coefficients of a stand to which a neighbouring deviation is tied.
        near_sigmas: standard deviations from a bound within which it is checked.
        tolerance: by which a bound may be exceeded.
    """

    share: float = 0.85
    window: float = 1.5
    min_length: float = 0.8
    max_length: float = 2.0
    quickness: float = 3.87
    length_smoothing: float = 1.5
    jerk_room: float = 1.05
    stand_overlap: int = 2
    near_sigmas: float = 6.0
    tolerance: float = 1e-6


_PROCESS = _Process()


@dataclass(frozen=True, eq=False)
class SpeedModel:
    """Speeds of one vehicle.

    Attributes:
        spline: the basis.
        mean: (n,) coefficients [m/s] of the mean speed, which drives the length of the route.
        longer: (n,) effect of each further metre.
        faster: (n, 2) effect of each further m/s at the start, and at the end: no length.
        strength: effect of a driver who brakes and accelerates more strongly.
        factor: (n, r) square root of the covariance.
        rows: (b, n) of the bounded values: coefficients, accelerations, jerks.
        low, high: (b,) their bounds.
        order: (b,) 1, 2, 3 for m/s, m/s², m/s³: how they change with the clock.
        time: (b,) seconds of each row, on the template's clock.
    """

    spline: SpeedSpline
    mean: Floats
    longer: Floats
    faster: Floats
    strength: Strength
    factor: Floats
    rows: Floats
    low: Floats
    high: Floats
    order: Floats
    time: Floats

    @classmethod
    def of(
        cls,
        spline: SpeedSpline,
        mean: MeanSpeed,
        time: Floats,
        speed: Floats,
        sigma: float,
        length: float,
    ) -> "SpeedModel":
        """Prepare the draws of one vehicle.

        Args:
            spline: the basis.
            mean: the mean speed.
            time: (T,) seconds of the template's samples.
            speed: (T,) m/s, the template's, scaled to the route.
            sigma: σ_s [m], standard deviation along the route.
            length: seconds over which that varies.
        """
        longer, faster = _spread_length(spline)
        strength = Strength.of(spline, mean.coefficients, longer)
        deviation = speed - spline.design(time) @ mean.coefficients
        factor = _conditioned(spline, _process(spline, time, deviation, sigma, length))
        free, m = ~fixed_coefficients(spline, (0.0, 0.0))[0], len(spline.stations)
        bounds, motion = mean.bounds, mean.motion
        limits = [(bounds.deceleration, bounds.acceleration), (bounds.jerk, bounds.jerk)]
        rows = np.vstack([np.eye(spline.size)[free], motion.acceleration, motion.jerk])
        low = np.concatenate([np.zeros(free.sum()), *(np.full(m, -below) for below, _ in limits)])
        high = np.concatenate([bounds.speed[free], *(np.full(m, above) for _, above in limits)])
        order = np.repeat([1.0, 2.0, 3.0], [int(free.sum()), m, m])
        at = np.concatenate([spline.middle[free], spline.stations, spline.stations])

        driven = rows @ mean.coefficients  # the mean itself is always within bounds
        room = np.where(order == 3.0, _PROCESS.jerk_room, 1.0)
        low, high = np.minimum(room * low, driven), np.maximum(room * high, driven)
        reach = _PROCESS.near_sigmas * np.sqrt(np.square(rows @ factor).sum(axis=1))
        near = (driven - low < reach) | (high - driven < reach)
        bounded = (rows[near], low[near], high[near], order[near], at[near])
        return cls(spline, mean.coefficients, longer, faster, strength, factor, *bounded)

    @property
    def count(self) -> int:
        """Standard normal numbers per sample."""
        return int(self.factor.shape[1])

    @cached_property
    def bounded(self) -> Floats:
        """(b, r) effect of each standard normal number on the bounded values."""
        return self.rows @ self.factor

    def draw(
        self,
        z: Floats,
        longer: Floats,
        pace: Floats,
        ends: Floats,
        faster: Floats,
        log_strength: Floats | None = None,
    ) -> tuple[Floats, Bools]:
        """Return coefficients (S, n) [m/s], and whether they meet all conditions (S,).

        Args:
            z: (S, r) standard normal numbers.
            longer: (S,) metres by which the sample's path is longer than the route.
            pace: (S, b) rate of the sample's clock over the nominal one, at the times of the
                bounds.
            ends: (S, 2) the same at the ends, where the speed of the vehicle is given rather than
                that on the template's clock.
            faster: (S, 2) m/s by which the vehicle is faster at the ends.
            log_strength: (S, 2) logarithms of the strength of braking and of acceleration; None:
                as in the mean.
        """
        base, jerk = self.mean + longer[:, None] * self.longer, np.ones(len(z))
        if log_strength is not None:
            base = base + self.strength.changes(log_strength)
            jerk = np.exp(np.maximum(2.0 * log_strength.max(axis=1), 0.0))
        base = base + ((ends - 1.0) * self.mean[[0, -1]] + faster) @ self.faster.T
        coefficients = base + z @ self.factor.T
        feasible = np.ones(len(z), dtype=np.bool_)
        if len(self.rows):
            cubed = pace * pace * pace * jerk[:, None]
            scale = np.select([self.order == 1.0, self.order == 2.0], [pace, pace * pace], cubed)
            low, high = self.low * scale, self.high * scale
            values, tolerance = coefficients @ self.rows.T, _PROCESS.tolerance
            broken = ((values < low - tolerance) | (values > high + tolerance)).any(axis=1)
            middle = base @ self.rows.T
            for s in np.flatnonzero(broken).tolist():
                x = self._nearest(z[s], low[s] - middle[s], high[s] - middle[s])
                feasible[s] = x is not None
                if x is not None:
                    coefficients[s] = base[s] + self.factor @ x
        return np.maximum(coefficients, 0.0), feasible

    def _nearest(self, z: Floats, low: Floats, high: Floats) -> Floats | None:
        """Return the numbers (r,) nearest to z (r,) within bounds (b,); None if there are none."""
        sense = np.where(self.order < 3.0, 0, _DAQP_SOFT_CODE).astype(np.intc)
        x, _, flag, _ = daqp.solve(np.eye(self.count), -z, self.bounded, high, low, sense)
        return np.asarray(x) if flag > 0 else None


def _spread_length(spline: SpeedSpline) -> tuple[Floats, Floats]:
    """Return the smoothest ways to drive a metre more (n,), and to be faster at an end (n, 2).

    The latter is by 1 m/s, over the same length. Stands are unchanged; both are zero for a vehicle
    that stands throughout.
    """
    given, _ = fixed_coefficients(spline, (0.0, 0.0))
    free = np.flatnonzero(~given)
    longer, faster = np.zeros(spline.size), np.zeros((spline.size, 2))
    if len(free) == 0:
        return longer, faster
    stiffness = spline.gram + _PROCESS.length_smoothing**4 * spline.bending
    inner = stiffness[np.ix_(free, free)]
    way = linalg.solve(inner, spline.length[free], assume_a="pos")
    longer[free] = way / float(way @ spline.length[free])
    for k, end in enumerate((0, spline.size - 1)):
        if not spline.still[end]:
            faster[end, k] = 1.0
            faster[free, k] = -linalg.solve(inner, stiffness[free, end], assume_a="pos")
            faster[:, k] -= longer * float(spline.length @ faster[:, k])
    return longer, faster


def kernel_root(time: Floats, amplitude: Floats, length: float) -> Floats:
    """Return the square root (n, r) of the covariance a a' (1 - x) exp(-x / 2).

    Args:
        time: (n,) seconds.
        amplitude: (n,) a.
        length: ℓ [s].
    """
    x = np.square((time[:, None] - time) / length)
    return np.asarray(amplitude[:, None] * covariance_root((1.0 - x) * np.exp(-0.5 * x)))


def _process(
    spline: SpeedSpline, time: Floats, deviation: Floats, sigma: float, length: float
) -> Floats:
    """Return the square root (n, r) of the covariance of the coefficients, without conditions.

    `deviation` (T,) [m/s] is that of the template's speed from the mean, at `time` (T,) [s].
    """
    at = spline.middle
    if sigma == 0.0:
        return np.zeros((len(at), 0))
    parts = [kernel_root(at, np.full(len(at), sigma / length), length)]
    strength = float(np.sqrt(np.square(deviation).mean()))
    if strength > 1e-3:
        dt = float(time[1] - time[0])
        bend = np.diff(deviation, 2) / (dt * dt) if len(deviation) > 2 else np.zeros(1)
        quickness = float(np.sqrt(np.square(bend).mean()))
        scale = float(np.sqrt(_PROCESS.quickness * strength / max(quickness, 1e-9)))
        scale = min(max(scale, _PROCESS.min_length), _PROCESS.max_length)
        width = 2 * round(0.5 * _PROCESS.window / dt) + 1
        local = np.square(deviation)
        for _ in range(2):
            local = np.maximum(ndimage.uniform_filter1d(local, width, mode="nearest"), 0.0)
        amplitude = _PROCESS.share * np.interp(at, time, np.sqrt(local))
        parts.append(kernel_root(at, amplitude, scale))
    return np.asarray(np.linalg.solve(spline.design(at), np.hstack(parts)))


def _conditioned(spline: SpeedSpline, factor: Floats) -> Floats:
    """Return the square root (n, r) given that ends and stands are fixed and no length is added.

    Motion before a stand is independent of motion after it: each part between stands has its
    numbers, and is tied where it meets a stand by value and slope alone. (A process this smooth
    that was zero throughout a stand would be zero around it.)
    """
    given, _ = fixed_coefficients(spline, (0.0, 0.0))
    parts = [np.zeros((spline.size, 0))]
    for a, b in runs(~spline.still):
        overlap = _PROCESS.stand_overlap
        span = slice(max(a - overlap, 0), min(b + overlap, spline.size))
        piece = np.zeros_like(factor)
        piece[span] = factor[span]
        known = factor[span][given[span]]
        part = _tied(piece, known[np.abs(known).max(axis=1, initial=0.0) > 0.0])
        part[given] = 0.0
        parts.append(part)
    whole = np.hstack(parts)
    length = (spline.length @ whole)[None] / float(spline.length.sum())
    root = principal(_tied(whole, length))
    root[given] = 0.0  # exactly: a stand stands
    return root


def _tied(factor: Floats, known: Floats) -> Floats:
    """Return the square root (n, r) given that known (c, r) times its numbers is zero."""
    norm = np.sqrt(np.square(known).sum(axis=1))
    known = known[norm > 1e-9]
    if len(known) == 0:
        return factor
    return np.asarray(factor @ linalg.null_space(known, rcond=1e-9))
