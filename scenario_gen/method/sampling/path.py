# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The path of a sample: the route displaced sideways, as a C2 cubic spline with its own arc length.

A route is resampled at equal arc lengths u. A lateral deviation d(u) moves each node along the route's normal, and the
clamped cubic spline through the moved nodes is the sample's path: tangent and curvature are continuous and belong to
the very curve that is driven, and with d = d' = 0 at an end the asked position and heading hold there exactly.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from scenario_gen.numerics import Floats, frozen, Ints
from scenario_gen.numerics.kernels import F, F1, F2, F3, I1, kernel, named, OUT2, OUT3
from scenario_gen.types import Route

NODE_SPACING = (
    1.0  # m; a cubic through nodes this far apart is within 0.1 mm of an arc of radius 5 m
)
MIN_NODES = 5
_GAUSS_X = (0.5 - np.sqrt(0.15), 0.5, 0.5 + np.sqrt(0.15))
_GAUSS_W = (5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0)


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
        """Resample a route by the cubic spline through its points, clamped to its first and last heading."""
        points = route.points
        if len(points) == 1:
            return cls(frozen(points), 0.0, frozen(np.zeros(len(route.anchor))))
        chord = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points[:, :2], axis=0).T))])
        ends = [np.array([np.cos(yaw), np.sin(yaw)]) for yaw in points[[0, -1], 2]]
        curve = CubicSpline(chord, points[:, :2], bc_type=((1, ends[0]), (1, ends[1])))
        fine = np.linspace(chord[:-1], chord[1:], 8, endpoint=False).T.ravel()
        fine = np.append(fine, chord[-1])
        middle = 0.5 * (fine[:-1] + fine[1:])
        speed = np.hypot(*curve(fine, 1).T)
        simpson = (speed[:-1] + 4.0 * np.hypot(*curve(middle, 1).T) + speed[1:]) / 6.0
        arc = np.concatenate([[0.0], np.cumsum(simpson * np.diff(fine))])
        count = max(MIN_NODES, int(np.ceil(arc[-1] / NODE_SPACING)) + 1)
        u = np.linspace(0.0, arc[-1], count)
        at = CubicSpline(arc, fine)(u)
        tangent = curve(at, 1)
        yaw = np.unwrap(np.arctan2(tangent[:, 1], tangent[:, 0]))
        return cls(
            frozen(np.column_stack([curve(at), yaw])), float(u[1]), frozen(arc[route.anchor * 8])
        )

    @property
    def length(self) -> float:
        """Arc length [m]."""
        return self.spacing * (len(self.node) - 1)

    @cached_property
    def arc(self) -> Floats:
        """(G,) arc length [m] of each node."""
        return frozen(self.spacing * np.arange(len(self.node)))

    @cached_property
    def curvature(self) -> Floats:
        """(G,) 1/m, by central differences of the yaw."""
        return (
            frozen(np.gradient(self.node[:, 2], self.arc)) if len(self.node) > 1 else frozen([0.0])
        )

    def displaced(self, deviation: Floats) -> tuple[Floats, Floats]:
        """Paths of S samples.

        Args:
            deviation: (S, G) metres to the left of the route, 0 at both ends.

        Returns:
            curve (S, G, 4): x, y, dx/du, dy/du at every node; arc (S, G): arc length [m] of the sample's own path.
        """
        shape = deviation.shape
        curve, arc = np.zeros((*shape, 4)), np.zeros(shape)
        if shape[1] == 1:
            curve[:, 0, :2] = self.node[0, :2]
            curve[:, 0, 2:] = np.cos(self.node[0, 2]), np.sin(self.node[0, 2])
        else:
            _displace(self.node, self.spacing, np.ascontiguousarray(deviation), curve, arc)
        return curve, arc


@kernel(inline=True)
def _speed(curve: Floats, j: int, h: float, x: float) -> float:
    """|dp/du| at fraction x of cell j of curve (G, 4)."""
    a, b, c = 6.0 * x * (1.0 - x) / h, (1.0 - x) * (1.0 - 3.0 * x), x * (3.0 * x - 2.0)
    dx = a * (curve[j + 1, 0] - curve[j, 0]) + b * curve[j, 2] + c * curve[j + 1, 2]
    dy = a * (curve[j + 1, 1] - curve[j, 1]) + b * curve[j, 3] + c * curve[j + 1, 3]
    return float(np.sqrt(dx * dx + dy * dy))


@kernel(inline=True)
def _part(curve: Floats, j: int, h: float, x: float) -> float:
    """Arc length of cell j up to fraction x, by three-point Gauss quadrature."""
    total = 0.0
    for k in range(3):
        total += _GAUSS_W[k] * _speed(curve, j, h, x * _GAUSS_X[k])
    return total * x * h


@kernel(F2, F, F2, OUT3, OUT2)
def _displace(node: Floats, h: float, deviation: Floats, curve: Floats, arc: Floats) -> None:
    """Clamped cubic splines through the displaced nodes (Thomas algorithm on the tangents), and their arc lengths."""
    samples, g = deviation.shape
    cos, sin, ratio = np.empty(g), np.empty(g), np.empty(g)
    for j in range(g):
        cos[j], sin[j] = np.cos(node[j, 2]), np.sin(node[j, 2])
    for j in range(1, g - 1):
        ratio[j] = 1.0 / (4.0 - (ratio[j - 1] if j > 1 else 0.0))
    for s in range(samples):
        c = curve[s]
        for j in range(g):
            c[j, 0] = node[j, 0] - deviation[s, j] * sin[j]
            c[j, 1] = node[j, 1] + deviation[s, j] * cos[j]
        for end in (0, g - 1):
            c[end, 2], c[end, 3] = cos[end], sin[end]
        for axis in range(2):
            for j in range(1, g - 1):
                right = 3.0 * (c[j + 1, axis] - c[j - 1, axis]) / h - c[j - 1, 2 + axis]
                if j == g - 2:
                    right -= c[g - 1, 2 + axis]
                c[j, 2 + axis] = right * ratio[j]
            for j in range(g - 3, 0, -1):
                c[j, 2 + axis] -= ratio[j] * c[j + 1, 2 + axis]
        for j in range(g - 1):
            arc[s, j + 1] = arc[s, j] + _part(c, j, h, 1.0)


