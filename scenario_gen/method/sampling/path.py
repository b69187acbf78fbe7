# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The path of a sample: the route displaced sideways, as a C2 cubic spline with its arc length.

A route is resampled at equal arc lengths u. A lateral deviation d(u) moves each node along the
route's normal, and the clamped cubic spline through the moved nodes is the sample's path: tangent
and curvature are continuous and those of the driven curve, and with d = d' = 0 at an end the
requested position and heading are exact.

In a cell of length h, from node p₀ with tangent t₀ to p₁ with t₁, at the fraction x (Hermite):

    p(x)     = (1 + 2x)(1 - x)² p₀ + x²(3 - 2x) p₁ + h x(1 - x)² t₀ - h x²(1 - x) t₁
    dp/du(x) = 6x(1 - x)/h (p₁ - p₀) + (1 - x)(1 - 3x) t₀ + x(3x - 2) t₁
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from scenario_gen.method.sampling.time_warp import cell_of, ClockSamples
from scenario_gen.numerics import arc_lengths, Floats, frozen, Ints, running_sum, unit
from scenario_gen.numerics.kernels import F, F1, F2, F3, I1, kernel, named, OUT2, OUT3
from scenario_gen.numerics.loops import copy_to
from scenario_gen.types import Route

NODE_SPACING_M = 1.0  # a cubic between such nodes is within 0.1 mm of an arc of radius 5 m
MIN_NODES_COUNT = 5
_FINE_STEPS = 8  # per point of the route, to measure its arc length
_NEWTON_STEPS = 3  # |dp/du| hardly varies in a cell
_NEWTON_TOLERANCE_M = 1e-6
_GAUSS_POINTS = (0.5 - np.sqrt(0.15), 0.5, 0.5 + np.sqrt(0.15))
_GAUSS_WEIGHT = (5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0)


@dataclass(frozen=True, eq=False)
class BasePath:
    """A route at equal steps of arc length.

    Attributes:
        node: (G, 3) x [m], y [m], yaw [rad]; G = 1 for a vehicle that stands throughout.
        spacing: step of arc length [m] between nodes.
        anchor: (A,) arc length [m] of each anchor.
    """

    node: Floats
    spacing: float
    anchor: Floats

    @classmethod
    def of(cls, route: Route) -> "BasePath":
        """Resample a route by a cubic spline, clamped to its first and last heading."""
        points = route.points
        if len(points) == 1:
            return cls(frozen(points), 0.0, frozen(np.zeros(len(route.anchor))))
        chord = arc_lengths(points[:, :2])
        start, end = unit(points[[0, -1], 2])
        curve = CubicSpline(chord, points[:, :2], bc_type=((1, start), (1, end)))
        fine = np.linspace(chord[:-1], chord[1:], _FINE_STEPS, endpoint=False).T.ravel()
        fine = np.append(fine, chord[-1])
        middle = 0.5 * (fine[:-1] + fine[1:])
        speed = np.hypot(*curve(fine, 1).T)
        simpson = (speed[:-1] + 4.0 * np.hypot(*curve(middle, 1).T) + speed[1:]) / 6.0
        arc = running_sum(simpson * np.diff(fine))

        count = max(MIN_NODES_COUNT, int(np.ceil(arc[-1] / NODE_SPACING_M)) + 1)
        u = np.linspace(0.0, arc[-1], count)
        at = CubicSpline(arc, fine)(u)
        tangent = curve(at, 1)
        yaw = np.unwrap(np.arctan2(tangent[:, 1], tangent[:, 0]))
        node = np.column_stack([curve(at), yaw])
        return cls(frozen(node), float(u[1]), frozen(arc[route.anchor * _FINE_STEPS]))

    @property
    def length(self) -> float:
        """Arc length [m]."""
        return self.spacing * (len(self.node) - 1)

    @property
    def stands(self) -> bool:
        """Whether the vehicle stands throughout."""
        return len(self.node) == 1

    @cached_property
    def arc(self) -> Floats:
        """(G,) arc length [m] of each node."""
        return frozen(self.spacing * np.arange(len(self.node)))

    @cached_property
    def curvature(self) -> Floats:
        """(G,) 1/m, by central differences of the yaw."""
        return frozen([0.0] if self.stands else np.gradient(self.node[:, 2], self.arc))

    def displaced(self, deviation: Floats) -> "DisplacedPaths":
        """Return the paths of S samples.

        Args:
            deviation: (S, G) metres to the left of the route, 0 at both ends.
        """
        paths = DisplacedPaths(
            np.zeros((*deviation.shape, 4)), np.zeros(deviation.shape), self.spacing
        )
        if self.stands:
            x, y, yaw = self.node[0]
            paths.curve[:, 0] = x, y, np.cos(yaw), np.sin(yaw)
        else:
            _displace(self.node, self.spacing, deviation, paths.curve, paths.arc)
        return paths


