# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A drive in closed loop ⇄ messages: states from the node `traffic`, commands to the ego.

Outputs at every step, with the drive's time (that of /clock) as their stamp, in the road's frame:

- `vehicle_<id>/odom` (nav_msgs/Odometry) of all vehicles with the ego: child frame `vehicle_<id>`,
  the centre of the footprint, x ahead; twist in that frame, linear.x the speed [m/s], angular.z
  the yaw rate [rad/s]. QoS: reliable, volatile, depth 100.
- `traffic/markers` (visualization_msgs/MarkerArray): a box for each vehicle, black for the ego.
- `traffic/local_map` (nav_msgs/OccupancyGrid): the drivable cells around the ego; other vehicles
  are obstacles. Depth 1.
- /clock (rosgraph_msgs/Clock), /tf (poses.py), `verdicts` (diagnostic_msgs/DiagnosticArray),
  `ego/goal`, `ego/route`.

Inputs for the ego; a stamp of 0 means "now":

- `ego/cmd_vel` (geometry_msgs/Twist), `ego/cmd_vel_stamped` (TwistStamped): the target speed
  linear.x [m/s], reached as fast as the vehicle can, and angular.z [rad/s].
- `ego/trajectory` (trajectory_msgs/MultiDOFJointTrajectory, conventions: trajectory.py),
  `ego/path` (nav_msgs/Path with the time of each pose as its stamp): the poses that the ego
  tracks.
- `ego/odom` (nav_msgs/Odometry): the ego's state in another simulator.
"""

from dataclasses import dataclass

import numpy as np

from msg_conventions import trajectory
from msg_conventions.cdr import decode, encode
from msg_conventions.layouts import CLOCK, PATH, VELOCITY, VELOCITY_STAMPED
from msg_conventions.paths import timed_poses
from msg_conventions.roads import encode_grid, OCCUPIED_CODE
from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Bools, Floats

TWIST_TYPE, CLOCK_TYPE = "geometry_msgs/msg/Twist", "rosgraph_msgs/msg/Clock"


@dataclass(frozen=True, eq=False)
class TimedPath:
    """Poses for the ego to track.

    (T,) times [ns] on the drive's clock, (T, 3) x, y [m], yaw [rad] in `frame_id`.
    """

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
    data: bytes, source: str = "ego/cmd_vel", *, stamped: bool = False
) -> tuple[int, str, float, float]:
    """Return stamp [ns], frame, linear.x [m/s] and angular.z [rad/s], finite or not.

    Stamp and frame are 0 and "" if the message is not `stamped`.

    Raises:
        InputError: the message is damaged.
    """
    message = decode(VELOCITY_STAMPED if stamped else VELOCITY, data, source)
    speed, yaw_rate = message.twist[[0, 5]].tolist()
    if not stamped:
        return 0, "", speed, yaw_rate
    return message.stamp, message.frame_id, speed, yaw_rate


def decode_trajectory(data: bytes, source: str = "ego/trajectory") -> TimedPath:
    """Return the first vehicle's path in a MultiDOFJointTrajectory.

    Raises:
        InputError: the message is damaged, empty, or holds a value that is not finite.
    """
    message = trajectory.decode(data, source)
    if not len(message.time_ns):
        raise InputError(f"{source} is empty")
    poses = np.column_stack([message.position[0], message.heading[0]])
    time_ns = (message.stamp_ns + message.time_ns).astype(np.float64)
    return TimedPath(time_ns, poses, message.frame_id)


def decode_timed_path(data: bytes, source: str = "ego/path") -> TimedPath:
    """Return the path in a Path whose stamps are the times of its poses.

    Raises:
        InputError: the message is damaged or empty, a value is not finite, or the stamps do not
            ascend.
    """
    path = decode(PATH, data, source)
    if not path.poses:
        raise InputError(f"{source} is empty")
    poses, stamps = timed_poses(path, source)
    if (np.diff(stamps) <= 0).any():
        raise InputError(
            f"{source}: the poses' stamps must ascend: they are the times of the poses"
        )
    return TimedPath(stamps.astype(np.float64), poses, path.frame_id)


def encode_local_map(
    blocked: Bools, resolution: float, origin: Floats, frame_id: str, stamp_ns: int
) -> bytes:
    """Return blocked cells (H, W), their size and lower-left corner [m] as an OccupancyGrid."""
    return encode_grid(np.where(blocked, OCCUPIED_CODE, 0), resolution, origin, frame_id, stamp_ns)
