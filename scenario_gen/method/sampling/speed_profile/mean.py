# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The mean speed of a vehicle: what the primitives tell of the template, driven smoothly on the route.

    minimise  ∫ (u - v̂)² + ℓ⁴ u''² dτ + w Σ_k (s(τ_k) - s_k)²

over cubic splines u(τ) = ds/dτ on the template's clock. v̂ are the straight lines, joined at the knots of the primitives,
that fit the template's speed best; s_k is where the route has the k-th changepoint. The whole length and both end speeds
are exact, stands are stands, limits of speed and acceleration are kept; jerk above its bound has a price and is said.
A convex quadratic programme, solved by Clarabel's interior-point method (Goulart and Chen 2024).
"""

from dataclasses import dataclass

import clarabel  # type: ignore[import-untyped,unused-ignore]
import numpy as np
from scipy import linalg, sparse

from scenario_gen.method.sampling.speed_profile.knots import SpeedKnots
from scenario_gen.method.sampling.speed_profile.spline import SpeedSpline
from scenario_gen.numerics import Bools, Floats

SMOOTHING = 0.5  # s, ℓ: kinks of the lines are rounded over about this time
SHARP_WEIGHT = 0.3  # of how near the lines are to the speeds before they are rounded; it decides what rounding hides
ANCHOR_WEIGHT = 10.0  # 1/s, w: a changepoint passed 0.5 m from its place weighs as 1.6 m/s too fast for a second
JERK_PRICE = 20.0  # m s, of each 1 m/s³ above the bound for a second


@dataclass(frozen=True, eq=False)
class Bounds:
    """What a speed must keep to.

    Attributes:
        most: (n,) m/s, upper bound of each coefficient.
        speeding, braking: m/s², strongest acceleration and deceleration.
        jerk: m/s³.
    """

    most: Floats
    speeding: float
    braking: float
    jerk: float


@dataclass(frozen=True, eq=False)
class Motion:
    """Acceleration and jerk on a slowed clock, as linear functions of the coefficients.

    With r = dt/dτ the speed is u / r; the rest is the chain rule.

    Attributes:
        rate: (b,) r at the spline's stations.
        acceleration, jerk: (b, n) rows.
    """

    rate: Floats
    acceleration: Floats
    jerk: Floats

    @classmethod
    def of(cls, spline: SpeedSpline, rate: Floats, slope: Floats, bend: Floats) -> "Motion":
        """Take r, r' [1/s] and r'' [1/s²] (b,) at the spline's stations."""
        r, a, b = rate[:, None], slope[:, None], bend[:, None]
        u, du, ddu = spline.at_stations
        cubed = r * r * r
        acceleration = du / (r * r) - u * a / cubed
        jerk = (
            ddu / cubed - (3.0 * du * a + u * b) / (cubed * r) + 3.0 * u * a * a / (cubed * r * r)
        )
        return cls(rate, acceleration, jerk)


@dataclass(frozen=True, eq=False)
class Target:
    """What the mean speed should be near to.

    Attributes:
        time: (q,) seconds on the template's clock.
        speed: (q,) m/s there, straight lines between.
        anchor_time: (K,) seconds of the changepoints.
        anchor: (K,) metres on the route.
        ends: m/s at the start and at the end, on the template's clock.
        length: metres in all.
    """

    time: Floats
    speed: Floats
    anchor_time: Floats
    anchor: Floats
    ends: tuple[float, float]
    length: float


def fixed_coefficients(spline: SpeedSpline, ends: tuple[float, float]) -> tuple[Bools, Floats]:
    """Which coefficients are given (n,), and their values [m/s]: none in stands, the ends' speeds at the ends."""
    given, value = spline.still.copy(), np.zeros(spline.size)
    given[[0, -1]] = True
    value[[0, -1]] = np.where(spline.still[[0, -1]], 0.0, ends)
    return given, value


