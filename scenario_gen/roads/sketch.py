# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A drawing of a road: strips, corners and swept footprints as polygons in metres, and the grid that they make."""

from dataclasses import dataclass, field

import numpy as np
from PIL import Image, ImageDraw

from scenario_gen.numerics import Bools, exact, Floats
from scenario_gen.numerics.curve import Curve
from scenario_gen.roads.config import refuse_too_many_cells, RoadConfig
from scenario_gen.roads.labels import labelled
from scenario_gen.types import Road

_BORDER = 2.0  # metres of wall around the grid
_SLIVER = 60.0  # m²: smaller holes are none
_STEP = 0.5  # metres between two cross sections of a strip
_FLAT = np.radians(165.0)  # kerbs that meet at more make no corner


@dataclass(frozen=True, eq=False)
class Sketch:
    """Polygons (K, 2) [m] that are drivable, and those that are not after all (islands)."""

    drivable: list[Floats] = field(default_factory=list)
    islands: list[Floats] = field(default_factory=list)

    def strip(self, line: Curve, right: float, left: float) -> None:
        """Add what lies between `right` and `left` metres to the left of a line (right < left)."""
        s = np.linspace(0.0, line.length, max(int(np.ceil(line.length / _STEP)), 1) + 1)
        one, other = (line.beside(s, np.full(len(s), offset))[:, :2] for offset in (right, left))
        if abs(line.points[-1, 2] - line.points[0, 2]) < 1e-9 and len(line.points) == 2:
            self.drivable.append(np.array([one[0], one[-1], other[-1], other[0]]))
        else:
            self.drivable.extend(np.stack((one[:-1], one[1:], other[1:], other[:-1]), axis=1))

    def sweep(self, line: Curve, length: float, width: float) -> None:
        """Add what a footprint of `length` and `width` [m] covers on its way along a line."""
        poses = line.cut(0.0, line.length, _STEP).points
        cos, sin = exact.cos(poses[:, 2])[:, None], exact.sin(poses[:, 2])[:, None]
        u = np.array([1.0, -1.0, -1.0, 1.0]) * length / 2.0
        v = np.array([1.0, 1.0, -1.0, -1.0]) * width / 2.0
        self.drivable.extend(np.stack((poses[:, :1] + u * cos - v * sin, poses[:, 1:2] + u * sin + v * cos), axis=-1))

    def corner(self, at: Floats, one: float, other: float, radius: float) -> None:
        """Round the corner `at` (2,) between kerbs that lead away at `one` and `other` [rad], one clockwise of other."""
        angle = float((other - one) % (2.0 * np.pi))
        if not 0.05 < angle < _FLAT:
            return
        tangent = radius / exact.tan(angle / 2.0)
        middle = one + angle / 2.0
        centre = at + radius / exact.sin(angle / 2.0) * np.array([exact.cos(middle), exact.sin(middle)])
        first = at + tangent * np.array([exact.cos(one), exact.sin(one)])
        last = at + tangent * np.array([exact.cos(other), exact.sin(other)])
        arc = _arc(centre, first, last, radius)
        self.drivable.append(np.vstack((at[None], first[None], arc, last[None])))

    def raster(self, name: str, entries: Floats, exits: Floats, config: RoadConfig) -> Road:
        """The road, its lower-left corner at (0, 0).

        Raises:
            RefusedError: it has more cells than are allowed.
        """
        everything = np.concatenate(self.drivable)
        low = np.floor(everything.min(axis=0) - _BORDER)
        size = np.ceil((everything.max(axis=0) + _BORDER - low) / config.resolution).astype(int)
        refuse_too_many_cells(name, int(size[0]), int(size[1]), config)
        image = Image.new("1", (int(size[0]), int(size[1])))
        brush = ImageDraw.Draw(image)
        for polygons, fill in ((self.drivable, 1), (self.islands, 0)):
            for polygon in polygons:
                cells = (polygon - low) / config.resolution - 0.5  # PIL's integers are cell centres
                brush.polygon([(float(x), float(y)) for x, y in cells], fill=fill)
        shift = np.array([*low, 0.0])
        drivable = _without_slivers(np.asarray(image, dtype=np.bool_), int(_SLIVER / np.square(config.resolution)), self.islands)
        return Road(name, drivable, config.resolution, np.zeros(2), entries - shift, exits - shift)


def _without_slivers(drivable: Bools, most: int, islands: list[Floats]) -> Bools:
    """Fill holes of at most so many cells: what strips and sweeps left between them; islands that were drawn stay."""
    if islands:
        return drivable
    holes = labelled(~drivable)
    size = np.bincount(holes.ravel())
    return np.asarray(drivable | ((size <= most)[holes] & (holes > 0)))


def _arc(centre: Floats, first: Floats, last: Floats, radius: float) -> Floats:
    """(M, 2) the shorter arc about a centre from one point to another."""
    a, b = first - centre, last - centre
    start = float(exact.arctan2(a[1], a[0]))
    turn = float(exact.arctan2(a[0] * b[1] - a[1] * b[0], float((a * b).sum())))
    angle = start + np.linspace(0.0, turn, 9)
    return np.asarray(centre + radius * np.column_stack((exact.cos(angle), exact.sin(angle))))


def convex_hull(points: Floats) -> Floats:
    """Return the convex hull (H, 2) of points (M, 2) [m], counter-clockwise (Andrew 1979)."""
    order = points[np.lexsort((points[:, 1], points[:, 0]))]
    halves = []
    for row in (order, order[::-1]):
        half: list[Floats] = []
        for point in row:
            while len(half) > 1:
                u, v = half[-1] - half[-2], point - half[-1]
                if u[0] * v[1] - u[1] * v[0] > 0.0:
                    break
                half.pop()
            half.append(point)
        halves += half[:-1]
    return np.array(halves)
