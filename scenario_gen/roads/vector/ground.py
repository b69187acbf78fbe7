# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Nobody drives against a lane: the directions in which each cell may be driven, and a vehicle's own part of the road."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import Bools, Floats, sealed, wrap_angle
from scenario_gen.numerics.plane import angle_between
from scenario_gen.roads.clearance import clearance_field, footprint_fits
from scenario_gen.roads.vector.raster import covered, without_slits
from scenario_gen.types import Lane, once_per_object, Road, Vehicle

_BINS = 16  # of directions
_ALLOWED = (
    np.pi / 2.0 + np.pi / _BINS
)  # a pose turned from a lane by more drives against it; the bins' width leaves half a bin open
_ALL = np.uint16(0xFFFF)
_ALONG = np.radians(60.0)  # a path uses a lane from whose direction it is turned by less
_AT_ONCE = 4096  # cells
_KERB = 1.0  # metres beyond its own lanes that a vehicle's footprint may reach


@once_per_object
def directions(road: Road) -> npt.NDArray[np.uint16]:
    """Return (H, W): bit k of a cell says whether one may drive there in direction k · 22.5°; all bits where no lane lies.

    Several lanes may lie in a cell, as in a junction; each allows what differs from it by at most 90°.
    """
    directions = np.zeros(road.drivable.shape, dtype=np.uint16)
    for lane in road.map_lanes.lanes if road.map_lanes is not None else ():
        rows, columns = _cells(road, lane)
        directions[rows, columns] |= _bits(road, lane, rows, columns)
    directions[directions == 0] = _ALL
    return sealed(directions)


def _cells(road: Road, lane: Lane) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    first = np.round(road.origin / road.resolution).astype(np.int64)
    corner, inside = covered(lane.outline, road.resolution, first, road.drivable.shape)
    rows, columns = np.nonzero(inside)
    return rows + corner[1], columns + corner[0]


def _bits(
    road: Road, lane: Lane, rows: npt.NDArray[np.int64], columns: npt.NDArray[np.int64]
) -> npt.NDArray[np.uint16]:
    """The directions that a lane allows in its cells, by the section that is nearest to each."""
    k = np.arange(_BINS)
    near = np.abs(wrap_angle(2.0 * np.pi * k / _BINS - lane.yaw[:, None])) <= _ALLOWED
    allowed = (near * (1 << k)).sum(axis=1).astype(np.uint16)
    middle = lane.middle
    points = road.origin + (np.column_stack((columns, rows)) + 0.5) * road.resolution
    nearest = np.empty(len(points), dtype=np.int64)
    for part in range(0, len(points), _AT_ONCE):
        some = points[part : part + _AT_ONCE]
        away = np.square(some[:, None, 0] - middle[:, 0]) + np.square(
            some[:, None, 1] - middle[:, 1]
        )
        nearest[part : part + _AT_ONCE] = np.argmin(away, axis=1)
    return np.asarray(allowed[nearest])


def drives_against(road: Road, position: Floats, heading: Floats) -> Bools:
    """Return whether poses, (..., 2) [m] and (...) [rad], are driven against all lanes that lie there."""
    row, column, inside = road.cells(position)
    turn = np.round(heading / (2.0 * np.pi / _BINS)).astype(np.int64) % _BINS
    return np.asarray(
        inside & ((directions(road)[row, column] >> turn.astype(np.uint16)) & 1 == 0)
    )


def ground_for(road: Road, vehicle: Vehicle) -> Road:
    """Return where a road user may be: on the lanes of its type, and what else is drivable of the road.

    Who walks may be also off the lanes, on kerbs and beside the road, but not in obstacles. A road without lanes does not tell a
    kerb from a wall: there all keep to drivable cells.

    Raises:
        RefusedError: all lanes are closed to its type.
    """
    if road.lanes is None:
        return road
    if vehicle.kind.walks:
        return _walkable(road)
    return _open_to(road, vehicle.kind.lane_user) or road


