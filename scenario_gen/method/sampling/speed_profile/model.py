# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Speeds of samples: the mean and a Gaussian process over time, conditioned on what must hold.

Two processes are added. Both have the kernel a(τ) a(τ') (1 - x) exp(-x / 2), x = ((τ - τ') / ℓ)²: that of the derivative
of a squared-exponential process, so that displacements stay bounded. The slow one displaces the vehicle along its route by σ_s;
the quick one is as strong, and as quick, as what the template does beside the mean. End speeds, the whole length and stands are
exact: they are conditions, not corrections. A draw that leaves its bounds is moved to the nearest one that keeps them, in
the metric of the process' own covariance: a quadratic programme in its standard normal numbers, solved by DAQP
(Arnström, Bemporad, Axehill 2022).
"""

from dataclasses import dataclass
from functools import cached_property

import daqp
import numpy as np
from scipy import linalg, ndimage

from scenario_gen.method.sampling.gp import covariance_root, principal
from scenario_gen.method.sampling.speed_profile.mean import Bounds, fixed_coefficients, Motion
from scenario_gen.method.sampling.speed_profile.spline import SpeedSpline
from scenario_gen.numerics import Bools, Floats, runs

SHARE = 0.85  # of the template's own deviation from the mean is drawn
PASSES = 2  # of that window: a strength that changes at once is a jerk of high frequency
WINDOW = 1.5  # s, of each pass over which the strength of that deviation is taken
QUICKEST, SLOWEST = 0.8, 2.0  # s, bounds of its length scale
QUICKNESS = 3.87  # ℓ² = 3.87 sd(r) / sd(r''), of the kernel smoothed by what a spline can follow
LENGTH_SMOOTHING = 1.5  # s, over which a change of the whole length is spread
JERK_ROOM = 1.05  # of a sample's jerk over the mean's bound
_TIED = 2  # coefficients of a stand whose neighbours' deviation is tied to it
_NEAR = 6.0  # standard deviations from a bound within which it is looked at
_TOLERANCE = 1e-6
_SOFT = 8  # DAQP's mark


@dataclass(frozen=True, eq=False)
class SpeedModel:
    """Speeds of one vehicle.

    Attributes:
        spline: the basis.
        mean: (n,) coefficients [m/s] of the mean speed, which drives the route's own length.
        longer: (n,) what each further metre adds.
        faster: (n, 2) what each further m/s at the start, and at the end, adds: no length.
        factor: (n, r) square root of the covariance.
        rows: (b, n) of what is bounded: coefficients, accelerations, jerks.
        low, high: (b,) their bounds.
        order: (b,) 1, 2, 3 for m/s, m/s², m/s³: how they change with the clock.
        time: (b,) when a row lies [s], on the template's clock.
    """

    spline: SpeedSpline
    mean: Floats
    longer: Floats
    faster: Floats
    factor: Floats
    rows: Floats
    low: Floats
    high: Floats
    order: Floats
    time: Floats

    @property
    def size(self) -> int:
        """Standard normal numbers needed per sample."""
        return int(self.factor.shape[1])

    @cached_property
    def bounded(self) -> Floats:
        """(b, r) what each standard normal number adds to what is bounded."""
        return self.rows @ self.factor

    def draw(
        self, z: Floats, longer: Floats, pace: Floats, ends: Floats, faster: Floats
    ) -> tuple[Floats, Bools]:
        """Coefficients (S, n) [m/s] and whether they keep what must hold (S,).

        Args:
            z: (S, r) standard normal numbers.
            longer: (S,) metres by which the sample's path is longer than the route.
            pace: (S, b) rate of the sample's clock over the nominal one, at the times of the bounds.
            ends: (S, 2) the same at the ends, where the speed of the vehicle, not that on the template's clock, is given.
            faster: (S, 2) m/s by which the vehicle is faster at the ends.
        """
        base = self.mean + longer[:, None] * self.longer
        base = base + ((ends - 1.0) * self.mean[[0, -1]] + faster) @ self.faster.T
        ok = np.ones(len(z), dtype=np.bool_)
        coefficients = base + z @ self.factor.T
        if len(self.rows):
            scale = np.select(
                [self.order == 1.0, self.order == 2.0], [pace, pace * pace], pace * pace * pace
            )
            middle, seen = base @ self.rows.T, coefficients @ self.rows.T
            low, high = self.low * scale, self.high * scale
            sense = np.where(self.order < 3.0, 0, _SOFT).astype(np.intc)
            broken = ((seen < low - _TOLERANCE) | (seen > high + _TOLERANCE)).any(axis=1)
            for s in np.flatnonzero(broken).tolist():
                x, _, flag, _ = daqp.solve(
                    np.eye(self.size),
                    -z[s],
                    self.bounded,
                    high[s] - middle[s],
                    low[s] - middle[s],
                    sense,
                )
                ok[s] = flag > 0
                if ok[s]:
                    coefficients[s] = base[s] + self.factor @ np.asarray(x)
        return np.maximum(coefficients, 0.0), ok


def speed_model(
    spline: SpeedSpline,
    mean: Floats,
    motion: Motion,
    bounds: Bounds,
    time: Floats,
    speed: Floats,
    sigma: float,
    length: float,
) -> SpeedModel:
    """Prepare the draws of one vehicle.

    Args:
        spline: the basis.
        mean: (n,) coefficients [m/s] of the mean.
        motion: acceleration and jerk on the nominal clock.
        bounds: what samples keep to.
        time: (T,) seconds of the template's samples.
        speed: (T,) m/s, the template's, scaled to the route.
        sigma: σ_s [m], standard deviation along the route.
        length: seconds over which that varies.
    """
    longer, faster = _spread_length(spline)
    factor = _conditioned(spline, _process(spline, mean, time, speed, sigma, length))
    unit, m = np.eye(spline.size), len(spline.stations)
    free = ~fixed_coefficients(spline, (0.0, 0.0))[0]
    rows = np.vstack([unit[free], motion.acceleration, motion.jerk])
    low = np.concatenate(
        [np.zeros(int(free.sum())), np.full(m, -bounds.braking), np.full(m, -bounds.jerk)]
    )
    high = np.concatenate(
        [bounds.most[free], np.full(m, bounds.speeding), np.full(m, bounds.jerk)]
    )
    order = np.repeat([1.0, 2.0, 3.0], [int(free.sum()), m, m])
    at = np.concatenate([spline.middle[free], spline.stations, spline.stations])
    driven = rows @ mean
    jerky = order == 3.0
    low = np.where(
        jerky, np.minimum(JERK_ROOM * low, driven), np.minimum(low, driven)
    )  # the mean itself is always kept
    high = np.where(jerky, np.maximum(JERK_ROOM * high, driven), np.maximum(high, driven))
    spread = np.sqrt(np.square(rows @ factor).sum(axis=1))
    near = (driven - low < _NEAR * spread) | (high - driven < _NEAR * spread)
    return SpeedModel(
        spline,
        mean,
        longer,
        faster,
        factor,
        rows[near],
        low[near],
        high[near],
        order[near],
        at[near],
    )


def _spread_length(spline: SpeedSpline) -> tuple[Floats, Floats]:
    """The smoothest ways to drive a metre more (n,), and to be faster by 1 m/s at either end (n, 2) over the same length.

    Stands, and what is not said to change, stay as they are; zero for a vehicle that stands throughout.
    """
    given, _ = fixed_coefficients(spline, (0.0, 0.0))
    free = np.flatnonzero(~given)
    longer, faster = np.zeros(spline.size), np.zeros((spline.size, 2))
    if len(free) == 0:
        return longer, faster
    stiff = spline.gram + LENGTH_SMOOTHING**4 * spline.bending
    loose = stiff[np.ix_(free, free)]
    way = linalg.solve(loose, spline.length[free], assume_a="pos")
    longer[free] = way / float(way @ spline.length[free])
    for k, end in enumerate((0, spline.size - 1)):
        if not spline.still[end]:
            faster[end, k] = 1.0
            faster[free, k] = -linalg.solve(loose, stiff[free, end], assume_a="pos")
            faster[:, k] -= longer * float(spline.length @ faster[:, k])
    return longer, faster


def kernel_root(time: Floats, amplitude: Floats, length: float) -> Floats:
    """Square root (n, r) of the covariance a a' (1 - x) exp(-x / 2) at times (n,) [s], with amplitudes (n,) and a length [s]."""
    x = np.square((time[:, None] - time) / length)
    return np.asarray(amplitude[:, None] * covariance_root((1.0 - x) * np.exp(-0.5 * x)))


