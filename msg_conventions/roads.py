# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Road ⇄ `map` (nav_msgs/OccupancyGrid) and `road/lanes` (std_msgs/String, documents.py).

Map: 0 free, 100 occupied, 99 occupied by an obstacle on the road, -1 unknown; a known cell below
65 (nav2's occupied threshold) is drivable. `info.origin` is the lower-left corner of cell (0, 0),
not rotated; row 0 has the lowest y. `road/lanes` has all else: `RoadDescription` in JSON. Entries
and exits are also on `road/entries` and `road/exits` (PoseArray) for others. Stamp: that of the
road's template, or 0 for any template. QoS: reliable, transient_local, depth 1. The road's name is
not in the messages, because nothing is computed from it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np

from msg_conventions.cdr import decode, encode
from msg_conventions.documents import decode_document, encode_document, hash_of, LANES
from msg_conventions.layouts import MAP, POSES
from msg_conventions.poses import check_quaternions, MAX_COORDINATE_M, pose_rows, yaw
from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Floats, Ints
from scenario_gen.types import LaneNetwork, Road

MAP_TYPE = "nav_msgs/msg/OccupancyGrid"
POSES_TYPE = "geometry_msgs/msg/PoseArray"
OCCUPIED_CODE = 100
OBSTACLE_CODE = 99
OCCUPIED_THRESHOLD_PERCENT = 65


@dataclass(frozen=True, eq=False)
class RoadDescription:
    """What a map lacks.

    Attributes:
        stamp: of the map [ns].
        frame_id: of all positions.
        inputs: the hash of the map by its topic (documents.py).
        entries: (E, 3) x [m], y [m], yaw [rad] into the road.
        exits: (X, 3) out of it.
        lanes: those of all users, cars' lanes first; None: nothing is known of lanes.
    """

    stamp: int
    frame_id: str
    inputs: Mapping[str, str]
    entries: Floats
    exits: Floats
    lanes: LaneNetwork | None = None


def encode_map(road: Road, stamp_ns: int) -> bytes:
    """Return the grid as CDR bytes."""
    cells = np.where(road.drivable, 0, OCCUPIED_CODE)
    if road.obstructed is not None:
        cells[road.obstructed] = OBSTACLE_CODE
    return encode_grid(cells, road.resolution, road.origin, road.frame_id, stamp_ns)


def encode_grid(
    cells: Ints, resolution: float, origin: Floats, frame_id: str, stamp_ns: int
) -> bytes:
    """Return cells (H, W) from 0 to 100 or -1 as an OccupancyGrid.

    `resolution` is their size [m], `origin` (2,) the lower-left corner [m].
    """
    height, width = cells.shape
    return encode(
        MAP,
        stamp=stamp_ns,
        frame_id=frame_id,
        load_time=stamp_ns,
        resolution=resolution,
        size=(width, height),
        origin=(*origin, 0.0, 0.0, 0.0, 0.0, 1.0),
        cells=cells.astype(np.int8).reshape(-1),
    )


def encode_poses(poses: Floats, frame_id: str, stamp_ns: int) -> bytes:
    """Return entries or exits, (M, 3) x, y, yaw, as CDR bytes."""
    return encode(POSES, stamp=stamp_ns, frame_id=frame_id, poses=pose_rows(poses))


def encode_description(road: Road, grid: bytes, stamp_ns: int) -> bytes:
    """Return the description of a road, whose map is `grid`, as CDR bytes."""
    lanes = None if road.lanes is None else road.lanes.whole
    inputs = {"map": hash_of("map", grid)}
    return encode_document(
        RoadDescription(stamp_ns, road.frame_id, inputs, road.entries, road.exits, lanes)
    )


def road_messages(road: Road, stamp_ns: int) -> dict[str, bytes]:
    """Return the messages of a road by topic."""
    grid = encode_map(road, stamp_ns)
    return {
        "map": grid,
        "road/entries": encode_poses(road.entries, road.frame_id, stamp_ns),
        "road/exits": encode_poses(road.exits, road.frame_id, stamp_ns),
        LANES: encode_description(road, grid, stamp_ns),
    }


def decode_description(data: bytes, source: str = LANES) -> RoadDescription:
    """Return the description of a road.

    Raises:
        InputError: the message is damaged, its lanes are impossible, or a point is too far away.
    """
    road = decode_document(RoadDescription, data, source)
    lanes = road.lanes.every_lane if road.lanes is not None else ()
    for points in (road.entries, road.exits, *(lane.outline for lane in lanes)):
        if not (np.abs(points) <= MAX_COORDINATE_M).all():
            raise InputError(
                f"{source}: a point is not finite or more than {MAX_COORDINATE_M:g} m away"
            )
    return road


def decode_map(
    data: bytes, description: bytes | None = None, name: str = "map"
) -> tuple[int, Road]:
    """Return the stamp [ns] and the road.

    A road from a plain map server lacks a description.

    Raises:
        InputError: a message is damaged, the map is rotated or empty, or the frames disagree.
    """
    message = decode(MAP, data, name, framed=True)
    _check_grid(message, name)
    frame_id = message.frame_id
    width, height = message.size.tolist()
    cells = message.cells.reshape(height, width)

    road = RoadDescription(message.stamp, frame_id, {}, np.zeros((0, 3)), np.zeros((0, 3)))
    if description is not None:
        road = decode_description(description)
    if road.frame_id != frame_id:
        raise InputError(f"{LANES}: frame {road.frame_id!r} is not the map's ({frame_id!r})")
    network = None if road.lanes is None else road.lanes.with_lanes(road.lanes.lanes)

    drivable = (cells >= 0) & (cells < OCCUPIED_THRESHOLD_PERCENT)
    obstructed = cells == OBSTACLE_CODE
    return message.stamp, Road(
        name,
        drivable,
        message.resolution,
        message.origin[:2],
        road.entries,
        road.exits,
        frame_id,
        network,
        obstructed if obstructed.any() else None,
    )


def _check_grid(message: SimpleNamespace, name: str) -> None:
    """Raise InputError if the cells do not match their size, or the origin cannot be used."""
    origin = message.origin
    width, height = message.size.tolist()
    check_quaternions(origin[3:], f"{name}: info.origin")
    if width * height != len(message.cells):
        raise InputError(
            f"{name}: {width} x {height} cells are announced, {len(message.cells)} are there"
        )
    if not np.isfinite(origin).all() or abs(float(yaw(origin[3:]))) > 1e-9:
        raise InputError(f"{name}: info.origin must be finite and not rotated")
    distance = float(np.abs(origin[:3]).max())
    if distance > MAX_COORDINATE_M:
        raise InputError(
            f"{name}: info.origin is {distance:g} m away; at most {MAX_COORDINATE_M:g} is read"
        )
