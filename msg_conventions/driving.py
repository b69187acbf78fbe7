# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A run in closed loop ⇄ messages: the states that the node `traffic` publishes, and the commands to the ego.

Out, at every step; stamp: the run's time (that of /clock), frame: the road's:

- `vehicle_<id>/odom` (nav_msgs/Odometry): child frame `vehicle_<id>`, the centre of the footprint, x ahead; twist in that frame,
  linear.x the speed [m/s], angular.z the yaw rate [rad/s]. All vehicles, the ego too. QoS: reliable, volatile, depth 100.
- `traffic/markers` (visualization_msgs/MarkerArray): a box for each, which replaces the one before; the ego's is black.
- `traffic/local_map` (nav_msgs/OccupancyGrid): the drivable cells around the ego, with the other vehicles as obstacles. Depth 1.
- /clock (rosgraph_msgs/Clock), /tf (frames.py), `verdicts` (diagnostic_msgs/DiagnosticArray), `ego/goal`, `ego/route`.

In, for the ego; a stamp of 0 is "now":

- `ego/cmd_vel` (geometry_msgs/Twist), `ego/cmd_vel_stamped` (TwistStamped): linear.x [m/s] to be reached as fast as the body can,
  angular.z [rad/s].
- `ego/trajectory` (trajectory_msgs/MultiDOFJointTrajectory, conventions: trajectory.py), `ego/path` (nav_msgs/Path, the stamp of
  each pose is its time): the poses that the ego's body tracks.
- `ego/odom` (nav_msgs/Odometry): where the ego is, by another simulator.
"""

from dataclasses import dataclass

import numpy as np

from msg_conventions import trajectory
from msg_conventions.cdr import decode, encode
from msg_conventions.layouts import CLOCK, VELOCITY, VELOCITY_STAMPED
from msg_conventions.paths import read_path
from msg_conventions.poses import poses_of
from msg_conventions.roads import encode_grid, OCCUPIED
from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Bools, Floats

TWIST_TYPE, CLOCK_TYPE = "geometry_msgs/msg/Twist", "rosgraph_msgs/msg/Clock"


@dataclass(frozen=True, eq=False)
class Way:
    """Poses for the ego to track: (T,) nanoseconds on the run's clock, (T, 3) x, y [m], yaw [rad] in `frame_id`."""

    time_ns: Floats
    poses: Floats
    frame_id: str


def encode_clock(stamp_ns: int) -> bytes:
    """Return a Clock as CDR bytes."""
    return encode(CLOCK, clock=stamp_ns)


def encode_twist(speed: float, yaw_rate: float) -> bytes:
    """Return a Twist of linear.x [m/s] and angular.z [rad/s] as CDR bytes."""
    return encode(VELOCITY, twist=(speed, 0.0, 0.0, 0.0, 0.0, yaw_rate))


def decode_twist(
    data: bytes, what: str = "ego/cmd_vel", *, stamped: bool = False
) -> tuple[int, str, float, float]:
    """Return stamp [ns] and frame (0 and "" if not `stamped`), linear.x [m/s] and angular.z [rad/s], finite or not.

    Raises:
        InputError: the message is damaged.
    """
    found = decode(VELOCITY_STAMPED if stamped else VELOCITY, data, what)
    speed, _, _, _, _, yaw_rate = found.twist.tolist()
    return (found.stamp, found.frame_id, speed, yaw_rate) if stamped else (0, "", speed, yaw_rate)


def decode_trajectory(data: bytes, what: str = "ego/trajectory") -> Way:
    """Return the first vehicle's way of a MultiDOFJointTrajectory.

    Raises:
        InputError: the message is damaged, empty, or holds a value that is not finite.
    """
    found = trajectory.decode(data, what)
    if not len(found.time_ns):
        raise InputError(f"{what} is empty")
    poses = np.column_stack([found.position[0], found.heading[0]])
    return Way((found.stamp_ns + found.time_ns).astype(np.float64), poses, found.frame_id)


def decode_timed_path(data: bytes, what: str = "ego/path") -> Way:
    """Return the way of a Path whose poses bear the times at which they are to be reached.

    Raises:
        InputError: the message is damaged or empty, a value is not finite, or the stamps do not ascend.
    """
    _, frame_id, stamps, _, rows = read_path(data, what)
    if not len(rows):
        raise InputError(f"{what} is empty")
    if (np.diff(stamps) <= 0).any():
        raise InputError(
            f"{what}: the poses' stamps must ascend: they say when each pose is to be reached"
        )
    return Way(stamps.astype(np.float64), poses_of(rows, what), frame_id)


def encode_local_map(
    blocked: Bools, resolution: float, origin: Floats, frame_id: str, stamp_ns: int
) -> bytes:
    """Return cells (H, W) that are not free, with their size and the lower-left corner (2,) [m], as an OccupancyGrid."""
    return encode_grid(np.where(blocked, OCCUPIED, 0), resolution, origin, frame_id, stamp_ns)
