# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A drive in closed loop ⇄ messages: what the node `traffic` says of all vehicles, and what is asked of the ego.

Out, at every step; stamp: the drive's time (that of /clock), frame: the road's:

- `vehicle_<id>/odom` (nav_msgs/Odometry): child frame `vehicle_<id>`, the centre of the footprint, x ahead; twist in that frame,
  linear.x the speed [m/s], angular.z the yaw rate [rad/s]. All vehicles, the ego too. QoS: reliable, volatile, depth 100.
- `traffic/markers` (visualization_msgs/MarkerArray): a box for each, which replaces the one before; the ego's is black.
- `traffic/local_map` (nav_msgs/OccupancyGrid): what is drivable around the ego, with the other vehicles in it. Depth 1.
- /clock (rosgraph_msgs/Clock), /tf (frames.py), `verdicts` (diagnostic_msgs/DiagnosticArray), `ego/goal`, `ego/route`.

In, for the ego; a stamp of 0 is "now":

- `ego/cmd_vel` (geometry_msgs/Twist), `ego/cmd_vel_stamped` (TwistStamped): linear.x [m/s] to be reached as fast as the body can,
  angular.z [rad/s].
- `ego/trajectory` (trajectory_msgs/MultiDOFJointTrajectory, conventions: trajectory.py), `ego/path` (nav_msgs/Path, the stamp of
  each pose is its time): where the ego is to be when; the body tracks it.
- `ego/odom` (nav_msgs/Odometry): where the ego is, by another simulator.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from msg_conventions.cdr import CdrReader, CdrWriter
from msg_conventions.pictures import COLOURS, CUBE, DELETE_ALL
from msg_conventions.roads import OCCUPIED, pose_rows, poses_of
from msg_conventions.trajectory import decode
from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Bools, Floats
from scenario_gen.types import tokens, Vehicle

TWIST_TYPE, ODOMETRY_TYPE, CLOCK_TYPE = "geometry_msgs/msg/Twist", "nav_msgs/msg/Odometry", "rosgraph_msgs/msg/Clock"
_COVARIANCE = 36


@dataclass(frozen=True, eq=False)
class Way:
    """Where the ego is to be when: (T,) nanoseconds on the drive's clock, (T, 3) x, y [m], yaw [rad] in `frame_id`."""

    time_ns: Floats
    poses: Floats
    frame_id: str


def encode_clock(stamp_ns: int) -> bytes:
    """Return a Clock as CDR bytes."""
    return CdrWriter().stamp(stamp_ns).finish()


def encode_odometry(state: Floats, yaw_rate: float, child: str, frame_id: str, stamp_ns: int) -> bytes:
    """Return a state (4,) of x [m], y [m], yaw [rad], speed [m/s] and the yaw rate [rad/s] as an Odometry's CDR bytes."""
    writer = CdrWriter().header(stamp_ns, frame_id).string(child)
    writer.pack("d", *pose_rows(state[None, :3])[0], *[0.0] * _COVARIANCE)
    return writer.pack("d", float(state[3]), 0.0, 0.0, 0.0, 0.0, yaw_rate, *[0.0] * _COVARIANCE).finish()


def decode_odometry(data: bytes, what: str = "ego/odom") -> tuple[int, str, Floats]:
    """Return stamp [ns], frame and (5,) x [m], y [m], yaw [rad], speed [m/s], yaw rate [rad/s] of an Odometry.

    Raises:
        InputError: the message is damaged, or a value is not finite.
    """
    reader = CdrReader(data, what)
    stamp_ns, frame_id = reader.header()
    reader.string()
    row = reader.floats(7 + _COVARIANCE)
    twist = reader.floats(6 + _COVARIANCE)
    if not np.isfinite(twist[:6]).all():
        raise InputError(f"{what}: the twist holds a value that is not finite")
    return stamp_ns, frame_id, np.append(poses_of(row[None, :7], what)[0], (twist[0], twist[5]))


def encode_twist(speed: float, yaw_rate: float) -> bytes:
    """Return a Twist of linear.x [m/s] and angular.z [rad/s] as CDR bytes."""
    return CdrWriter().pack("d", speed, 0.0, 0.0, 0.0, 0.0, yaw_rate).finish()


