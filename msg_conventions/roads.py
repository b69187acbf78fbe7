# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Road ⇄ `map` (nav_msgs/OccupancyGrid) and `road/entries`, `road/exits` (geometry_msgs/PoseArray).

Map: 0 free, 100 occupied, 99 occupied by an obstacle on the road, -1 unknown; a cell is drivable if it is
known and below 65 (nav2's occupied threshold).
`info.origin` is the lower-left corner of cell (0, 0), not rotated; row 0 is the lowest y. Entries head into the road, exits out
of it. Stamp: that of the template of the road, or 0 if it suits any. QoS: reliable, transient_local, depth 1.
The road's name is not in the messages: nothing is computed from it.
"""

import numpy as np

from msg_conventions.cdr import decode, encode
from msg_conventions.lanes import decode_lanes
from msg_conventions.lanes import TOPIC as LANES
from msg_conventions.layouts import MAP, POSES
from msg_conventions.poses import pose_rows, poses_of
from msg_conventions.trajectory import FARTHEST
from msg_conventions.yaw import check_quaternions, yaw
from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Floats, Ints
from scenario_gen.types import Road

MAP_TYPE = "nav_msgs/msg/OccupancyGrid"
POSES_TYPE = "geometry_msgs/msg/PoseArray"
OCCUPIED, OBSTRUCTED = 100, 99
OCCUPIED_FROM = 65
ENDS = ("road/entries", "road/exits")


def encode_map(road: Road, stamp_ns: int) -> bytes:
    """Return the grid as CDR bytes."""
    cells = np.where(road.drivable, 0, OCCUPIED)
    if road.obstructed is not None:
        cells[road.obstructed] = OBSTRUCTED
    return encode_grid(cells, road.resolution, road.origin, road.frame_id, stamp_ns)


def encode_grid(
    cells: Ints, resolution: float, origin: Floats, frame_id: str, stamp_ns: int
) -> bytes:
    """Return cells (H, W) of 0 to 100 or -1, with their size and the lower-left corner (2,) [m], as an OccupancyGrid."""
    height, width = cells.shape
    corner, size = (*origin, 0.0, 0.0, 0.0, 0.0, 1.0), (width, height)
    head = {"stamp": stamp_ns, "frame_id": frame_id, "load_time": stamp_ns}
    return encode(
        MAP,
        **head,
        resolution=resolution,
        size=size,
        origin=corner,
        cells=cells.astype(np.int8).reshape(-1),
    )


def encode_poses(poses: Floats, frame_id: str, stamp_ns: int) -> bytes:
    """Return entries or exits, (M, 3) x, y, yaw, as CDR bytes."""
    return encode(POSES, stamp=stamp_ns, frame_id=frame_id, poses=pose_rows(poses))


def decode_poses(data: bytes, what: str = "poses") -> tuple[int, str, Floats]:
    """Return stamp [ns], frame and (M, 3) x, y, yaw.

    Raises:
        InputError: the message is damaged.
    """
    found = decode(POSES, data, what, framed=True)
    return found.stamp, found.frame_id, poses_of(found.poses, what)


def decode_map(
    data: bytes,
    entries: bytes | None = None,
    exits: bytes | None = None,
    lanes: bytes | None = None,
    name: str = "map",
) -> tuple[int, Road]:
    """Return the stamp [ns] and the road; without entries, exits and lanes it has none (a plain map server sends none).

    Raises:
        InputError: the message is damaged, the map is rotated or empty, or the frames disagree.
    """
    found = decode(MAP, data, name, framed=True)
    (width, height), origin, cells, frame_id = (
        found.size.tolist(),
        found.origin,
        found.cells,
        found.frame_id,
    )
    check_quaternions(origin[3:], f"{name}: info.origin")
    if width * height != len(cells):
        raise InputError(f"{name}: {width} x {height} cells are announced, {len(cells)} are there")
    if not np.isfinite(origin).all() or abs(float(yaw(origin[3:]))) > 1e-9:
        raise InputError(f"{name}: info.origin must be finite and not rotated")
    if (np.abs(origin[:3]) > FARTHEST).any():
        raise InputError(
            f"{name}: info.origin is {np.abs(origin[:3]).max():g} m away; at most {FARTHEST:g} is read"
        )
    none = (frame_id, np.zeros((0, 3)))
    ends = [
        none if end is None else decode_poses(end, topic)[1:]
        for topic, end in zip(ENDS, (entries, exits), strict=True)
    ]
    network = (frame_id, None) if lanes is None else decode_lanes(lanes)
    for what, (frame, _) in zip((*ENDS, LANES), (*ends, network), strict=True):
        if frame != frame_id:
            raise InputError(f"{what}: frame {frame!r} is not the map's ({frame_id!r})")
    drivable = ((cells >= 0) & (cells < OCCUPIED_FROM)).reshape(height, width)
    obstructed = (
        (cells == OBSTRUCTED).reshape(height, width) if (cells == OBSTRUCTED).any() else None
    )
    (_, inward), (_, outward) = ends
    return found.stamp, Road(
        name,
        drivable,
        found.resolution,
        origin[:2],
        inward,
        outward,
        frame_id,
        network[1],
        obstructed,
    )
