# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The mean speed of a vehicle: the primitives' speeds, driven smoothly on the route.

    minimise  ∫ (u - v̂)² + ℓ⁴ u''² dτ + w Σ_k (s(τ_k) - s_k)²

over cubic splines u(τ) = ds/dτ on the template's clock. v̂ are the straight lines, joined at the
knots of the primitives, that fit the template's speed best; s_k is the place of the k-th
changepoint on the route. The length and both end speeds are exact, stands are stands, limits of
speed and acceleration are kept; jerk above its bound has a price. A convex quadratic program,
solved by Clarabel's interior-point method (Goulart and Chen 2024).
"""

from dataclasses import dataclass
from typing import NamedTuple

import clarabel  # type: ignore[import-untyped,unused-ignore]
import numpy as np
from scipy import linalg, sparse

from scenario_gen.method.sampling.speed_profile.spline import SpeedKnots, SpeedSpline
from scenario_gen.numerics import Bools, Floats

SMOOTHING_S = 0.5  # ℓ: kinks of the lines are rounded over about this time
ANCHOR_WEIGHT = 10.0  # 1/s, w: 0.5 m off a changepoint weighs as 1.6 m/s too fast for a second
_SHARP_WEIGHT = 0.3  # of the fit of the lines before rounding; it decides what rounding hides
_JERK_WEIGHT = 20.0  # m s, for each 1 m/s³ above the bound for a second
_LENGTH_TOLERANCE_M = 1e-6


@dataclass(frozen=True, eq=False)
class Bounds:
    """The bounds of a speed.

    Attributes:
        speed: (n,) m/s, upper bound of each coefficient.
        acceleration, deceleration: m/s², the strongest.
        jerk: m/s³.
    """

    speed: Floats
    acceleration: float
    deceleration: float
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
        """Return the motion for r, r' [1/s] and r'' [1/s²] (b,) at the spline's stations."""
        r, dr, ddr = rate[:, None], slope[:, None], bend[:, None]
        u, du, ddu = spline.at_stations
        cubed = r * r * r
        jerk = ddu / cubed - (3.0 * du * dr + u * ddr) / (cubed * r)
        jerk = jerk + 3.0 * u * dr * dr / (cubed * r * r)
        return cls(rate, du / (r * r) - u * dr / cubed, jerk)


@dataclass(frozen=True, eq=False)
class Target:
    """The speeds and places that a mean speed should be near.

    Attributes:
        time: (q,) seconds on the template's clock.
        speed: (q,) m/s, straight lines in between.
        anchor_time: (K,) seconds of the changepoints.
        anchor: (K,) metres on the route.
        ends: m/s at the start and at the end, on the template's clock.
        length: metres of the route.
    """

    time: Floats
    speed: Floats
    anchor_time: Floats
    anchor: Floats
    ends: tuple[float, float]
    length: float


class MeanSpeed(NamedTuple):
    """A mean speed.

    Attributes:
        coefficients: (n,) m/s.
        motion: acceleration and jerk on its clock.
        bounds: that it keeps.
    """

    coefficients: Floats
    motion: Motion
    bounds: Bounds


def fixed_coefficients(spline: SpeedSpline, ends: tuple[float, float]) -> tuple[Bools, Floats]:
    """Return which coefficients are given (n,): 0 in stands, the end speeds; and their values."""
    given, value = spline.still.copy(), np.zeros(spline.size)
    given[[0, -1]] = True
    value[[0, -1]] = np.where(spline.still[[0, -1]], 0.0, ends)
    return given, value


def rounded_lines(
    spline: SpeedSpline, knots: SpeedKnots, time: Floats, speed: Floats, ends: tuple[float, float]
) -> Floats:
    """Return speeds (M,) [m/s] at the knots whose straight lines, once rounded, fit best.

    Args:
        spline: the basis.
        knots: times of the lines' knots, and stands.
        time: (T,) seconds.
        speed: (T,) m/s.
        ends: speeds [m/s] at start and end.
    """
    lines = np.interp(knots.knot, time, speed)
    free = ~(np.append(knots.still, False) | np.append(False, knots.still))
    lines = np.where(free, lines, 0.0)
    given, value = fixed_coefficients(spline, ends)
    if given.all() or not free.any():
        return lines
    hats = np.eye(len(lines))[free]
    stiffness = _smoothness(spline)
    right = np.column_stack([spline.projected(knots.knot, hat) for hat in hats])
    unknown = np.flatnonzero(~given)
    inner = stiffness[np.ix_(unknown, unknown)]
    rounded, base = np.zeros((spline.size, len(hats))), value.copy()
    rounded[unknown] = linalg.solve(inner, right[unknown], assume_a="pos")
    base[unknown] -= linalg.solve(inner, stiffness[unknown] @ value, assume_a="pos")

    design = spline.design(time)
    sharp = _SHARP_WEIGHT * np.array([np.interp(time, knots.knot, hat) for hat in hats]).T
    residual = speed - design @ (base + rounded @ lines[free])
    sharp_residual = _SHARP_WEIGHT * (speed - np.interp(time, knots.knot, lines))
    system = np.vstack([design @ rounded, sharp])
    change = np.linalg.lstsq(system, np.concatenate([residual, sharp_residual]), rcond=None)[0]
    lines[free] += change
    return np.asarray(np.maximum(lines, 0.0))


def _smoothness(spline: SpeedSpline) -> Floats:
    """Return the matrix (n, n) of the quadratic form ∫ u² + ℓ⁴ u″² dτ."""
    return np.asarray(spline.gram + SMOOTHING_S**4 * spline.bending)


def mean_speed(
    spline: SpeedSpline, target: Target, motion: Motion, bounds: Bounds
) -> Floats | None:
    """Return the coefficients (n,) [m/s] of the mean speed; None if none meets the bounds."""
    n, m = spline.size, len(spline.stations)
    given, value = fixed_coefficients(spline, target.ends)
    if given.all():
        excess = abs(float(spline.length @ value) - target.length)
        return value if excess < _LENGTH_TOLERANCE_M else None

    reach = spline.driven(target.anchor_time)
    hessian = _smoothness(spline) + ANCHOR_WEIGHT * (reach.T @ reach)
    linear = spline.projected(target.time, target.speed)
    linear += ANCHOR_WEIGHT * (reach.T @ target.anchor)
    quadratic = np.zeros((n + m, n + m))  # of the coefficients, and of the excess jerks
    quadratic[:n, :n] = 2.0 * hessian
    price = _JERK_WEIGHT * np.gradient(spline.stations)

    known, unit = np.flatnonzero(given), np.eye(n)
    none, excess_jerk = np.zeros((m, m)), -np.eye(m)
    rows = [  # of coefficients and excess jerks, and their upper bounds; equations come first
        (unit[known], np.zeros((len(known), m)), value[known]),
        (spline.length[None], np.zeros((1, m)), np.array([target.length])),
        (-unit, np.zeros((n, m)), np.zeros(n)),
        (unit, np.zeros((n, m)), np.maximum(bounds.speed, value)),
        (motion.acceleration, none, np.full(m, bounds.acceleration)),
        (-motion.acceleration, none, np.full(m, bounds.deceleration)),
        (motion.jerk, excess_jerk, np.full(m, bounds.jerk)),
        (-motion.jerk, excess_jerk, np.full(m, bounds.jerk)),
        (np.zeros((m, n)), excess_jerk, np.zeros(m)),
    ]
    constraints = np.vstack([np.hstack([a, b]) for a, b, _ in rows])
    upper = np.concatenate([bound for _, _, bound in rows])
    equations = len(known) + 1
    solution = _solve(
        quadratic, np.concatenate([-2.0 * linear, price]), constraints, upper, equations
    )
    if solution is None:
        return None
    return np.asarray(np.where(given, value, np.clip(solution[:n], 0.0, bounds.speed)))


def _solve(
    quadratic: Floats, linear: Floats, constraints: Floats, upper: Floats, equations: int
) -> Floats | None:
    """Return the minimum of ½ xᵀ Q x + cᵀ x with A x <= b, the first rows with equality."""
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.direct_solve_method = "qdldl"  # one thread, so the bits are the same everywhere
    cones = [clarabel.ZeroConeT(equations), clarabel.NonnegativeConeT(len(upper) - equations)]
    solver = clarabel.DefaultSolver(
        sparse.csc_array(np.triu(quadratic)),
        linear,
        sparse.csc_array(constraints),
        upper,
        cones,
        settings,
    )
    solution = solver.solve()
    solved = (clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved)
    return np.array(solution.x) if solution.status in solved else None
