# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A target road: what is drivable, and where traffic comes in and goes out."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.numerics import (
    Bools,
    canonical_poses,
    Floats,
    freeze,
    frozen,
    frozen_bools,
    Ints,
)
from scenario_gen.types.lanes import LaneNetwork

FINEST, COARSEST = 0.001, 10.0  # metres of a cell: nothing is seen of a vehicle in larger ones
FARTHEST = 1e8  # metres from the frame's origin: more than any geodetic grid has


@dataclass(frozen=True, eq=False)
class Road:
    """An occupancy grid with entries and exits.

    Attributes:
        name: e.g. "t_intersection", or the stem of the map's file; for people, nothing is computed from it.
        drivable: (H, W) bool; row 0 is the lowest y, column 0 the lowest x (nav_msgs/OccupancyGrid order).
        resolution: cell size in metres, exactly representable in float32 (as it is on the wire).
        origin: (2,) x, y in metres of the lower-left corner of cell (0, 0); the grid is not rotated.
        entries: (E, 3) x, y, yaw: centre of each lane by which traffic comes in, heading into the road.
        exits: (X, 3) x, y, yaw: centre of each lane by which traffic leaves, heading out of the road.
        frame_id: the frame of all poses.
        lanes: those of a vector map that the grid was drawn from, or those drawn with it; None: nothing is known of lanes.
        obstructed: (H, W) bool; cells that would be drivable, but for something that stands there. None: nothing does.
    """

    name: str
    drivable: Bools
    resolution: float
    origin: Floats
    entries: Floats
    exits: Floats
    frame_id: str = "map"
    lanes: LaneNetwork | None = None
    obstructed: Bools | None = None

    def __post_init__(self) -> None:
        freeze(
            self,
            drivable=frozen_bools(self.drivable),
            obstructed=None if self.obstructed is None else frozen_bools(self.obstructed),
            resolution=float(np.float32(self.resolution)),
            origin=frozen(self.origin),
            entries=canonical_poses(np.reshape(self.entries, (-1, 3))),
            exits=canonical_poses(np.reshape(self.exits, (-1, 3))),
        )
        if self.drivable.ndim != 2 or not self.drivable.any():
            raise InputError(f"road {self.name!r} has no drivable cell")
        if not FINEST <= self.resolution <= COARSEST:
            raise InputError(
                f"road {self.name!r} has resolution {self.resolution:g} m; {FINEST:g} to {COARSEST:g} m are read"
            )
        if self.origin.shape != (2,) or not (np.abs(self.origin) <= FARTHEST).all():
            raise InputError(
                f"road {self.name!r} has origin {self.origin}; at most {FARTHEST:g} m from the frame's origin are read"
            )

    @property
    def map_lanes(self) -> LaneNetwork | None:
        """The lanes of a vector map: templates are placed on them, and who drives is held to them."""
        return None if self.lanes is None or self.lanes.drawn else self.lanes

    def __repr__(self) -> str:
        height, width = (self.resolution * cells for cells in self.drivable.shape)
        return f"Road({self.name!r}, {width:g} x {height:g} m)"

    @cached_property
    def cleared(self) -> "Road":
        """The same road with nothing in the way; itself, if nothing is."""
        if self.obstructed is None:
            return self
        return replace(self, drivable=self.drivable | self.obstructed, obstructed=None)

    def cells(self, points: Floats) -> tuple[Ints, Ints, Bools]:
        """Return rows and columns (...) of the cells nearest to points (..., 2) [m], and whether the points lie on the grid."""
        cell = np.floor((points - self.origin) / self.resolution).astype(np.int64)
        height, width = self.drivable.shape
        column, row = np.clip(cell[..., 0], 0, width - 1), np.clip(cell[..., 1], 0, height - 1)
        return row, column, np.asarray((cell[..., 0] == column) & (cell[..., 1] == row))

    def drivable_at(self, points: Floats) -> Bools:
        """Return whether points (..., 2) [m] lie in drivable cells; none beyond the grid does."""
        row, column, inside = self.cells(points)
        return np.asarray(inside & self.drivable[row, column])
