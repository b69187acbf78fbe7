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

from msg_conventions.cdr import CdrReader, CdrWriter
from msg_conventions.lanes import decode_lanes
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


def encode_map(road: Road, stamp_ns: int) -> bytes:
    """Return the grid as CDR bytes."""
    cells = np.where(road.drivable, 0, OCCUPIED)
    if road.obstructed is not None:
        cells[road.obstructed] = OBSTRUCTED
    return encode_grid(cells, road.resolution, road.origin, road.frame_id, stamp_ns)


def encode_grid(cells: Ints, resolution: float, origin: Floats, frame_id: str, stamp_ns: int) -> bytes:
    """Return cells (H, W) of 0 to 100 or -1, with their size and the lower-left corner (2,) [m], as an OccupancyGrid."""
    height, width = cells.shape
    writer = CdrWriter().header(stamp_ns, frame_id).stamp(stamp_ns).pack("f", resolution).pack("I", width, height)
    writer.pack("d", *origin, 0.0, 0.0, 0.0, 0.0, 1.0).pack("I", cells.size)
    return writer.raw(cells.astype(np.int8).tobytes()).finish()


def encode_poses(poses: Floats, frame_id: str, stamp_ns: int) -> bytes:
    """Return entries or exits, (M, 3) x, y, yaw, as CDR bytes."""
    writer = CdrWriter().header(stamp_ns, frame_id).pack("I", len(poses))
    return (writer.align(8).raw(pose_rows(poses).tobytes()) if len(poses) else writer).finish()


def decode_poses(data: bytes, what: str = "poses") -> tuple[int, str, Floats]:
    """Return stamp [ns], frame and (M, 3) x, y, yaw.

    Raises:
        InputError: the message is damaged.
    """
    reader = CdrReader(data, what)
    stamp_ns, frame_id = reader.framed_header()
    count = reader.count(56)
    return stamp_ns, frame_id, poses_of(reader.floats(7 * count).reshape(count, 7), what)


def decode_map(
    data: bytes, entries: bytes | None = None, exits: bytes | None = None, lanes: bytes | None = None, name: str = "map"
) -> tuple[int, Road]:
    """Return the stamp [ns] and the road; without entries, exits and lanes it has none (a plain map server sends none).

    Raises:
        InputError: the message is damaged, the map is rotated or empty, or the frames disagree.
    """
    reader = CdrReader(data, name)
    stamp_ns, frame_id = reader.framed_header()
    reader.stamp()
    resolution, width, height = float(reader.one("f")), reader.number(), reader.number()
    origin = reader.floats(7)
    cells = reader.array(np.int8, reader.count(), 1)
    check_quaternions(origin[3:], f"{name}: info.origin")
    if width * height != len(cells):
        raise InputError(f"{name}: {width} x {height} cells are announced, {len(cells)} are there")
    if not np.isfinite(origin).all() or abs(float(yaw(origin[3:]))) > 1e-9:
        raise InputError(f"{name}: info.origin must be finite and not rotated")
    if (np.abs(origin[:3]) > FARTHEST).any():
        raise InputError(f"{name}: info.origin is {np.abs(origin[:3]).max():g} m away; at most {FARTHEST:g} is read")
    ends: list[Floats] = []
    for what, poses in (("road/entries", entries), ("road/exits", exits)):
        if poses is None:
            ends.append(np.zeros((0, 3)))
            continue
        _, frame, values = decode_poses(poses, what)
        if frame != frame_id:
            raise InputError(f"{what}: frame {frame!r} is not the map's ({frame_id!r})")
        ends.append(values)
    frame, network = (frame_id, None) if lanes is None else decode_lanes(lanes)
    if frame != frame_id:
        raise InputError(f"road/lanes: frame {frame!r} is not the map's ({frame_id!r})")
    road = Road(
        name=name,
        drivable=((cells >= 0) & (cells < OCCUPIED_FROM)).reshape(height, width),
        obstructed=(cells == OBSTRUCTED).reshape(height, width) if (cells == OBSTRUCTED).any() else None,
        resolution=resolution,
        origin=origin[:2],
        entries=ends[0],
        exits=ends[1],
        frame_id=frame_id,
        lanes=network,
    )
    return stamp_ns, road
