# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A drawing of a road: strips, corners and swept footprints as polygons in metres; and the grid that they make."""

from dataclasses import dataclass, field

import numpy as np
from PIL import Image, ImageDraw
from scipy import ndimage

from scenario_gen.numerics import Bools, Floats
from scenario_gen.numerics.boxes import corners
from scenario_gen.numerics.curve import Curve
from scenario_gen.numerics.plane import unit
from scenario_gen.roads.config import refuse_too_many_cells, RoadConfig
from scenario_gen.roads.drawn import Plan, road_of
from scenario_gen.types import Road

ARM_COUNT = {"straight": 2, "curve": 2, "t_intersection": 3, "four_way": 4, "roundabout": 4}
ROOM = 6.0  # metres kept free behind the first and before the last footprint
SLACK = 12.0  # metres by which a junction's geometry, and ways through it, may differ from the template's
SHORTEST = 30.0  # metres of an arm
LANE_GAP = 2.0  # metres sideways that make another lane
_BORDER = 2.0  # metres of wall around the grid
_SLIVER = 60.0  # m²: smaller holes are filled
_STEP = 0.5  # metres between two cross sections of a strip
_FLAT = np.radians(165.0)  # kerbs that meet at more make no corner


@dataclass(frozen=True, eq=False)
class Sketch:
    """Polygons (K, 2) [m] that are drivable, and islands in them that are not."""

    drivable: list[Floats] = field(default_factory=list)
    islands: list[Floats] = field(default_factory=list)

    def strip(self, line: Curve, right: float, left: float) -> None:
        """Add what lies between `right` and `left` metres to the left of a line (right < left)."""
        s = np.linspace(0.0, line.length, max(int(np.ceil(line.length / _STEP)), 1) + 1)
        right_edge, left_edge = (line.beside(s, offset)[:, :2] for offset in (right, left))
        if abs(line.points[-1, 2] - line.points[0, 2]) < 1e-9 and len(line.points) == 2:
            self.drivable.append(np.array([right_edge[0], right_edge[-1], left_edge[-1], left_edge[0]]))
        else:
            self.drivable.extend(np.stack((right_edge[:-1], right_edge[1:], left_edge[1:], left_edge[:-1]), axis=1))

    def sweep(self, line: Curve, length: float, width: float) -> None:
        """Add what a footprint of `length` and `width` [m] covers on its way along a line."""
        self.drivable.extend(corners(line.cut(0.0, line.length, _STEP).points, length, width))

    def corner(self, at: Floats, first: float, second: float, radius: float) -> None:
        """Round the corner `at` (2,) between kerbs that lead away at `first` and `second` [rad], the first clockwise."""
        angle = float((second - first) % (2.0 * np.pi))
        if not 0.05 < angle < _FLAT:
            return
        tangent = radius / np.tan(angle / 2.0)
        centre = at + radius / np.sin(angle / 2.0) * unit(first + angle / 2.0)
        begin, end = (at + tangent * unit(kerb) for kerb in (first, second))
        self.drivable.append(np.vstack((at[None], begin[None], _arc(centre, begin, end, radius), end[None])))

    def grid(self, name: str, config: RoadConfig) -> tuple[Floats, Bools]:
        """The lower-left corner (2,) [m] of the grid that holds everything, and whether its cells (H, W) are drivable.

        Raises:
            RefusedError: it has more cells than are allowed.
        """
        everything = np.concatenate(self.drivable)
        low = np.floor(everything.min(axis=0) - _BORDER)
        width, height = np.ceil((everything.max(axis=0) + _BORDER - low) / config.resolution).astype(int).tolist()
        refuse_too_many_cells(name, width, height, config)
        image = Image.new("1", (width, height))
        brush = ImageDraw.Draw(image)
        for polygons, fill in ((self.drivable, 1), (self.islands, 0)):
            for polygon in polygons:
                cells = (polygon - low) / config.resolution - 0.5  # PIL's integers are cell centres
                brush.polygon([(x, y) for x, y in cells.tolist()], fill=fill)
        return low, np.array(image, dtype=np.bool_)

    def road(self, name: str, plan: Plan, config: RoadConfig) -> Road:
        """The road with its lanes, its lower-left corner at (0, 0); small holes are filled unless islands were drawn.

        Raises:
            RefusedError: it has more cells than are allowed.
        """
        low, drivable = self.grid(name, config)
        if not self.islands:
            part, _ = ndimage.label(~drivable)
            drivable |= np.bincount(part.ravel())[part] <= _SLIVER / np.square(config.resolution)
        return road_of(plan, name, low, drivable, config)


def _arc(centre: Floats, first: Floats, last: Floats, radius: float) -> Floats:
    """(M, 2) the shorter arc about a centre from one point to another."""
    a, b = first - centre, last - centre
    start = float(np.arctan2(a[1], a[0]))
    turn = float(np.arctan2(a[0] * b[1] - a[1] * b[0], float((a * b).sum())))
    return np.asarray(centre + radius * unit(start + np.linspace(0.0, turn, 9)))
