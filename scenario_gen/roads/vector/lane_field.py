# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The distance of every pose on a map from the nearest lane of its direction."""

from collections.abc import Sequence
from dataclasses import dataclass
import math

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import Counts, Floats, Ints, unit, wrap_angle
from scenario_gen.numerics.kernels import F, F1, F2, kernel, N2, OUT2
from scenario_gen.types import Lane, LaneNetwork

_MAX_FIELD_CELLS = 30_000_000  # of a map; a larger one gets larger cells
_MAX_SECTIONS_COUNT = 300_000  # a metre of lane each, of a map that is searched as a whole
_CHUNK_ROWS = 20_000  # sections that are rasterised at once
_MAX_FIELD_DISTANCE_M = 4.0  # beyond which a pose counts as off the road
_DIRECTION_COUNT = 16
_MAX_LANE_TURN_RAD = math.radians(35.0)  # between a pose and its lane
_NUDGE_CELLS = 1e-6  # puts a pose on the edge of two cells into the same one on every CPU


def lane_sections(lanes: Sequence[Lane], every: int = 1) -> tuple[Floats, Floats]:
    """Return the middles (P, 2) [m] and directions (P,) [rad] of every n-th section of lanes."""
    middles = np.concatenate([lane.middle[::every] for lane in lanes])
    return middles, np.concatenate([lane.yaw[::every] for lane in lanes])


@dataclass(frozen=True, eq=False)
class LaneField:
    """The distance of every cell of a map from the nearest lane of each direction.

    Attributes:
        low: (2,) [m] the lower-left corner of the grid.
        cell: [m] size of its cells.
        rows: (H, W) the row of `distance` of each cell.
        distance: (C + 1, 16) [m], at most `_MAX_FIELD_DISTANCE_M`; the last row is off the road.
    """

    low: Floats
    cell: float
    rows: Counts
    distance: Floats

    @classmethod
    def of(cls, network: LaneNetwork) -> "LaneField":
        """Return the field of a network.

        Raises:
            RefusedError: the map is too large.
        """
        points, yaws = lane_sections(network.lanes)
        if len(points) > _MAX_SECTIONS_COUNT:
            raise RefusedError(
                f"map {network.name} has {len(points)} sections of lanes; at most "
                f"{_MAX_SECTIONS_COUNT} are searched for a place: choose a part with "
                "#box=x0,y0,x1,y1"
            )
        low = points.min(axis=0) - _MAX_FIELD_DISTANCE_M
        high = points.max(axis=0) + _MAX_FIELD_DISTANCE_M
        cell = max(1.0, math.sqrt(float(np.prod(high - low)) / _MAX_FIELD_CELLS))
        size = np.ceil((high - low) / cell).astype(np.int64) + 1
        chunks = [slice(k, k + _CHUNK_ROWS) for k in range(0, len(points), _CHUNK_ROWS)]

        near_lanes = np.zeros(int(size[0] * size[1]), dtype=np.bool_)
        for chunk in chunks:
            near_lanes[_cells_around(points[chunk], low, cell, size)[1]] = True
        known = np.flatnonzero(near_lanes)
        rows = np.full(len(near_lanes), len(known), dtype=np.int32)
        rows[known] = np.arange(len(known))

        table = np.full((len(known) + 1, _DIRECTION_COUNT), _MAX_FIELD_DISTANCE_M)
        for chunk in chunks:
            distance, flat = _cells_around(points[chunk], low, cell, size)
            row = rows[flat]
            for k in range(_DIRECTION_COUNT):
                turn = np.abs(wrap_angle(yaws[chunk] - 2.0 * np.pi * k / _DIRECTION_COUNT))
                alike = turn <= _MAX_LANE_TURN_RAD
                np.minimum.at(table[:, k], row[alike].ravel(), distance[alike].ravel())
        return cls(low, cell, rows.reshape(size[::-1]), table)

    def squared(self, frames: Floats, poses: Floats) -> Floats:
        """Return the squared distances (M, P) [m²] of poses from the nearest lanes.

        Args:
            frames: (M, 3) x, y [m], yaw [rad] of the frames of the poses.
            poses: (P, 3) the same of the poses.
        """
        squared = np.empty((len(frames), len(poses)))
        _fill_squared(
            frames,
            unit(frames[:, 2]),
            poses,
            self.low,
            self.cell,
            self.rows,
            self.distance,
            squared,
        )
        return squared


@kernel(F2, F2, F2, F1, F, N2, F2, OUT2)
def _fill_squared(
    frames: Floats,
    ahead: Floats,
    poses: Floats,
    low: Floats,
    cell: float,
    rows: Counts,
    distance: Floats,
    out: Floats,
) -> None:
    """Fill `out` as `LaneField.squared`; `ahead` (M, 2) are the unit vectors of the frames."""
    sector = 2.0 * math.pi / _DIRECTION_COUNT
    for i in range(len(frames)):
        cos, sin = ahead[i, 0], ahead[i, 1]
        for k in range(len(poses)):
            x = frames[i, 0] + poses[k, 0] * cos - poses[k, 1] * sin
            y = frames[i, 1] + poses[k, 0] * sin + poses[k, 1] * cos
            column = math.floor((x - low[0]) / cell + _NUDGE_CELLS)
            line = math.floor((y - low[1]) / cell + _NUDGE_CELLS)
            row = len(distance) - 1
            if 0 <= column < rows.shape[1] and 0 <= line < rows.shape[0]:
                row = rows[line, column]
            direction = round((poses[k, 2] + frames[i, 2]) / sector + _NUDGE_CELLS)
            out[i, k] = distance[row, direction % _DIRECTION_COUNT] ** 2


def _cells_around(points: Floats, low: Floats, cell: float, size: Ints) -> tuple[Floats, Ints]:
    """Return the distances [m] and flat indices (P, O) of the cells around points (P, 2) [m]."""
    reach = math.ceil(_MAX_FIELD_DISTANCE_M / cell)
    steps = np.arange(-reach, reach + 1)
    offsets = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    at = np.floor((points - low) / cell).astype(np.int64)
    cells = np.clip(at[:, None] + offsets, 0, size - 1)
    centres = low + (cells + 0.5) * cell
    distance = np.hypot(centres[..., 0] - points[:, None, 0], centres[..., 1] - points[:, None, 1])
    return distance, cells[..., 1] * size[0] + cells[..., 0]
