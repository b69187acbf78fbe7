# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A planar curve with its arc length: the reference lines, lanes and paths of this package and of the fitting."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from scenario_gen.numerics.arrays import Floats, frozen, Ints
from scenario_gen.numerics.plane import edge_lengths, edge_yaws, meeting_shares

TOGETHER = (
    64  # positions that are projected at once, on the edges that can be nearest to any of them
)


@dataclass(frozen=True, eq=False)
class Curve:
    """A polyline fine enough to pass for smooth, continued straight on beyond both ends.

    Attributes:
        points: (M, 3) x [m], y [m], yaw [rad, unwrapped], M >= 2, no two consecutive points equal.
    """

    points: Floats

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", frozen(self.points))

    @classmethod
    def through(cls, xy: Floats) -> "Curve":
        """Lay a curve on points (M, 2) [m]; the yaw of each is the mean direction of its two neighbouring edges."""
        xy = xy[np.concatenate(([True], edge_lengths(xy) > 1e-9))]
        edge = np.unwrap(edge_yaws(xy))
        yaw = np.concatenate((edge[:1], (edge[1:] + edge[:-1]) / 2.0, edge[-1:]))
        return cls(np.column_stack((xy, yaw)))

    @cached_property
    def station(self) -> Floats:
        """(M,) arc length [m] of each point."""
        return frozen(np.concatenate(([0.0], np.cumsum(edge_lengths(self.points[:, :2])))))

    @property
    def length(self) -> float:
        """Arc length [m] from the first to the last point."""
        return float(self.station[-1])

    def at(self, station: Floats | float) -> Floats:
        """Poses (..., 3) at arc lengths (...); beyond the ends straight on."""
        s = np.asarray(station, dtype=np.float64)
        pose = np.empty((*s.shape, 3))
        for k in range(3):
            pose[..., k] = np.interp(s, self.station, self.points[:, k])
        beyond = np.minimum(s, 0.0) + np.maximum(s - self.length, 0.0)
        pose[..., 0] += beyond * np.cos(pose[..., 2])
        pose[..., 1] += beyond * np.sin(pose[..., 2])
        return pose

    def beside(self, station: Floats, offset: Floats | float) -> Floats:
        """Poses (..., 3) at arc lengths and offsets [m, left positive]; the yaw is the curve's own."""
        pose = self.at(station)
        pose[..., 0] -= offset * np.sin(pose[..., 2])
        pose[..., 1] += offset * np.cos(pose[..., 2])
        return pose

    def project(self, xy: Floats) -> tuple[Floats, Floats]:
        """Station and offset [m, left positive], (P,) each, of the nearest points of the curve to (P, 2) positions."""
        reach = 1e4  # the straight continuations, far enough for any map
        ends = self.at(np.array([-reach, self.length + reach]))
        line = np.vstack((ends[:1], self.points, ends[1:]))[:, :2]
        at = np.concatenate(([-reach], self.station, [self.length + reach]))
        edge = np.diff(line, axis=0)
        size = np.hypot(edge[:, 0], edge[:, 1])
        along = edge / size[:, None]
        candidates = [np.zeros((2, 0))]
        for part in (xy[first : first + TOGETHER] for first in range(0, len(xy), TOGETHER)):
            near = _near(part, line, size)
            way, length = along[near], size[near]
            rel = part[:, None, :] - line[None, near, :]
            t = np.clip(rel[..., 0] * way[:, 0] + rel[..., 1] * way[:, 1], 0.0, length)
            gap = np.hypot(rel[..., 0] - t * way[:, 0], rel[..., 1] - t * way[:, 1])
            best = np.argmin(gap, axis=1)
            row = np.arange(len(part))
            side = way[best, 0] * rel[row, best, 1] - way[best, 1] * rel[row, best, 0]
            candidates.append(
                np.array([at[near][best] + t[row, best], np.sign(side) * gap[row, best]])
            )
        station, offset = np.concatenate(candidates, axis=1)
        return station, offset

    def reversed(self) -> "Curve":
        """The same curve driven the other way."""
        points = self.points[::-1].copy()
        points[:, 2] += np.pi
        return Curve(points)

    def cut(self, start: float, end: float, step: float = 0.5) -> "Curve":
        """The piece between two stations (continued straight where they lie beyond the ends), resampled."""
        count = max(int(np.ceil((end - start) / step)), 1)
        return Curve(self.at(np.linspace(start, end, count + 1)))


def _near(xy: Floats, line: Floats, size: Floats) -> Ints:
    """Ascending indices of the edges of `line` (M + 1, 2), `size` long, that can be the nearest to one of the positions (P, 2).

    A circle about the positions: the nearest edge to any of them is no farther from its centre than the nearest vertex and the
    circle's diameter, and an edge is no nearer than its first vertex less its size. What is not finite keeps every edge.
    """
    centre = xy.mean(axis=0)
    radius = np.hypot(*(xy - centre).T).max()
    away = np.hypot(line[:, 0] - centre[0], line[:, 1] - centre[1])
    return np.flatnonzero(~(away[:-1] - size > away.min() + 2.0 * radius + 1e-6))


def crossings(first: Curve, second: Curve, min_angle: float = 0.35) -> Floats:
    """Stations (K, 2) at which `first` crosses `second` at an angle of at least `min_angle` [rad], in order along `first`."""
    a, b = first.points[:, :2], second.points[:, :2]
    near = _edges_in(a, b)  # edges that lie in the other one's box
    near_other = _edges_in(b, a[np.union1d(near, near + 1)]) if len(near) else near
    u, v = np.diff(a, axis=0)[near], np.diff(b, axis=0)[near_other]
    t, q, det = meeting_shares(a[near, None], u[:, None], b[None, near_other], v[None])
    sine = np.abs(det) / (
        np.hypot(u[:, 0], u[:, 1])[:, None] * np.hypot(v[:, 0], v[:, 1])[None, :]
    )
    hit = (t >= 0.0) & (t < 1.0) & (q >= 0.0) & (q < 1.0) & (sine >= np.sin(min_angle))
    i, j = np.nonzero(hit)
    k, n = near[i], near_other[j]
    return np.column_stack(
        (
            first.station[k] + t[i, j] * np.diff(first.station)[k],
            second.station[n] + q[i, j] * np.diff(second.station)[n],
        )
    )


def _edges_in(points: Floats, others: Floats) -> Ints:
    """Indices of the edges of a polyline (M, 2) [m] whose boxes meet that of other points (K, 2)."""
    low, high = np.minimum(points[:-1], points[1:]), np.maximum(points[:-1], points[1:])
    return np.flatnonzero(((high >= others.min(axis=0)) & (low <= others.max(axis=0))).all(axis=1))