def _process(
    spline: SpeedSpline, mean: Floats, time: Floats, speed: Floats, sigma: float, length: float
) -> Floats:
    """Square root (n, r) of the covariance of the coefficients, without conditions."""
    at = spline.middle
    inside = (time >= spline.breaks[0]) & (time <= spline.breaks[-1])
    rest = speed[inside] - spline.design(time[inside]) @ mean
    dt = float(time[1] - time[0])
    parts = [kernel_root(at, np.full(len(at), sigma / length), length)] if sigma > 0.0 else []
    curve = np.diff(rest, 2) / (dt * dt) if len(rest) > 2 else np.zeros(1)
    strong, quick = float(np.sqrt(np.square(rest).mean())), float(np.sqrt(np.square(curve).mean()))
    if sigma > 0.0 and strong > 1e-3:
        scale = min(max(float(np.sqrt(QUICKNESS * strong / max(quick, 1e-9))), QUICKEST), SLOWEST)
        width = 2 * round(0.5 * WINDOW / dt) + 1
        local = np.square(rest)
        for _ in range(PASSES):
            local = np.maximum(ndimage.uniform_filter1d(local, width, mode="nearest"), 0.0)
        local = np.sqrt(local)
        parts.append(kernel_root(at, SHARE * np.interp(at, time[inside], local), scale))
    if not parts:
        return np.zeros((len(at), 0))
    return np.asarray(np.linalg.solve(spline.design(at), np.hstack(parts)))