class DisplacedPaths(NamedTuple):
    """The paths of S samples.

    Attributes:
        curve: (S, G, 4) x, y, dx/du, dy/du at every node; G = 1 for a vehicle that stands.
        arc: (S, G) arc lengths [m] of the sample's path.
        spacing: of the route's nodes [m].
    """

    curve: Floats
    arc: Floats
    spacing: float


class SpeedSamples(NamedTuple):
    """The speeds of S samples, splines on the template's clock.

    Attributes:
        breaks: (m + 1,) template times [s] between the pieces.
        first: (m,) the first of the four coefficients of each piece.
        pieces: (m, 4, 4) see `SpeedSpline.pieces`.
        coefficients: (S, n) m/s.
    """

    breaks: Floats
    first: Ints
    pieces: Floats
    coefficients: Floats


@kernel(inline=True)
def _tangent(c: Floats, j: int, h: float, x: float) -> tuple[float, float]:
    """Return dp/du at fraction x of cell j of curve c (G, 4)."""
    chord = 6.0 * x * (1.0 - x) / h
    start = (1.0 - x) * (1.0 - 3.0 * x)
    end = x * (3.0 * x - 2.0)
    dx = chord * (c[j + 1, 0] - c[j, 0]) + start * c[j, 2] + end * c[j + 1, 2]
    dy = chord * (c[j + 1, 1] - c[j, 1]) + start * c[j, 3] + end * c[j + 1, 3]
    return dx, dy


@kernel(inline=True)
def _speed(c: Floats, j: int, h: float, x: float) -> float:
    """Return |dp/du| at fraction x of cell j."""
    dx, dy = _tangent(c, j, h, x)
    return float(np.sqrt(dx * dx + dy * dy))


@kernel(inline=True)
def _arc_length(c: Floats, j: int, h: float, x: float) -> float:
    """Return the arc length of cell j up to fraction x, by three-point Gauss quadrature."""
    total = 0.0
    for k in range(3):
        total += _GAUSS_WEIGHT[k] * _speed(c, j, h, x * _GAUSS_POINTS[k])
    return total * x * h


@kernel(inline=True)
def _solve_tangents(c: Floats, h: float, ratio: Floats, axis: int) -> None:
    """Fill one coordinate of the inner tangents of a clamped spline (Thomas algorithm)."""
    last = len(c) - 1
    for j in range(1, last):
        right = 3.0 * (c[j + 1, axis] - c[j - 1, axis]) / h - c[j - 1, 2 + axis]
        if j == last - 1:
            right -= c[last, 2 + axis]
        c[j, 2 + axis] = right * ratio[j]
    for j in range(last - 2, 0, -1):
        c[j, 2 + axis] -= ratio[j] * c[j + 1, 2 + axis]


@kernel(F2, F, F2, OUT3, OUT2)
def _displace(node: Floats, h: float, deviation: Floats, curve: Floats, arc: Floats) -> None:
    """Fill the clamped splines through displaced nodes, and their arc lengths."""
    samples, g = deviation.shape
    cos, sin, ratio = np.cos(node[:, 2]), np.sin(node[:, 2]), np.zeros(g)
    for j in range(1, g - 1):
        ratio[j] = 1.0 / (4.0 - ratio[j - 1])
    for s in range(samples):
        c = curve[s]
        for j in range(g):
            c[j, 0] = node[j, 0] - deviation[s, j] * sin[j]
            c[j, 1] = node[j, 1] + deviation[s, j] * cos[j]
        for end in (0, g - 1):
            c[end, 2], c[end, 3] = cos[end], sin[end]
        for axis in range(2):
            _solve_tangents(c, h, ratio, axis)
        for j in range(g - 1):
            arc[s, j + 1] = arc[s, j] + _arc_length(c, j, h, 1.0)


