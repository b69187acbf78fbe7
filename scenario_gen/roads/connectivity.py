# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Which parts of a road a disc can reach from which.

Cells whose centre has more clearance than the disc's radius are joined to their four neighbours.
Between two such centres the clearance is nowhere less than at one of them, because a square's
profile is flat for half a cell to either side of its middle. So every step is a move that the disc
can really make, and two cells of one component are connected by a path.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy import ndimage

from scenario_gen.numerics import Floats, Ints, sealed
from scenario_gen.roads.clearance import segments_free, to_metres
from scenario_gen.types import Road


@dataclass(frozen=True, eq=False)
class FreeSpace:
    """Where the centre of a disc with `radius` [m] can be on a road; `free_space` keeps it."""

    road: Road
    radius: float

    @cached_property
    def labels(self) -> Ints:
        """(H, W): the connected component of each cell, 1, 2, …; 0 where the centre cannot be."""
        free = self.road.clearance_cells > self.radius / self.road.resolution
        return sealed(ndimage.label(free)[0].astype(np.int64))

    def component_at(self, xy: Floats) -> int:
        """Return the component that the disc at `xy` (2,) [m] can move to.

        It is 0 if the disc collides or is walled in.
        """
        return next(self._reachable(np.asarray(xy, dtype=np.float64)), 0)

    def common_component(self, start_xy: Floats, goal_xy: Floats) -> int | None:
        """Return the component by which the disc can move from start (2,) [m] to goal (2,) [m].

        Returns:
            Its label; 0 if there is none, but the straight segment is free; None if no path is
            known.
        """
        first, last = self.component_at(start_xy), self.component_at(goal_xy)
        if first == last > 0:
            return first
        start = np.asarray(start_xy, dtype=np.float64)
        goal = np.asarray(goal_xy, dtype=np.float64)
        if segments_free(self.road, start[None], goal[None], self.radius)[0]:
            return first or last
        near_goal = set(self._reachable(goal))
        return next((label for label in self._reachable(start) if label in near_goal), None)

    def _reachable(self, xy: Floats) -> Iterator[int]:
        """Yield the labels of nearby cell centres that a straight move reaches, nearest first."""
        height, width = self.labels.shape
        column, row = np.floor((xy - self.road.origin) / self.road.resolution).astype(int)
        i, j = np.mgrid[row - 2 : row + 3, column - 2 : column + 3].reshape(2, -1)
        inside = (i >= 0) & (j >= 0) & (i < height) & (j < width)
        i, j = i[inside], j[inside]
        i, j = i[self.labels[i, j] > 0], j[self.labels[i, j] > 0]
        centres = to_metres(self.road, np.stack((j + 0.5, i + 0.5), axis=-1))
        starts = np.broadcast_to(xy, centres.shape)
        free = segments_free(self.road, starts, centres, self.radius)
        for k in np.argsort(np.hypot(*(centres - xy).T), kind="stable"):
            if free[k]:
                yield int(self.labels[i[k], j[k]])


@lru_cache(maxsize=4)  # the queries on one road have few radii
def free_space(road: Road, radius: float) -> FreeSpace:
    """Return the free space of a disc with `radius` [m]; queries of one road share it."""
    return FreeSpace(road, radius)


@lru_cache(maxsize=4)
def free_cells(space: FreeSpace, label: int) -> Ints:
    """Return the flat indices (n,) of the cells in one component, ascending."""
    return sealed(np.flatnonzero(space.labels == label))