def _conditioned(spline: SpeedSpline, factor: Floats) -> Floats:
    """The square root (n, r) given that ends and stands are as they are and no length is added.

    What a vehicle does before a stand has nothing to do with what it does behind it: each part between stands has numbers of
    its own, and is tied down where it meets a stand by value and slope alone. (A process this smooth that were zero throughout
    a stand would be zero around it.)
    """
    given, _ = fixed_coefficients(spline, (0.0, 0.0))
    parts = []
    for a, b in runs(~spline.still):
        own = slice(max(a - _TIED, 0), min(b + _TIED, spline.size))
        tied = given[own].copy()
        piece = np.zeros_like(factor)
        piece[own] = factor[own]
        known = piece[own][tied]
        parts.append(_tied(piece, known[np.abs(known).max(axis=1, initial=0.0) > 0.0]))
        parts[-1][given] = 0.0
    whole = np.hstack([np.zeros((spline.size, 0)), *parts])
    root = principal(
        _tied(whole, (spline.length @ whole)[None] / float(spline.length.sum())), 1e-4
    )
    root[given] = 0.0  # to the last bit: a stand stands
    return root


def _tied(factor: Floats, known: Floats) -> Floats:
    """The square root (n, r) given that known (c, r) times its standard normal numbers is zero."""
    norm = np.sqrt(np.square(known).sum(axis=1))
    known = known[norm > 1e-9]
    if len(known) == 0:
        return factor
    return np.asarray(factor @ linalg.null_space(known, rcond=1e-9))