def decode_twist(data: bytes, what: str = "ego/cmd_vel", *, stamped: bool = False) -> tuple[int, str, float, float]:
    """Return stamp [ns] and frame (0 and "" if not `stamped`), linear.x [m/s] and angular.z [rad/s], finite or not.

    Raises:
        InputError: the message is damaged.
    """
    reader = CdrReader(data, what)
    stamp_ns, frame_id = reader.header() if stamped else (0, "")
    values = reader.floats(6).tolist()
    return stamp_ns, frame_id, values[0], values[5]


def decode_trajectory(data: bytes, what: str = "ego/trajectory") -> Way:
    """Return the first vehicle's way of a MultiDOFJointTrajectory.

    Raises:
        InputError: the message is damaged, empty, or holds a value that is not finite.
    """
    found = decode(data, what)
    if not len(found.time_ns):
        raise InputError(f"{what} is empty")
    poses = np.column_stack([found.position[0], found.heading[0]])
    return Way((found.stamp_ns + found.time_ns).astype(np.float64), poses, found.frame_id)


def decode_timed_path(data: bytes, what: str = "ego/path") -> Way:
    """Return the way of a Path whose poses bear the times at which they are to be reached.

    Raises:
        InputError: the message is damaged or empty, a value is not finite, or the stamps do not ascend.
    """
    reader = CdrReader(data, what)
    _, frame_id = reader.header()
    stamps, rows = [], []
    for _ in range(reader.count(68)):
        stamp_ns, _ = reader.header()
        stamps.append(stamp_ns)
        rows.append(reader.floats(7))
    if not rows:
        raise InputError(f"{what} is empty")
    time = np.array(stamps, dtype=np.float64)
    if (np.diff(time) <= 0.0).any():
        raise InputError(f"{what}: the poses' stamps must ascend: they say when each pose is to be reached")
    return Way(time, poses_of(np.array(rows), what), frame_id)


def encode_local_map(blocked: Bools, resolution: float, origin: Floats, frame_id: str, stamp_ns: int) -> bytes:
    """Return a grid (H, W) of what is not free, with its cell size and lower-left corner (2,) [m], as an OccupancyGrid."""
    height, width = blocked.shape
    writer = CdrWriter().header(stamp_ns, frame_id).stamp(stamp_ns).pack("f", resolution).pack("I", width, height)
    writer.pack("d", *origin.tolist(), 0.0, 0.0, 0.0, 0.0, 1.0).pack("I", blocked.size)
    return writer.raw(np.where(blocked, OCCUPIED, 0).astype(np.int8).tobytes()).finish()


def encode_traffic_markers(
    vehicles: Sequence[Vehicle], states: Floats, here: Bools, ego: int, frame_id: str, stamp_ns: int
) -> bytes:
    """Return a box for each vehicle that is there, states (N, 3+) x, y [m], yaw [rad], in place of all boxes before."""
    names = tokens(vehicle.id for vehicle in vehicles)
    shown = np.flatnonzero(here).tolist()
    writer = CdrWriter().pack("I", 1 + len(shown))
    blank = np.zeros((1, 3))

    def add(name: str, action: int, scale: tuple[float, ...], colour: tuple[float, ...], pose: Floats) -> None:
        writer.header(stamp_ns, frame_id).string(name).pack("i", 0, CUBE, action)
        writer.pack("d", *pose_rows(pose)[0]).pack("d", *scale).pack("f", *colour).stamp(0).pack("B", 0)
        writer.pack("I", 0).pack("I", 0)  # points, colours
        writer.string("").header(0, "").string("").pack("I", 0).pack("I", 0)  # texture, uv coordinates
        writer.string("").string("").string("").pack("I", 0).pack("B", 0)  # text, mesh

    add("", DELETE_ALL, (1.0, 1.0, 1.0), (1.0, 1.0, 1.0, 1.0), blank)
    for k in shown:
        colour = (0.06, 0.09, 0.16) if k == ego else COLOURS[k % len(COLOURS)]
        add(f"box_{names[k]}", 0, (vehicles[k].length, vehicles[k].width, 1.5), (*colour, 0.9), states[k : k + 1])
    return writer.finish()
