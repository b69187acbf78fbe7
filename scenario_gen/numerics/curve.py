# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Planar curves by arc length: reference lines, lanes and paths."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from scenario_gen.numerics.arrays import Floats, frozen
from scenario_gen.numerics.plane import arc_lengths, edge_lengths, edge_yaws
from scenario_gen.numerics.polylines import fill_crossings, project_positions

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
        count = max(int(np.ceil((end - start) / step)), 1)
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
