# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Planar curves by arc length: reference lines, lanes and paths."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from scenario_gen.numerics.arrays import Floats, frozen, Ints
from scenario_gen.numerics.plane import arc_lengths, edge_lengths, edge_yaws, meeting_shares

BATCH_POINTS = 64  # positions that are projected at once
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

    def project(self, xy: Floats) -> tuple[Floats, Floats]:
        """Return stations and offsets (P,) [m, left positive] of positions (P, 2)."""
        ends = self.at(np.array([-EXTENSION_M, self.length + EXTENSION_M]))
        line = np.vstack((ends[:1], self.points, ends[1:]))[:, :2]
        station = np.concatenate(([-EXTENSION_M], self.station, [self.length + EXTENSION_M]))
        batches = (xy[first : first + BATCH_POINTS] for first in range(0, len(xy), BATCH_POINTS))
        results = [_project(batch, line, station) for batch in batches]
        stations, offsets = np.concatenate([np.zeros((2, 0)), *results], axis=1)
        return stations, offsets

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


def _project(xy: Floats, line: Floats, station: Floats) -> Floats:
    """Return stations and offsets (2, P) of positions (P, 2) on a polyline (M + 1, 2)."""
    edge = np.diff(line, axis=0)
    length = np.hypot(edge[:, 0], edge[:, 1])
    near = _near_edges(xy, line, length)
    direction = (edge / length[:, None])[near]  # (E, 2)
    relative = xy[:, None, :] - line[None, near, :]  # (P, E, 2)

    along = relative[..., 0] * direction[:, 0] + relative[..., 1] * direction[:, 1]
    along = np.clip(along, 0.0, length[near])
    gap = np.hypot(
        relative[..., 0] - along * direction[:, 0], relative[..., 1] - along * direction[:, 1]
    )
    best = np.argmin(gap, axis=1)  # (P,) the nearest edge

    row = np.arange(len(xy))
    nearest = direction[best]
    cross = nearest[:, 0] * relative[row, best, 1] - nearest[:, 1] * relative[row, best, 0]
    return np.array([station[near][best] + along[row, best], np.sign(cross) * gap[row, best]])


def _near_edges(xy: Floats, line: Floats, length: Floats) -> Ints:
    """Return ascending indices of the edges that can be nearest to one of the positions (P, 2).

    In a circle around the positions, the nearest edge to any of them is no farther from the
    centre than the nearest vertex plus the diameter. An edge is no nearer than its first vertex
    minus its length. Positions that are not finite keep every edge.
    """
    centre = xy.mean(axis=0)
    radius = np.hypot(*(xy - centre).T).max()
    distance = np.hypot(line[:, 0] - centre[0], line[:, 1] - centre[1])
    return np.flatnonzero(~(distance[:-1] - length > distance.min() + 2.0 * radius + 1e-6))


def crossings(first: Curve, second: Curve, min_angle: float = 0.35) -> Floats:
    """Return the stations (K, 2) [m] where two curves cross.

    The angle between them is at least `min_angle` [rad].

    The first column is on `first`, in ascending order of its edges, the second one on `second`.
    """
    a = first.points[:, :2]
    b = second.points[:, :2]
    near_a = _edges_in_box(a, b)
    near_b = _edges_in_box(b, a[np.union1d(near_a, near_a + 1)]) if len(near_a) else near_a
    u = np.diff(a, axis=0)[near_a]
    v = np.diff(b, axis=0)[near_b]
    t, s, cross = meeting_shares(a[near_a, None], u[:, None], b[None, near_b], v[None])

    lengths = np.hypot(u[:, 0], u[:, 1])[:, None] * np.hypot(v[:, 0], v[:, 1])[None, :]
    sine = np.abs(cross) / lengths
    hit = (t >= 0.0) & (t < 1.0) & (s >= 0.0) & (s < 1.0) & (sine >= np.sin(min_angle))
    i, j = np.nonzero(hit)
    on_first = first.station[near_a[i]] + t[i, j] * np.diff(first.station)[near_a[i]]
    on_second = second.station[near_b[j]] + s[i, j] * np.diff(second.station)[near_b[j]]
    return np.column_stack((on_first, on_second))


def _edges_in_box(points: Floats, others: Floats) -> Ints:
    """Return the indices of edges whose bounding box meets that of other points (K, 2)."""
    low = np.minimum(points[:-1], points[1:])
    high = np.maximum(points[:-1], points[1:])
    return np.flatnonzero(((high >= others.min(axis=0)) & (low <= others.max(axis=0))).all(axis=1))
