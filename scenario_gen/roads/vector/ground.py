# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The ground of lanes: drivable cells, and the road that they make."""

from dataclasses import replace

import numpy as np
from scipy.spatial.distance import cdist
import shapely
from shapely.geometry.base import BaseGeometry

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import Bools, Floats, wrap_angle
from scenario_gen.numerics.polygons import fill_slits, polygon_cells
from scenario_gen.roads.clearance import footprint_fits
from scenario_gen.roads.config import refuse_too_many_cells, RoadConfig
from scenario_gen.roads.vector.network import lane_ends
from scenario_gen.types import Lane, LaneNetwork, Road, Vehicle
from scenario_gen.types.road import DIRECTION_COUNT

_MAX_TURN_FROM_LANE_RAD = np.radians(60.0)
_KERB_M = 1.0  # by which a vehicle's footprint may leave its lanes


def drives_against(road: Road, position: Floats, heading: Floats) -> Bools:
    """Return whether poses, (..., 2) [m] and (...) [rad], oppose all lanes that lie there."""
    row, column, inside = road.cells(position)
    sector = np.round(heading / (2.0 * np.pi / DIRECTION_COUNT)).astype(np.int64)
    bit = (sector % DIRECTION_COUNT).astype(np.uint16)
    return np.asarray(inside & ((road.lane_directions[row, column] >> bit) & 1 == 0))


def ground_for(road: Road, vehicle: Vehicle) -> Road:
    """Return the part of a road where a road user may be: the lanes of its type, and open space.

    Pedestrians may also leave the lanes, but not enter obstacles. A road without lanes does not
    tell a kerb from a wall, so all users keep to its drivable cells.

    Raises:
        RefusedError: all lanes are closed to the vehicle's type.
    """
    if road.lanes is None:
        return road
    if vehicle.kind.walks:
        return road.walkable
    users = vehicle.kind.lane_user
    if users <= road.lanes.users_of_car_lanes:
        return road
    (user,) = users
    if user not in road.grounds:
        raise RefusedError(
            f"all lanes of road {road.name} are closed to a {user}; choose another road"
        )
    return road.grounds[user]


def own_side(road: Road, path: Floats, vehicle: Vehicle, network: LaneNetwork | None) -> Road:
    """Return the side of a road that a vehicle uses.

    These are the lanes along which its path lies, those of the same direction next to them, and a
    kerb.

    Args:
        road: the road.
        path: (M, 3) x, y [m], yaw [rad].
        vehicle: if its footprint has no room at the path's ends, it gets the whole road.
        network: its lanes; None: the whole road.
    """
    if network is None or not len(path):
        return road
    lanes = network.lanes
    driven = {k for k, lane in enumerate(lanes) if on_lane(lane, path, every=2)}
    driven |= {neighbour for k in driven for neighbour in lanes[k].neighbours}
    cells = road.cells_in(lanes[k] for k in sorted(driven))
    if not cells.any():
        return road
    near = cells
    if not cells.all():
        from_lane = replace(road, drivable=~cells, lanes=None).clearance_cells
        near = cells | (from_lane * road.resolution <= _KERB_M)
    part = replace(road, drivable=road.drivable & near)
    ends = path[[0, -1]]
    return part if footprint_fits(part, ends, vehicle.length, vehicle.width).all() else road


def along_lanes(road: Road, poses: Floats) -> Bools:
    """Return (M,) whether poses (M, 3) x, y [m], yaw [rad] lie in a lane of about their direction.

    On a road without the lanes of a map, all do.
    """
    if road.map_lanes is None:
        return np.ones(len(poses), dtype=np.bool_)
    along = np.zeros(len(poses), dtype=np.bool_)
    for lane in road.map_lanes.lanes:
        near = ~along & _in_bounding_box(lane, poses)
        along[near] = _lies_along(lane, poses[near])
    return along


def on_lane(lane: Lane, poses: Floats, every: int = 1) -> bool:
    """Return whether any of the poses (M, 3) x, y [m], yaw [rad] lies in a lane, along it.

    Only every n-th pose in the lane's bounding box is looked at.
    """
    near = poses[_in_bounding_box(lane, poses)][::every]
    return len(near) > 0 and bool(_lies_along(lane, near).any())


def _in_bounding_box(lane: Lane, poses: Floats) -> Bools:
    low, high = lane.box
    return np.asarray(((poses[:, :2] >= low) & (poses[:, :2] <= high)).all(axis=1))


def _lies_along(lane: Lane, poses: Floats) -> Bools:
    """Return whether poses (M, 3) in a lane's bounding box lie in the lane, in its direction."""
    distance = cdist(poses[:, :2], lane.middle)
    nearest = distance.argmin(axis=1)
    turn = np.abs(wrap_angle(lane.yaw[nearest] - poses[:, 2]))
    inside = distance.min(axis=1) <= lane.width[nearest] / 2.0
    return np.asarray(inside & (turn < _MAX_TURN_FROM_LANE_RAD))


VERGE_M = 2.0
"""Around all lanes, at the border of a grid."""


def road_of(
    network: LaneNetwork, box: Floats | None, config: RoadConfig, paved: BaseGeometry | None = None
) -> Road:
    """Draw the part of a network that lies in a box.

    Args:
        network: its lanes end at the box.
        box: (2, 2) [m] lowest and highest x, y; None: all lanes and a verge.
        config: cell size and the most cells.
        paved: other drivable ground [m].

    Raises:
        RefusedError: it has more than `max_cells` cells.
    """
    cell_size = float(np.float32(config.resolution))
    low, high = network.box + np.array([[-VERGE_M], [VERGE_M]]) if box is None else box
    first = np.floor(low / cell_size).astype(np.int64)
    last = np.ceil(high / cell_size - 1e-9).astype(np.int64)
    width, height = (last - first).tolist()
    refuse_too_many_cells(network.name, width, height, config)

    parts = shapely.get_parts(paved).tolist() if paved is not None else []
    outlines = [(part.exterior.coords, True) for part in parts]
    outlines += [(hole.coords, False) for part in parts for hole in part.interiors]
    outlines += [(lane.outline, True) for lane in network.lanes]
    drivable = np.zeros((height, width), dtype=np.bool_)
    for outline, is_road in outlines:
        cells = polygon_cells(np.asarray(outline), cell_size, first, drivable.shape)
        drivable[cells] = is_road

    entries, exits = lane_ends(network)
    return Road(
        name=network.name,
        drivable=fill_slits(drivable),
        resolution=cell_size,
        origin=first * cell_size,
        entries=entries,
        exits=exits,
        lanes=network if network.lanes else None,
    )