@kernel(inline=True)
def _fraction(curve: Floats, j: int, h: float, at: float, length: float) -> float:
    """Fraction of cell j at which `at` metres of its `length` are behind (Newton: |dp/du| hardly varies in a cell)."""
    x = at / length
    for _ in range(3):
        missing = at - _part(curve, j, h, x)
        x += missing / (h * _speed(curve, j, h, x))
        if abs(missing) < 1e-6:  # the next step would change nothing that can be seen
            break
    return min(max(x, 0.0), 1.0)


@kernel(inline=True)
def _pose(c: Floats, j: int, h: float, x: float, out: Floats) -> None:
    """Write x, y and yaw at fraction x of cell j."""
    y = 1.0 - x
    p, q, r, w = y * y * (1.0 + 2.0 * x), x * x * (3.0 - 2.0 * x), h * x * y * y, -h * x * x * y
    for axis in range(2):
        out[axis] = (
            p * c[j, axis] + q * c[j + 1, axis] + r * c[j, 2 + axis] + w * c[j + 1, 2 + axis]
        )
    e, f, d = 6.0 * x * y / h, y * (1.0 - 3.0 * x), x * (3.0 * x - 2.0)
    dx = e * (c[j + 1, 0] - c[j, 0]) + f * c[j, 2] + d * c[j + 1, 2]
    dy = e * (c[j + 1, 1] - c[j, 1]) + f * c[j, 3] + d * c[j + 1, 3]
    out[2] = np.arctan2(dy, dx)


class Displaced(NamedTuple):
    """The paths of S samples, see `BasePath.displaced`.

    Attributes:
        curve: (S, G, 4); G = 1 for a vehicle that stands throughout.
        arc: (S, G) arc lengths [m].
        spacing: of the route's nodes [m].
    """

    curve: Floats
    arc: Floats
    spacing: float


class SpeedDrawn(NamedTuple):
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


class ClockRead(NamedTuple):
    """What the clocks of S samples say at up to T instants.

    Attributes:
        tau: (S, T) template times [s], ascending.
        pace: (S, T) rate of the sample's clock there.
        slope: (S, T) 1/s, its derivative.
        counts: (S,) how many of them are asked for.
    """

    tau: Floats
    pace: Floats
    slope: Floats
    counts: Ints


@kernel(inline=True)
def _read_piece(speed: SpeedDrawn, s: int, i: int, out: Floats) -> None:
    """Write the polynomial (4,) of piece i of sample s."""
    for power in range(4):
        out[power] = 0.0
        for q in range(4):
            out[power] += speed.pieces[i, power, q] * speed.coefficients[s, speed.first[i] + q]


@kernel(inline=True)
def _driven(p: Floats, x: float) -> float:
    """Metres driven in the first x seconds of a piece."""
    return float(x * (p[0] + x * (p[1] / 2.0 + x * (p[2] / 3.0 + x * p[3] / 4.0))))


@kernel(
    named(Displaced, F3, F2, F),
    named(SpeedDrawn, F1, I1, F3, F2),
    named(ClockRead, F2, F2, F2, I1),
    OUT3,
)
def states(path: Displaced, speed: SpeedDrawn, clock: ClockRead, out: Floats) -> None:
    """Fill `out` (S, T, 5) with x, y [m], yaw [rad, not unwrapped], speed [m/s], acceleration [m/s²] of one vehicle."""
    breaks, h = speed.breaks, path.spacing
    g, m = path.curve.shape[1], speed.pieces.shape[0]
    p = np.empty(4)
    for s in range(path.curve.shape[0]):
        i, j, start, before = 0, 0, 0.0, -1.0
        c, arc = path.curve[s], path.arc[s]
        _read_piece(speed, s, i, p)
        for k in range(clock.counts[s]):
            t = min(max(clock.tau[s, k], breaks[0]), breaks[m])
            while i < m - 1 and t >= breaks[i + 1]:
                start += _driven(p, breaks[i + 1] - breaks[i])
                i += 1
                _read_piece(speed, s, i, p)
            x, r = t - breaks[i], clock.pace[s, k]
            u, du = (
                p[0] + x * (p[1] + x * (p[2] + x * p[3])),
                p[1] + x * (2.0 * p[2] + x * 3.0 * p[3]),
            )
            out[s, k, 3] = max(u / r, 0.0)
            out[s, k, 4] = (du - u / r * clock.slope[s, k]) / (r * r)
            if g == 1:
                out[s, k, 0], out[s, k, 1] = c[0, 0], c[0, 1]
                out[s, k, 2] = np.arctan2(c[0, 3], c[0, 2])
                continue
            at = start + _driven(p, x)
            if at == before:  # stands
                out[s, k, :3] = out[s, k - 1, :3]
                continue
            before = at
            while j < g - 2 and at > arc[j + 1]:
                j += 1
            while j > 0 and at < arc[j]:
                j -= 1
            _pose(c, j, h, _fraction(c, j, h, at - arc[j], arc[j + 1] - arc[j]), out[s, k])
