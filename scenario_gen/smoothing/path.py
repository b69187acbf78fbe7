# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The path of a vehicle, and its motion along it.

A driver steers in time, so the penalty on the change of curvature grows with the speed (lateral
jerk), in addition to a smaller one for the limits of steering at any speed. The noise of fixes and
headings, estimated per track, determines how far the path may be from either.

The splines are penalised: least squares in band matrices (Eilers & Marx 1996).
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy import linalg
from scipy.interpolate import BSpline
from scipy.ndimage import uniform_filter1d

from scenario_gen.numerics import Bools, Floats, Ints, running_sum, wrap_angle

_NOISE_M = (0.1, 1.5)  # bounds of the estimates
_MIN_FIX_COUNT = 30  # moving fixes from which noise can be estimated


def estimated_noise(fix: Floats, least: float = _NOISE_M[0]) -> float:
    """Return the standard deviation [m] of fixes (F, 2) [m] about local parabolas.

    It is the larger one of those along and across the direction of travel, and at least `least`.
    """
    half = min(15, (len(fix) - 1) // 2)
    if half < 3:
        return 0.5
    lag = np.arange(-half, half + 1)
    place = fix @ (1.0, 1.0j)
    # At lag 0, the slope and the value of the parabola.
    fitted = sliding_window_view(place, len(lag)) @ np.linalg.pinv(np.vander(lag, 3))[1:].T
    slope, value = fitted.T
    ahead = np.exp(-1.0j * np.angle(slope))
    residual = (place[half : len(fix) - half] - value) * ahead
    return float(np.clip(_larger_noise(residual.real, residual.imag), least, _NOISE_M[1]))


def residual_noise(
    first_estimate: float, is_moving: Bools, lateral: Floats, longitudinal: Floats
) -> float:
    """Return the standard deviation [m] of fixes about the path and motion fitted to them.

    It is at most twice the first estimate. Without that bound, noise and smoothness would increase
    each other, since smoothing leaves noise of long memory.

    Args:
        first_estimate: returned if few fixes are of a moving vehicle, since those of a standing
            one are often repeated.
        is_moving: (F,) whether the vehicle moves.
        lateral: (F,) of the fixes from the path [m].
        longitudinal: (F,) of the fixes from the motion along it [m].
    """
    if is_moving.sum() < _MIN_FIX_COUNT:
        return first_estimate
    noise = _larger_noise(longitudinal[is_moving], lateral[is_moving])
    low, high = _NOISE_M
    return float(np.clip(noise, low, min(2.0 * first_estimate, high)))


def _larger_noise(along: Floats, across: Floats) -> float:
    return max(white_equivalent(along), white_equivalent(across))


def white_equivalent(noise: Floats) -> float:
    """Return the deviation of white noise whose mean is as uncertain as that of noise (T,).

    Values beyond three robust deviations are clipped; the deviation is then scaled by the root of
    the autocorrelation time, 1 + 2 Σ ρ_l over the lags before the first ρ_l below 0.1.
    """
    noise = noise - np.median(noise)
    limit = 3.0 * 1.4826 * float(np.median(np.abs(noise))) + 1e-3
    noise = np.clip(noise, -limit, limit)
    power = float(np.square(noise).sum())
    time = 1.0
    for lag in range(1, min(20, len(noise) // 3)):
        correlation = float((noise[:-lag] * noise[lag:]).sum()) / max(power, 1e-12)
        if correlation < 0.1:
            break
        time += 2.0 * correlation
    return float(np.sqrt(power / len(noise) * time))


GRID_STEP_M = 0.5  # of points on a smooth path


def observe(
    band: Floats,
    right: Floats,
    start: Ints,
    entries: Floats,
    weight: Floats,
    target: Floats | None = None,
) -> None:
    """Add Σ weight · (entries · c - target)² to a lower band matrix and its right side.

    Args:
        band: the matrix (B, n).
        right: the right side (n,) or (n, D).
        start: (F,) first coefficient of each row.
        entries: (F, E) of each row.
        weight: (F,).
        target: (F,) or (F, D); None: zero.
    """
    for i in range(entries.shape[1]):
        if target is not None:
            np.add.at(right, start + i, (weight * entries[:, i] * target.T).T)
        for j in range(i + 1):
            products = weight * entries[:, i] * entries[:, j]
            np.add.at(band[i - j], start + j, products)


def differences(count: int, order: int) -> Floats:
    """Return differences (1st to 3rd) of `count` values as rows (count - order, order + 1)."""
    stencil = ((-1.0, 1.0), (1.0, -2.0, 1.0), (-1.0, 3.0, -3.0, 1.0))[order - 1]
    return np.tile(stencil, (count - order, 1))


def smoothing_spline(u: Floats, values: Floats, wavelength: float) -> tuple[Floats, Floats]:
    """Return a penalised spline f at equal steps of u: ∫ |f - p|² du + λ ∫ |f″|² du is least.

    Args:
        u: (T,) metres, non-decreasing from 0.
        values: (T, D).
        wavelength: metres; an oscillation of this length is halved.

    Returns:
        The grid (G,) and f on it (G, D).
    """
    count = max(int(np.ceil(u[-1] / GRID_STEP_M)), 6) + 1
    grid = np.linspace(0.0, u[-1], count)
    step = grid[1]
    cell = np.minimum((u / step).astype(np.int64), count - 2)
    share = u / step - cell
    band = np.zeros((3, count))
    right = np.zeros((count, values.shape[1]))
    weight = np.gradient(u) + 1e-3 * step
    observe(band, right, cell, np.column_stack((1.0 - share, share)), weight, values)
    penalty = np.full(count - 2, (wavelength / (2.0 * np.pi)) ** 4 / step**3)
    observe(band, right, np.arange(count - 2), differences(count, 2), penalty)
    return grid, linalg.solveh_banded(band, right, lower=True)


@dataclass(frozen=True)
class PathModel:
    """Tuning of the path.

    Attributes:
        knot_m: distance between knots.
        margin_m: path beyond both ends, for fixes there.
        table_step_m: between the points of the table from parameter to arc length.
        curvature_per_m: spectral density of the curvature: about 0.1 1/m over 10 m.
        steering_per_m3: spectral density of the curvature's change: about 0.02 1/m² over 5 m.
        lateral_m2ps3: spectral density of the lateral acceleration: about 2 m/s² over 3 s.
        lateral_jerk_m2ps5: spectral density of the lateral jerk: about 1 m/s³ over 1 s.
        creep_m: closer fixes share one weight, since their differences are GPS noise.
        same_heading_m: closer headings share one weight, since they share their error.
        min_heading_weight: a stand of five seconds counts as much as a metre of driving.
    """

    knot_m: float = 1.0
    margin_m: float = 5.0
    table_step_m: float = 0.1
    curvature_per_m: float = 0.1
    steering_per_m3: float = 0.002
    lateral_m2ps3: float = 12.0
    lateral_jerk_m2ps5: float = 1.0
    creep_m: float = 0.2
    same_heading_m: float = 1.0
    min_heading_weight: float = 0.02


@dataclass(frozen=True)
class HeadingModel:
    """Tuning of recorded headings.

    Attributes:
        noise_rad: of a heading sensor at its best, slip included.
        scatter_count: samples on either side over which the scatter of headings is measured.
        shared_error_factor: from the variance between neighbours to that of shared errors.
        moving_mps: above it, a course is known to a few degrees.
        jump_rad: between two samples, larger than any of a car's heading.
        contradiction_rad: headings farther off the path are ignored: defaults, or in reverse.
    """

    noise_rad: float = float(np.radians(2.0))
    scatter_count: int = 5
    shared_error_factor: float = 9.0
    moving_mps: float = 1.0
    jump_rad: float = float(np.radians(15.0))
    contradiction_rad: float = float(np.radians(20.0))


HEADINGS = HeadingModel()
_PATH = PathModel()


@dataclass(frozen=True, eq=False)
class Path:
    """The path of a vehicle: a penalised cubic B-spline by distance driven.

    Source: Eilers & Marx 1996 (P-splines).

    Attributes:
        curve: position (..., 2) [m] by parameter u, the first estimate of the distance driven [m].
        parameter: (K,) increasing values of u in a table.
        length: (K,) their arc lengths [m].
    """

    curve: BSpline
    parameter: Floats
    length: Floats

    def project(self, guess: Floats, points: Floats) -> tuple[Floats, Floats]:
        """Return arc length and lateral offset, positive to the left, of points (F, 2) [m].

        Args:
            guess: (F,) parameters [m] near their feet on the curve.
            points: (F, 2) [m].

        Returns:
            (F,) and (F,) [m].
        """
        tangent = self.curve(guess, 1)
        offset = points - self.curve(guess)
        foot = guess + (offset * tangent).sum(axis=1) / (np.square(tangent)).sum(axis=1)
        foot = np.clip(foot, self.parameter[0], self.parameter[-1])
        offset = points - self.curve(foot)
        tangent = self.curve(foot, 1)
        cross = tangent[:, 0] * offset[:, 1] - tangent[:, 1] * offset[:, 0]
        lateral = np.where(cross < 0.0, -1.0, 1.0) * np.hypot(*offset.T)
        return np.interp(foot, self.parameter, self.length), lateral

    def pose(self, arc: Floats) -> tuple[Floats, Floats]:
        """Return positions (T, 2) [m] and unwrapped headings (T,) at arc lengths (T,) [m]."""
        u = np.interp(arc, self.length, self.parameter)
        tangent = self.curve(u, 1)
        return self.curve(u), np.unwrap(np.arctan2(tangent[:, 1], tangent[:, 0]))


@dataclass(frozen=True, eq=False)
class Headings:
    """Recorded headings (F,) [rad] at the fixes, and their weights (F,) [1/rad²]; 0: none."""

    value: Floats
    weight: Floats


def fit_path(
    place: Floats,
    points: Floats,
    weight: Floats,
    noise: float,
    speed: Floats,
    headings: Headings | None = None,
) -> Path:
    """Fit a curve to points.

    It minimises, over the curve c(u) with curvature κ and the speed v(u),

        Σ w |c(u_i) - p_i|² / σ² + Σ w_i (n_i · c'(u_i))²
        + ∫ κ² (1/curvature + v³/lateral) + κ'² (1/steering + v⁵/lateral_jerk) du

    where n_i is across the recorded heading, and the spectral densities are those of `PathModel`.
    With dt = du/v, the parts with v are ∫ (v²κ)² dt and ∫ (v³κ')² dt: lateral acceleration and
    jerk, each over its spectral density.

    Args:
        place: (F,) distances driven at the fixes [m], non-decreasing.
        points: (F, 2) [m].
        weight: (F,) in (0, 1].
        noise: standard deviation of the fixes [m].
        speed: (F,) [m/s].
        headings: recorded headings, or None.
    """
    low = place.min() - _PATH.margin_m
    high = place.max() + _PATH.margin_m
    spans = max(int(np.ceil((high - low) / _PATH.knot_m)), 4)
    step = (high - low) / spans
    knots = low + step * np.arange(-3, spans + 4)
    spacing = np.abs(np.gradient(place)) if len(place) > 1 else np.ones(1)
    weight = weight * np.clip(spacing / _PATH.creep_m, 0.005, 1.0) / np.square(noise)
    count = spans + 3
    band: Floats = np.zeros((4, count))
    right = np.zeros((count, 2))
    inside = np.clip(place, low, high - 1e-9)
    basis = BSpline.design_matrix(inside, knots, 3)  # four entries per row, including zeros
    start = basis.indices[::4].astype(np.int64)
    observe(band, right, start, basis.data.reshape(-1, 4), weight, points)
    for order, by_distance, by_time in (
        (2, _PATH.curvature_per_m, _PATH.lateral_m2ps3),
        (3, _PATH.steering_per_m3, _PATH.lateral_jerk_m2ps5),
    ):
        rows = np.arange(count - order)
        centre = low + step * (rows + (order - 2) / 2.0)
        v = np.interp(centre, place, speed)
        penalty = step ** (1 - 2 * order) * (1.0 / by_distance + v ** (2 * order - 1) / by_time)
        observe(band, right, rows, differences(count, order), penalty)
    if headings is not None:
        # They tie x to y: from here on, both of each coefficient are in turn.
        right = right.reshape(-1, 1)
        band = np.asarray(np.kron(band, [[1.0, 1.0], [0.0, 0.0]]), dtype=np.float64)
        lower = BSpline.design_matrix(inside, knots[1:-1], 2).data.reshape(-1, 3)
        # Slopes of a cubic basis are differences of the quadratic one, from the same span on.
        slope = np.zeros((len(place), 4))
        slope[:, 1:] += lower / step
        slope[:, :-1] -= lower / step
        across = np.column_stack((-np.sin(headings.value), np.cos(headings.value)))
        entries = (slope[:, :, None] * across[:, None, :]).reshape(-1, 8)
        shared = np.clip(spacing / _PATH.same_heading_m, _PATH.min_heading_weight, 1.0)
        observe(band, right, 2 * start, entries, headings.weight * shared)
    coefficients = linalg.solveh_banded(band, right, lower=True).reshape(-1, 2)
    return _tabulate(BSpline(knots, coefficients, 3), low, high)


def straight_path(point: Floats, heading: float, low: float, high: float) -> Path:
    """Return a straight path with `point` (2,) [m] at the distance (low + high) / 2."""
    direction = np.array([np.cos(heading), np.sin(heading)])
    ends = np.array([low - _PATH.margin_m, high + _PATH.margin_m])
    positions = point + (ends - (low + high) / 2.0)[:, None] * direction
    return _tabulate(BSpline(np.repeat(ends, 2), positions, 1), ends[0], ends[1])


def _tabulate(curve: BSpline, low: float, high: float) -> Path:
    """Measure the curve's arc length."""
    u = np.linspace(low, high, int(np.ceil((high - low) / _PATH.table_step_m)) + 1)
    rate = np.hypot(*curve(u, 1).T)
    length = low + running_sum((rate[1:] + rate[:-1]) / 2.0 * np.diff(u))
    return Path(curve, u, length)


def headings_of(heading: Floats, course: Floats, speed: Floats) -> Headings | None:
    """Weigh recorded headings by their scatter; values that are not headings of a car get 0.

    A car's heading does not jump. So the headings are cut at jumps, and a run counts if it agrees
    with the path while the vehicle moves: a course over ground from two fixes jumps if a vehicle
    is slow, and a default value is a run that disagrees.

    Args:
        heading: (F,) as recorded [rad], NaN if not recorded.
        course: (F,) of the path fitted so far [rad].
        speed: (F,) [m/s].

    Returns:
        None if no recorded heading can be used.
    """
    known = np.flatnonzero(np.isfinite(heading))
    value = heading[known]
    turn = wrap_angle(np.diff(value))
    error = np.abs(wrap_angle(value - course[known]))
    is_moving = speed[known] > HEADINGS.moving_mps
    jumps = np.flatnonzero(np.abs(turn) > HEADINGS.jump_rad) + 1
    weight = np.zeros(len(heading))
    for begin, end in pairwise([0, *jumps.tolist(), len(value)]):
        run = slice(begin, end)
        moving_error = error[run][is_moving[run]]
        if len(moving_error) < 3 or np.median(moving_error) > HEADINGS.contradiction_rad:
            continue
        noise = _heading_noise(turn[begin : end - 1])
        huber = np.minimum(1.0, 2.0 * noise / np.maximum(error[run], 1e-9))
        weight[known[run]] = huber / np.square(noise)
    if not weight.any():
        return None
    return Headings(np.where(np.isfinite(heading), heading, 0.0), weight)


def _heading_noise(turn: Floats) -> Floats:
    """Return the standard deviations (H,) [rad] of headings with turns (H-1,) between them."""
    square = np.pad(np.square(np.diff(turn)) / 6.0, 1, mode="edge")
    window = 2 * HEADINGS.scatter_count + 1
    scatter = np.maximum(uniform_filter1d(square, window, mode="nearest"), 0.0)
    variance = np.square(HEADINGS.noise_rad) + HEADINGS.shared_error_factor * scatter
    noise: Floats = np.sqrt(variance)
    return noise
