# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The path a vehicle drove: a penalised spline by distance driven, through its fixes and along its recorded headings.

A driver steers in time, so the penalty on the change of curvature grows with the speed (lateral jerk), beside a smaller one for
the limits of steering at any speed. The noise of fixes and headings, estimated per
track, determines how far the path may be from either.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy import linalg
from scipy.interpolate import BSpline
from scipy.ndimage import uniform_filter1d

from scenario_gen.numerics import Floats, Ints, wrap_angle

KNOT_M = 1.0  # m between knots
MARGIN_M = 5.0  # m of path beyond both ends, for fixes that lie there
STEP_M = 0.1  # m between the points of the table from parameter to arc length
CURVATURE = 0.1  # 1/m: spectral density of the curvature, about 0.1 1/m over 10 m
STEERING = 0.002  # 1/m³: spectral density of the curvature's change, about 0.02 1/m² over 5 m
LATERAL = 12.0  # m²/s³: spectral density of the lateral acceleration, about 2 m/s² over 3 s
LATERAL_JERK = 1.0  # m²/s⁵: spectral density of the lateral jerk, about 1 m/s³ over 1 s
CREEP_M = (
    0.2  # m: fixes closer together than this share one weight, for their differences are GPS noise
)
SAME_HEADING_M = (
    1.0  # m: headings closer together than this share one weight, for their error is one
)
STANDING_HEADING = 0.02  # the least weight of a heading: a stand of five seconds counts as much as a metre of driving
HEADING_NOISE = float(np.radians(2.0))  # of a heading sensor at its best, slip included
SCATTER_SAMPLES = 5  # samples on either side over which the scatter of headings is taken
SCATTER = 9.0  # factor from the variance between neighbours to that of errors which they share
MOVES_MPS = 1.0  # m/s: above it a course is known to a few degrees
JUMP = float(np.radians(15.0))  # between two samples: no heading of a car
CONTRADICTS = float(
    np.radians(20.0)
)  # headings further off the path are ignored: defaults, or of a reversing vehicle


@dataclass(frozen=True, eq=False)
class Path:
    """The path a vehicle drove: a penalised cubic B-spline by distance driven (P-spline; Eilers & Marx 1996).

    Attributes:
        curve: position (..., 2) [m] by parameter u, the distance driven as first guessed [m].
        parameter: (K,) increasing u of a table.
        length: (K,) the arc length [m] there.
    """

    curve: BSpline
    parameter: Floats
    length: Floats

    def project(self, guess: Floats, points: Floats) -> tuple[Floats, Floats]:
        """Return arc lengths (F,) [m] of the points' feet on the curve, and how far left (F,) [m] of it they are.

        Args:
            guess: (F,) parameters [m] near the feet.
            points: (F, 2) [m].
        """
        tangent = self.curve(guess, 1)
        gap = points - self.curve(guess)
        foot = guess + (gap * tangent).sum(axis=1) / (np.square(tangent)).sum(axis=1)
        foot = np.clip(foot, self.parameter[0], self.parameter[-1])
        gap, tangent = points - self.curve(foot), self.curve(foot, 1)
        left = tangent[:, 0] * gap[:, 1] - tangent[:, 1] * gap[:, 0]
        return np.interp(foot, self.parameter, self.length), np.where(
            left < 0.0, -1.0, 1.0
        ) * np.hypot(*gap.T)

    def pose(self, arc: Floats) -> tuple[Floats, Floats]:
        """Return positions (T, 2) [m] and headings (T,) [rad], unwrapped, at arc lengths (T,) [m]."""
        u = np.interp(arc, self.length, self.parameter)
        tangent = self.curve(u, 1)
        return self.curve(u), np.unwrap(np.arctan2(tangent[:, 1], tangent[:, 0]))