@once_per_object
def _open_to(road: Road, users: frozenset[str]) -> Road | None:
    """The road with the lanes of some users, without those that are closed to them; None: these are its own."""
    assert road.lanes is not None
    network = road.lanes.open_to(users)
    if network is road.lanes:
        return None
    if not network.lanes:
        raise RefusedError(
            f"all lanes of road {road.name} are closed to a {', '.join(users)}; choose another road"
        )
    closed = cells_of(road, [lane for lane in road.lanes.lanes if not lane.open_to(users)])
    drivable = without_slits((road.drivable & ~closed) | cells_of(road, network.lanes))
    blocked = np.zeros_like(drivable) if road.obstructed is None else road.obstructed
    return replace(road, drivable=drivable & ~blocked, lanes=network)


def cells_of(road: Road, lanes: Iterable[Lane]) -> Bools:
    """Return (H, W) which cells of a road lie in some lanes."""
    cells = np.zeros(road.drivable.shape, dtype=np.bool_)
    for lane in lanes:
        cells[_cells(road, lane)] = True
    return cells


@once_per_object
def _walkable(road: Road) -> Road:
    """A road on which all cells but those of obstacles are drivable, without lanes."""
    blocked = (
        np.zeros(road.drivable.shape, dtype=np.bool_)
        if road.obstructed is None
        else road.obstructed
    )
    return replace(road, drivable=~blocked, lanes=None)


def own_ground(road: Road, path: Floats, vehicle: Vehicle) -> Road:
    """Return the part of a road on which a vehicle keeps to its side: its own lanes, those beside them, and a metre more.

    Args:
        road: with or without lanes.
        path: (M, 3) x, y [m], yaw [rad] of its fitted path; its own lanes are those along which it lies.
        vehicle: where its footprint has no room at the path's ends, it keeps the whole road.
    """
    if road.map_lanes is None or not len(path):
        return road
    lanes = road.map_lanes.lanes
    own = {k for k, lane in enumerate(lanes) if on_lane(lane, path, 2)}
    own |= {other for k in own for other in lanes[k].beside}
    cells = cells_of(road, (lanes[k] for k in sorted(own)))
    if not cells.any():
        return road
    away = (
        clearance_field(replace(road, drivable=~cells, lanes=None))
        if not cells.all()
        else np.zeros(cells.shape)
    )
    part = replace(road, drivable=road.drivable & (cells | (away <= _KERB)))
    ends = path[[0, -1]]
    return part if footprint_fits(part, ends, vehicle.length, vehicle.width).all() else road


def along_lanes(road: Road, poses: Floats) -> Bools:
    """Return (M,) whether poses (M, 3) x, y [m], yaw [rad] lie in a lane about its way; everywhere, on a road without lanes."""
    along = np.full(len(poses), road.map_lanes is None)
    for lane in road.map_lanes.lanes if road.map_lanes is not None else ():
        near = ~along & _in_box(lane, poses)
        along[near] = _along(lane, poses[near])
    return along


def on_lane(lane: Lane, poses: Floats, every: int = 1) -> bool:
    """Return whether one of `every` so many poses (M, 3) x, y [m], yaw [rad] about a lane lies in it, about its way."""
    return bool(_along(lane, poses[_in_box(lane, poses)][::every]).any())


def _in_box(lane: Lane, poses: Floats) -> Bools:
    """Whether poses (M, 3) lie in the box about a lane."""
    low, high = lane.outline.min(axis=0), lane.outline.max(axis=0)
    return np.asarray(((poses[:, :2] >= low) & (poses[:, :2] <= high)).all(axis=1))


def _along(lane: Lane, poses: Floats) -> Bools:
    """Whether poses (M, 3) in the box about a lane lie in it, about its way."""
    along = np.zeros(len(poses), dtype=np.bool_)
    half = np.hypot(*(lane.left - lane.right).T)[:-1] / 2.0
    for row, (x, y, heading) in enumerate(poses.tolist()):
        away = np.hypot(lane.middle[:, 0] - x, lane.middle[:, 1] - y)
        k = int(np.argmin(away))
        along[row] = away[k] <= half[k] and abs(angle_between(lane.yaw[k], heading)) < _ALONG
    return along