def rounded_lines(
    spline: SpeedSpline, knots: SpeedKnots, time: Floats, speed: Floats, ends: tuple[float, float]
) -> Floats:
    """Speeds (M,) [m/s] at the knots whose straight lines, once rounded by the smoothing, fit the template's best.

    Args:
        spline: the basis.
        knots: times of the lines' knots, and where they stand.
        time: (T,) seconds.
        speed: (T,) m/s.
        ends: speeds [m/s] at start and end.
    """
    lines = np.interp(knots.knot, time, speed)
    free = ~(np.append(knots.still, False) | np.append(False, knots.still))
    given, value = fixed_coefficients(spline, ends)
    hats = np.eye(len(lines))[free]
    if given.all() or not free.any():
        return np.where(free, lines, 0.0)
    stiff = _smoothness(spline)
    right = np.column_stack([spline.projected(knots.knot, hat) for hat in hats])
    loose = np.flatnonzero(~given)
    rounded, base = np.zeros((spline.size, len(hats))), value.copy()
    rounded[loose] = linalg.solve(stiff[np.ix_(loose, loose)], right[loose], assume_a="pos")
    base[loose] -= linalg.solve(stiff[np.ix_(loose, loose)], stiff[loose] @ value, assume_a="pos")
    seen = spline.design(time)
    guess = lines[free]
    lines = np.where(free, lines, 0.0)
    sharp = SHARP_WEIGHT * np.array([np.interp(time, knots.knot, hat) for hat in hats]).T
    rest = speed - seen @ (base + rounded @ guess)
    sharp_rest = SHARP_WEIGHT * (speed - np.interp(time, knots.knot, lines))
    lines[free] += np.linalg.lstsq(
        np.vstack([seen @ rounded, sharp]), np.concatenate([rest, sharp_rest]), rcond=None
    )[0]
    return np.asarray(np.maximum(lines, 0.0))


def _smoothness(spline: SpeedSpline) -> Floats:
    """(n, n) of the quadratic form ∫ u² + ℓ⁴ u″² dτ."""
    return np.asarray(spline.gram + SMOOTHING**4 * spline.bending)


def mean_speed(
    spline: SpeedSpline, target: Target, motion: Motion, bounds: Bounds
) -> Floats | None:
    """Coefficients (n,) [m/s] of the mean speed, None if none meets the bounds."""
    n, m = spline.size, len(spline.stations)
    reach = spline.driven(target.anchor_time)
    hessian = _smoothness(spline) + ANCHOR_WEIGHT * (reach.T @ reach)
    linear = spline.projected(target.time, target.speed) + ANCHOR_WEIGHT * (
        reach.T @ target.anchor
    )
    given, value = fixed_coefficients(spline, target.ends)
    known = np.flatnonzero(given)
    unit = np.eye(n)
    none, excess = np.zeros((m, m)), np.eye(m)
    rows = [
        (unit[known], np.zeros((len(known), m)), value[known]),
        (spline.length[None], np.zeros((1, m)), np.array([target.length])),
        (-unit, np.zeros((n, m)), np.zeros(n)),
        (unit, np.zeros((n, m)), np.maximum(bounds.most, value)),
        (motion.acceleration, none, np.full(m, bounds.speeding)),
        (-motion.acceleration, none, np.full(m, bounds.braking)),
        (motion.jerk, -excess, np.full(m, bounds.jerk)),
        (-motion.jerk, -excess, np.full(m, bounds.jerk)),
        (np.zeros((m, n)), -excess, np.zeros(m)),
    ]
    if not (~given).any():
        return value if abs(float(spline.length @ value) - target.length) < 1e-6 else None
    quadratic = np.zeros((n + m, n + m))
    quadratic[:n, :n] = 2.0 * hessian
    price = JERK_PRICE * np.gradient(spline.stations)
    constraints = np.vstack([np.hstack([a, b]) for a, b, _ in rows])
    right = np.concatenate([c for _, _, c in rows])
    cones = [
        clarabel.ZeroConeT(len(known) + 1),
        clarabel.NonnegativeConeT(len(right) - len(known) - 1),
    ]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.direct_solve_method = "qdldl"  # one thread: the same bits everywhere
    upper = sparse.csc_array(np.triu(quadratic))
    solver = clarabel.DefaultSolver(
        upper,
        np.concatenate([-2.0 * linear, price]),
        sparse.csc_array(constraints),
        right,
        cones,
        settings,
    )
    solution = solver.solve()
    if solution.status not in (clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved):
        return None
    return np.asarray(np.where(given, value, np.clip(np.array(solution.x[:n]), 0.0, bounds.most)))