@dataclass(frozen=True, eq=False)
class Headings:
    """Recorded headings (F,) [rad] at the fixes, and the weight (F,) [1/rad²] of each, 0 where there is none."""

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
        + ∫ κ² (1/CURVATURE + v³/LATERAL) + κ'² (1/STEERING + v⁵/LATERAL_JERK) du

    where n_i is across the recorded heading. With dt = du/v, the parts with v are ∫ (v²κ)² dt and ∫ (v³κ')² dt: lateral
    acceleration and jerk, each over its spectral density.

    Args:
        place: (F,) distances driven at the fixes [m], non-decreasing.
        points: (F, 2) [m].
        weight: (F,) in (0, 1].
        noise: standard deviation of the fixes [m].
        speed: (F,) [m/s].
        headings: recorded ones, if there are any.
    """
    low, high = place.min() - MARGIN_M, place.max() + MARGIN_M
    spans = max(int(np.ceil((high - low) / KNOT_M)), 4)
    step = (high - low) / spans
    knots = low + step * np.arange(-3, spans + 4)
    spread = np.abs(np.gradient(place)) if len(place) > 1 else np.ones(1)
    weight = weight * np.clip(spread / CREEP_M, 0.005, 1.0) / np.square(noise)
    count = spans + 3
    band = np.zeros((8, 2 * count))  # x and y of each coefficient in turn
    right = np.zeros(2 * count)
    inside = np.clip(place, low, high - 1e-9)
    basis = BSpline.design_matrix(inside, knots, 3)  # four entries a row, the zeros too
    start, values = 2 * basis.indices[::4].astype(np.int64), basis.data.reshape(-1, 4)
    for axis in (0, 1):
        observe(band, right, start + axis, values, 2, weight, points[:, axis])
    if headings is not None:
        lower = BSpline.design_matrix(inside, knots[1:-1], 2).data.reshape(-1, 3)
        slope = np.zeros(
            (len(place), 4)
        )  # of a cubic basis: differences of the quadratic one, which begins at the same span
        slope[:, 1:] += lower / step
        slope[:, :-1] -= lower / step
        across = np.column_stack((-np.sin(headings.value), np.cos(headings.value)))
        entries = (slope[:, :, None] * across[:, None, :]).reshape(-1, 8)
        shared = np.clip(spread / SAME_HEADING_M, STANDING_HEADING, 1.0)
        observe(band, right, start, entries, 1, headings.weight * shared, np.zeros(len(place)))
    for order, floor, moving, power in (
        (2, CURVATURE, LATERAL, 3),
        (3, STEERING, LATERAL_JERK, 5),
    ):
        centre = low + step * (np.arange(count - order) + (order - 2) / 2.0)
        v = np.interp(centre, place, speed)
        weight = step ** (1 - 2 * order) * (1.0 / floor + v**power / moving)
        for axis in (0, 1):
            observe(
                band,
                right,
                2 * np.arange(count - order) + axis,
                differences(count, order),
                2,
                weight,
                np.zeros(len(v)),
            )
    return tabulate(
        BSpline(knots, linalg.solveh_banded(band, right, lower=True).reshape(-1, 2), 3), low, high
    )


def observe(
    band: Floats,
    right: Floats,
    start: Ints,
    entries: Floats,
    stride: int,
    weight: Floats,
    target: Floats,
) -> None:
    """Add Σ weight · (entries · c - target)² to a lower band matrix (B, n) and its right side (n,).

    Args:
        band: the matrix.
        right: the right side.
        start: (F,) first coefficient of each row.
        entries: (F, E) of each row, `stride` coefficients apart.
        stride: that distance.
        weight: (F,).
        target: (F,).
    """
    for i in range(entries.shape[1]):
        np.add.at(right, start + stride * i, weight * entries[:, i] * target)
        for j in range(i + 1):
            np.add.at(
                band[stride * (i - j)], start + stride * j, weight * entries[:, i] * entries[:, j]
            )


def differences(count: int, order: int) -> Floats:
    """Return the rows (count - order, order + 1) of the differences of an order of `count` values."""
    stencil = ((-1.0, 1.0), (1.0, -2.0, 1.0), (-1.0, 3.0, -3.0, 1.0))[order - 1]
    return np.tile(stencil, (count - order, 1))


def straight_path(point: Floats, heading: float, low: float, high: float) -> Path:
    """Return a straight line through `point` (2,) [m] where the distance driven is (low + high) / 2."""
    direction = np.array([np.cos(heading), np.sin(heading)])
    ends = np.array([low - MARGIN_M, high + MARGIN_M])
    where = point + (ends - (low + high) / 2.0)[:, None] * direction
    return tabulate(BSpline(np.repeat(ends, 2), where, 1), ends[0], ends[1])


def tabulate(curve: BSpline, low: float, high: float) -> Path:
    """Measure the curve's arc length."""
    u = np.linspace(low, high, int(np.ceil((high - low) / STEP_M)) + 1)
    rate = np.hypot(*curve(u, 1).T)
    length = low + np.concatenate([[0.0], np.cumsum((rate[1:] + rate[:-1]) / 2.0 * np.diff(u))])
    return Path(curve, u, length)


def headings_of(heading: Floats, course: Floats, speed: Floats) -> Headings | None:
    """Weigh recorded headings by their own scatter; values that are no headings of a car get weight 0.

    A car's heading does not jump. So the headings are cut where they do, and a run counts if it agrees with the path where the
    vehicle moves: a course over ground, taken from two fixes, jumps about where a vehicle is slow, and a default is another run.

    Args:
        heading: (F,) as recorded [rad], NaN where it is not recorded.
        course: (F,) of the path fitted so far [rad].
        speed: (F,) [m/s].

    Returns:
        None if no recorded heading can be used.
    """
    known = np.flatnonzero(np.isfinite(heading))
    value = heading[known]
    turn = wrap_angle(np.diff(value))
    off = np.abs(wrap_angle(value - course[known]))
    moves = speed[known] > MOVES_MPS
    weight = np.zeros(len(heading))
    for begin, end in pairwise(
        [0, *(np.flatnonzero(np.abs(turn) > JUMP) + 1).tolist(), len(value)]
    ):
        own = slice(begin, end)
        if moves[own].sum() < 3 or np.median(off[own][moves[own]]) > CONTRADICTS:
            continue
        square = np.pad(np.square(np.diff(turn[begin : end - 1])) / 6.0, 1, mode="edge")
        scatter = np.maximum(
            uniform_filter1d(square, 2 * SCATTER_SAMPLES + 1, mode="nearest"), 0.0
        )
        noise = np.sqrt(np.square(HEADING_NOISE) + SCATTER * scatter)
        weight[known[own]] = np.minimum(1.0, 2.0 * noise / np.maximum(off[own], 1e-9)) / np.square(
            noise
        )  # Huber's
    return Headings(np.where(np.isfinite(heading), heading, 0.0), weight) if weight.any() else None
