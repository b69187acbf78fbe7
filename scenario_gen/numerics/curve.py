# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Planar curves by arc length, and the polylines that they are made of."""

from dataclasses import dataclass
from functools import cached_property
import math

import numpy as np

from scenario_gen.numerics.arrays import arc_lengths, edge_lengths, edge_yaws, Floats, frozen
from scenario_gen.numerics.kernels import F, F1, F2, kernel, OUT2

_ROUNDING_M = 1e-6  # of arc lengths and distances, so that it excludes no edge


@kernel(F2, F2, F1, F1, F2, OUT2)
def project_positions(
    line: Floats,
    direction: Floats,
    length: Floats,
    station: Floats,
    positions: Floats,
    out: Floats,
) -> None:
    """Fill `out` (P, 2) with stations and offsets to the left [m] of positions (P, 2) [m].

    Of several nearest edges, the first one counts.

    Args:
        line: (M + 1, 2) [m].
        direction: (M, 2) unit vectors of its edges.
        length: (M,) [m] of its edges.
        station: (M + 1,) arc lengths [m] of its points.
        positions: the places to project.
        out: the result.
    """
    nearest = 0
    for i in range(len(positions)):
        x, y = positions[i, 0], positions[i, 1]
        along, left, best = _on_edge(line[nearest], direction[nearest], length[nearest], x, y)
        edge = 0
        while edge < len(length):
            projection = _on_edge(line[edge], direction[edge], length[edge], x, y)
            gap = projection[2]
            if gap < best or (gap == best and edge < nearest):
                nearest = edge
                along, left, best = projection
            edge = _next_edge(station, edge, station[edge + 1] + gap - best)
        out[i, 0] = station[nearest] + along
        out[i, 1] = math.copysign(best, left) if left != 0.0 else 0.0


@kernel(inline=True)
def _on_edge(
    start: Floats, direction: Floats, length: float, x: float, y: float
) -> tuple[float, float, float]:
    """Return the station on an edge, the distance to the left of its line, and from it [m]."""
    dx, dy = x - start[0], y - start[1]
    along = min(max(dx * direction[0] + dy * direction[1], 0.0), length)
    across = dx - along * direction[0]
    over = dy - along * direction[1]
    left = direction[0] * dy - direction[1] * dx
    return along, left, math.sqrt(across * across + over * over)


@kernel(inline=True)
def _next_edge(station: Floats, edge: int, reach: float) -> int:
    """Return the first later edge that does not end before an arc length [m]."""
    edge += 1
    while edge < len(station) - 1 and station[edge + 1] < reach - _ROUNDING_M:
        edge += 1
    return edge


@kernel(F2, F1, F2, F1, F, OUT2)
def fill_crossings(
    first: Floats,
    first_station: Floats,
    second: Floats,
    second_station: Floats,
    min_sine: float,
    out: Floats,
) -> int:
    """Fill `out` (K, 2) with the arc lengths [m] at which two polylines (M, 2) [m] cross.

    They are in the order of the edges; `min_sine` is that of the smallest angle. Returns the
    number of crossings; if it exceeds K, the last ones replace the first.
    """
    count = 0
    for i in range(len(first) - 1):
        ux, uy = first[i + 1, 0] - first[i, 0], first[i + 1, 1] - first[i, 1]
        length = math.hypot(ux, uy)
        j = 0
        while j < len(second) - 1:
            wx, wy = second[j, 0] - first[i, 0], second[j, 1] - first[i, 1]
            vx, vy = second[j + 1, 0] - second[j, 0], second[j + 1, 1] - second[j, 1]
            cross = ux * vy - uy * vx
            t = (wx * vy - wy * vx) / cross
            s = (wx * uy - wy * ux) / cross
            is_steep = abs(cross) >= min_sine * (length * math.hypot(vx, vy))
            if is_steep and 0.0 <= t < 1.0 and 0.0 <= s < 1.0:
                station = first_station[i] + t * (first_station[i + 1] - first_station[i])
                other = second_station[j] + s * (second_station[j + 1] - second_station[j])
                out[count % len(out), 0], out[count % len(out), 1] = station, other
                count += 1
            j = _next_edge(second_station, j, second_station[j] + math.hypot(wx, wy) - length)
    return count


