# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A target road: what is drivable, and where traffic comes in and goes out."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scenario_gen.base.errors import InputError
from scenario_gen.base.road_users import LANE_USERS
from scenario_gen.numerics import (
    Bools,
    canonical_poses,
    Floats,
    freeze,
    frozen,
    frozen_bools,
    Ints,
    sealed,
    wrap_angle,
)
from scenario_gen.numerics.polygons import fill_slits, polygon_cells
from scenario_gen.types.lanes import Lane, LaneNetwork, Obstacle

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MIN_CELL_M = 0.001
MAX_CELL_M = 10.0  # larger cells do not resolve a vehicle
MAX_ORIGIN_M = 1e8  # per axis; every geodetic grid stays within it

DIRECTION_COUNT = 16
"""The directions that `Road.lane_directions` tells apart."""
_AGAINST_RAD = np.pi / 2.0 + np.pi / DIRECTION_COUNT  # half a direction's width stays open
_CHUNK_CELLS = 4096


@dataclass(frozen=True, eq=False)
class Road:
    """An occupancy grid, and the lanes from which it was drawn.

    Attributes:
        name: e.g. "t_intersection", or the stem of the map's file; for people, nothing is computed
            from it.
        drivable: (H, W) bool; row 0 is the lowest y, column 0 the lowest x (nav_msgs/OccupancyGrid
            order).
        resolution: cell size in metres, exactly representable in float32 (as it is on the wire).
        origin: (2,) x, y in metres of the lower-left corner of cell (0, 0); the grid is not
            rotated.
        entries: (E, 3) x, y, yaw: centre of each lane by which traffic comes in, heading into the
            road; (0, 3) without lanes.
        exits: (X, 3) x, y, yaw: centre of each lane by which traffic leaves, heading out of the
            road.
        frame_id: the frame of all poses.
        lanes: those of a vector map that the grid was drawn from, or those drawn with it; None:
            nothing is known of lanes.
        obstructed: (H, W) bool; cells that would be drivable, but for something that stands there.
            None: nothing does.
    """

    name: str
    drivable: Bools
    resolution: float
    origin: Floats
    entries: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    exits: Floats = field(default_factory=lambda: np.zeros((0, 3)))
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
        if not MIN_CELL_M <= self.resolution <= MAX_CELL_M:
            raise InputError(
                f"road {self.name!r} has resolution {self.resolution:g} m; "
                f"{MIN_CELL_M:g} to {MAX_CELL_M:g} m are read"
            )
        if self.origin.shape != (2,) or not (np.abs(self.origin) <= MAX_ORIGIN_M).all():
            raise InputError(
                f"road {self.name!r} has origin {self.origin}; "
                f"at most {MAX_ORIGIN_M:g} m from the frame's origin are read"
            )

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw the road, as `scenario_gen.plot` does.

        Raises:
            MissingExtraError: matplotlib is not installed.
        """
        import scenario_gen

        return scenario_gen.plot(self, ax)

    @property
    def map_lanes(self) -> LaneNetwork | None:
        """The lanes of a vector map, on which templates are placed and vehicles stay."""
        return None if self.lanes is None or self.lanes.drawn else self.lanes

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """What stands on a road with lanes; a road without lanes has only `obstructed` cells."""
        return () if self.lanes is None else self.lanes.obstacles

    def __repr__(self) -> str:
        height, width = (self.resolution * cells for cells in self.drivable.shape)
        return f"Road({self.name!r}, {width:g} x {height:g} m)"

    @cached_property
    def cleared(self) -> "Road":
        """The same road with nothing in the way; itself, if nothing is."""
        if self.obstructed is None:
            return self
        return replace(self, drivable=self.drivable | self.obstructed, obstructed=None)

    @cached_property
    def clearance_cells(self) -> Floats:
        """(H, W) [cells] from each cell's centre to the nearest closed square; closed cells are 0.

        Everything outside the grid is closed.
        """
        from scenario_gen.numerics.polygons import distance_field  # loads numba

        return distance_field(self.drivable)

    def clearance_at(self, rows: Ints | slice, columns: Ints | slice) -> Floats:
        """Return the `clearance_cells` of some cells [m]; a second grid would be large."""
        return np.asarray(self.clearance_cells[rows, columns] * self.resolution)

    @cached_property
    def walkable(self) -> "Road":
        """The road for pedestrians: all cells except obstacles are drivable; without lanes."""
        return replace(self, drivable=~self._obstacle_cells, lanes=None)

    @cached_property
    def grounds(self) -> Mapping[str, "Road"]:
        """The road of each lane user who may not use exactly the car lanes, with their lanes only.

        A user to whom all lanes are closed is missing.
        """
        if self.lanes is None:
            return {}
        grounds = {}
        for user in sorted(LANE_USERS - self.lanes.users_of_car_lanes):
            network = self.lanes.open_to(frozenset((user,)))
            if network.lanes:
                closed = [lane for lane in self.lanes.lanes if not lane.open_to({user})]
                cells = (self.drivable & ~self.cells_in(closed)) | self.cells_in(network.lanes)
                drivable = fill_slits(cells) & ~self._obstacle_cells
                grounds[user] = replace(self, drivable=drivable, lanes=network)
        return grounds

    @cached_property
    def lane_directions(self) -> npt.NDArray[np.uint16]:
        """(H, W): bit k of a cell is set if traffic may drive there in direction k of 16.

        All bits are set where no lane of a map lies, and near obstacles, which are passed in the
        oncoming lane. A cell may lie in several lanes, as in a junction; each lane allows the
        directions that differ from its own by at most 90°.
        """
        directions = np.zeros(self.drivable.shape, dtype=np.uint16)
        for lane in self.map_lanes.lanes if self.map_lanes is not None else ():
            rows, columns = self._cells_of_lane(lane)
            directions[rows, columns] |= self._directions_in(lane, rows, columns)
        for obstacle in self.obstacles:
            # The oncoming lane may be used within 30 m of an obstacle.
            directions[self.cells_near(obstacle.x, obstacle.y, 30.0)] = 0
        directions[directions == 0] = np.iinfo(np.uint16).max
        return sealed(directions)

    @property
    def _obstacle_cells(self) -> Bools:
        if self.obstructed is None:
            return np.zeros(self.drivable.shape, dtype=np.bool_)
        return self.obstructed

    def _cells_of_lane(self, lane: Lane) -> tuple[Ints, Ints]:
        """Return the rows and columns (C,) of the cells whose centres lie in a lane."""
        first = np.round(self.origin / self.resolution).astype(np.int64)
        return polygon_cells(lane.outline, self.resolution, first, self.drivable.shape)

    def _directions_in(self, lane: Lane, rows: Ints, columns: Ints) -> npt.NDArray[np.uint16]:
        """Return the bits (C,) that a lane sets in its cells, from the section nearest to each."""
        from scipy.spatial.distance import cdist  # is not needed to read a road

        bits = np.arange(DIRECTION_COUNT)
        turn = wrap_angle(2.0 * np.pi * bits / DIRECTION_COUNT - lane.yaw[:, None])
        allowed = ((np.abs(turn) <= _AGAINST_RAD) * (1 << bits)).sum(axis=1).astype(np.uint16)
        centres = self.origin + (np.column_stack((columns, rows)) + 0.5) * self.resolution
        nearest = np.empty(len(centres), dtype=np.int64)
        for start in range(0, len(centres), _CHUNK_CELLS):
            chunk = slice(start, start + _CHUNK_CELLS)
            squared = cdist(centres[chunk], lane.middle, "sqeuclidean")
            nearest[chunk] = np.argmin(squared, axis=1)
        return np.asarray(allowed[nearest])

    def cells_in(self, lanes: Iterable[Lane]) -> Bools:
        """Return (H, W): which cells have their centre in one of the lanes."""
        cells = np.zeros(self.drivable.shape, dtype=np.bool_)
        for lane in lanes:
            cells[self._cells_of_lane(lane)] = True
        return cells

    def cells_near(self, x: float, y: float, distance: float) -> Bools:
        """Return (H, W): which cells have their centre within a distance [m] of a point [m]."""
        height, width = self.drivable.shape
        dx = self.origin[0] + (np.arange(width) + 0.5) * self.resolution - x
        dy = self.origin[1] + (np.arange(height) + 0.5) * self.resolution - y
        return np.asarray(np.hypot(dx, dy[:, None]) < distance)

    def cells(self, points: Floats) -> tuple[Ints, Ints, Bools]:
        """Return rows, columns (...) of cells nearest to points (..., 2) [m]; whether inside."""
        cell = np.floor((points - self.origin) / self.resolution).astype(np.int64)
        height, width = self.drivable.shape
        column, row = np.clip(cell[..., 0], 0, width - 1), np.clip(cell[..., 1], 0, height - 1)
        return row, column, np.asarray((cell[..., 0] == column) & (cell[..., 1] == row))

    def drivable_at(self, points: Floats) -> Bools:
        """Return whether points (..., 2) [m] lie in drivable cells; none beyond the grid does."""
        row, column, inside = self.cells(points)
        return np.asarray(inside & self.drivable[row, column])