@kernel(inline=True)
def _fraction(c: Floats, j: int, h: float, driven: float, length: float) -> float:
    """Return the fraction of cell j after `driven` metres of its `length`, by Newton's method."""
    x = driven / length
    for _ in range(_NEWTON_STEPS):
        missing = driven - _arc_length(c, j, h, x)
        x += missing / (h * _speed(c, j, h, x))
        if abs(missing) < _NEWTON_TOLERANCE_M:
            break
    return min(max(x, 0.0), 1.0)


@kernel(inline=True)
def _write_pose(c: Floats, j: int, h: float, x: float, out: Floats) -> None:
    """Write x, y and yaw at fraction x of cell j."""
    y = 1.0 - x
    start, end = y * y * (1.0 + 2.0 * x), x * x * (3.0 - 2.0 * x)
    leaving, arriving = h * x * y * y, -h * x * x * y
    for axis in range(2):
        out[axis] = (
            start * c[j, axis]
            + end * c[j + 1, axis]
            + leaving * c[j, 2 + axis]
            + arriving * c[j + 1, 2 + axis]
        )
    dx, dy = _tangent(c, j, h, x)
    out[2] = np.arctan2(dy, dx)


@kernel(inline=True)
def _read_piece(speed: SpeedSamples, s: int, i: int, out: Floats) -> None:
    """Write the polynomial (4,) of piece i of sample s."""
    for power in range(4):
        out[power] = 0.0
        for q in range(4):
            out[power] += speed.pieces[i, power, q] * speed.coefficients[s, speed.first[i] + q]


@kernel(inline=True)
def _driven(p: Floats, x: float) -> float:
    """Return the metres driven in the first x seconds of a piece."""
    return float(x * (p[0] + x * (p[1] / 2.0 + x * (p[2] / 3.0 + x * p[3] / 4.0))))


@kernel(inline=True)
def _write_motion(p: Floats, x: float, pace: float, slope: float, out: Floats) -> None:
    """Write speed and acceleration x seconds into a piece, on a clock with this rate and slope."""
    u = p[0] + x * (p[1] + x * (p[2] + x * p[3]))
    du = p[1] + x * (2.0 * p[2] + x * 3.0 * p[3])
    out[3] = max(u / pace, 0.0)
    out[4] = (du - u / pace * slope) / (pace * pace)


@kernel(
    named(DisplacedPaths, F3, F2, F),
    named(SpeedSamples, F1, I1, F3, F2),
    named(ClockSamples, F2, F2, F2, I1),
    OUT3,
)
def fill_states(
    path: DisplacedPaths, speed: SpeedSamples, clock: ClockSamples, out: Floats
) -> None:
    """Compute the states of one vehicle.

    Args:
        path: S paths.
        speed: S speeds.
        clock: S clocks at up to T instants.
        out: (S, T, 5) filled with x, y [m], yaw [rad, not unwrapped], speed [m/s], acceleration
            [m/s²].
    """
    breaks, h = speed.breaks, path.spacing
    stands, last = path.curve.shape[1] == 1, speed.pieces.shape[0] - 1
    p = np.empty(4)
    for s in range(path.curve.shape[0]):
        c, arc = path.curve[s], path.arc[s]
        i, j, start, before = 0, 0, 0.0, -1.0
        _read_piece(speed, s, i, p)
        for k in range(clock.counts[s]):
            t = min(max(clock.tau[s, k], breaks[0]), breaks[last + 1])
            while i < last and t >= breaks[i + 1]:
                start += _driven(p, breaks[i + 1] - breaks[i])
                i += 1
                _read_piece(speed, s, i, p)
            x = t - breaks[i]
            _write_motion(p, x, clock.pace[s, k], clock.slope[s, k], out[s, k])
            driven = start + _driven(p, x)
            if stands:
                out[s, k, 0], out[s, k, 1] = c[0, 0], c[0, 1]
                out[s, k, 2] = np.arctan2(c[0, 3], c[0, 2])
            elif driven == before:
                copy_to(out[s, k, :3], out[s, k - 1])
            else:
                j = cell_of(arc, driven, j)
                x = _fraction(c, j, h, driven - arc[j], arc[j + 1] - arc[j])
                _write_pose(c, j, h, x, out[s, k])
            before = driven