EXTENSION_M = 1e4  # length of the straight extensions in a projection: farther than any map


@dataclass(frozen=True, eq=False)
class Curve:
    """A finely sampled curve, extended straight beyond both ends.

    Attributes:
        points: (M, 3) x [m], y [m], yaw [rad, unwrapped], M >= 2, consecutive points differ.
    """

    points: Floats

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", frozen(self.points))

    @classmethod
    def through(cls, xy: Floats) -> "Curve":
        """Return the curve through points (M, 2) [m].

        Its yaw is the mean of both adjacent edges' directions.
        """
        xy = xy[np.concatenate(([True], edge_lengths(xy) > 1e-9))]
        edge = np.unwrap(edge_yaws(xy))
        yaw = np.concatenate((edge[:1], (edge[1:] + edge[:-1]) / 2.0, edge[-1:]))
        return cls(np.column_stack((xy, yaw)))

    @cached_property
    def station(self) -> Floats:
        """(M,) arc length [m] of each point."""
        return frozen(arc_lengths(self.points[:, :2]))

    @property
    def length(self) -> float:
        """Arc length [m] from the first to the last point."""
        return float(self.station[-1])

    def at(self, station: Floats | float) -> Floats:
        """Return the poses (..., 3) at arc lengths (...) [m], also on the straight extensions."""
        s = np.asarray(station, dtype=np.float64)
        pose = np.empty((*s.shape, 3))
        for k in range(3):
            pose[..., k] = np.interp(s, self.station, self.points[:, k])
        beyond = np.minimum(s, 0.0) + np.maximum(s - self.length, 0.0)
        if beyond.any():
            pose[..., 0] += beyond * np.cos(pose[..., 2])
            pose[..., 1] += beyond * np.sin(pose[..., 2])
        return pose

    def yaw_at(self, station: Floats) -> Floats:
        """Return the yaw (...) [rad] at arc lengths (...) [m], also on the straight extensions."""
        return np.asarray(np.interp(station, self.station, self.points[:, 2]))

    def at_offset(self, station: Floats, offset: Floats | float) -> Floats:
        """Return the poses (..., 3) at arc lengths and lateral offsets [m, left positive]."""
        pose = self.at(station)
        pose[..., 0] -= offset * np.sin(pose[..., 2])
        pose[..., 1] += offset * np.cos(pose[..., 2])
        return pose

    @cached_property
    def _extended(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Points, directions and lengths of edges, and stations, with the extensions."""
        ends = np.array([-EXTENSION_M, self.length + EXTENSION_M])
        station = np.concatenate((ends[:1], self.station, ends[1:]))
        first, last = self.at(ends)
        line = np.vstack((first, self.points, last))[:, :2]
        edge = np.diff(line, axis=0)
        length = np.hypot(edge[:, 0], edge[:, 1])
        return frozen(line), frozen(edge / length[:, None]), frozen(length), frozen(station)

    def project(self, xy: Floats) -> tuple[Floats, Floats]:
        """Return stations and offsets (P,) [m, left positive] of positions (P, 2)."""
        out = np.empty((len(xy), 2))
        project_positions(*self._extended, xy, out)
        return out[:, 0], out[:, 1]

    def reversed(self) -> "Curve":
        """Return the curve in the opposite direction."""
        points = self.points[::-1].copy()
        points[:, 2] += np.pi
        return Curve(points)

    def cut(self, start: float, end: float, step: float = 0.5) -> "Curve":
        """Return the part between two stations [m], resampled.

        It may reach into the extensions.
        """
        count = max(int(np.ceil((end - start) / step - 1e-6)), 1)
        return Curve(self.at(np.linspace(start, end, count + 1)))


def crossings(first: Curve, second: Curve, min_angle: float = 0.35) -> Floats:
    """Return the stations (K, 2) [m] where two curves cross.

    The angle between them is at least `min_angle` [rad].

    The first column is on `first`, in ascending order of its edges, the second one on `second`.
    """
    lines = (first.points[:, :2], first.station, second.points[:, :2], second.station)
    stations = np.empty((8, 2))
    count = fill_crossings(*lines, np.sin(min_angle), stations)
    if count > len(stations):
        stations = np.empty((count, 2))
        fill_crossings(*lines, np.sin(min_angle), stations)
    return stations[:count]
