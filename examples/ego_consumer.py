# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A planner under test as a ROS 2 node: it follows its route among the vehicles of `traffic`, and brakes for what is in its way.

Only rclpy, numpy and standard messages: nothing of scenario_gen is imported. It hears `ego/goal` (whose child frame says which
vehicle it is), `ego/route`, `vehicle_<id>/odom` and `traffic/local_map`, and answers each odometry with one `ego/cmd_vel`, as a
controller of nav2 does. With `lock_step` it also calls `traffic/step`. Replace `decide` by the planner that you want to test.
"""

import math
import signal
import sys

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Quaternion, Twist
from nav_msgs.msg import OccupancyGrid, Odometry, Path
import numpy as np
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_srvs.srv import Trigger

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
HALF_WIDTH, FRONT = 0.8, 2.4  # metres of the ego beside and ahead of its centre that must be free
BRAKING, GAP = 3.0, 3.0  # m/s² and metres at which it stops before what is in its way


def heading(orientation: Quaternion) -> float:
    """Return the yaw [rad] of a quaternion about z."""
    return 2.0 * math.atan2(orientation.z, orientation.w)


def free_way(
    grid: np.ndarray, origin: np.ndarray, resolution: float, route: np.ndarray, start: int
) -> float:
    """Return the metres along the route (M, 3), from its point `start`, up to the first taken cell of a grid (H, W)."""
    way = 0.0
    for k in range(start + 1, len(route)):
        way += math.hypot(*(route[k, :2] - route[k - 1, :2]))
        x, y, yaw = route[k]
        beside = np.array([-HALF_WIDTH, 0.0, HALF_WIDTH])
        points = np.array([x, y]) + np.outer(beside, (-math.sin(yaw), math.cos(yaw)))
        cells = np.floor((points - origin) / resolution).astype(int)
        inside = (cells >= 0).all(axis=1) & (cells < grid.shape[::-1]).all(axis=1)
        if way > FRONT and (grid[cells[inside, 1], cells[inside, 0]] > 50).any():
            return way
        if not inside.any():
            break
    return math.inf


def decide(
    pose: np.ndarray,
    speed: float,
    route: np.ndarray,
    grid: tuple[np.ndarray, np.ndarray, float] | None,
    wanted: float,
) -> tuple[float, float]:
    """Return speed [m/s] and yaw rate [rad/s] for an ego at `pose` (3,) that follows a route (M, 3)."""
    away = np.hypot(*(route[:, :2] - pose[:2]).T)
    nearest = int(away.argmin())
    ahead = min(max(0.8 * speed, 3.0), 12.0)
    far = np.flatnonzero(away[nearest:] >= ahead)
    target = route[nearest + int(far[0])] if len(far) else route[-1]
    dx, dy = target[:2] - pose[:2]
    aside = dy * math.cos(pose[2]) - dx * math.sin(pose[2])
    curvature = 2.0 * aside / max(dx * dx + dy * dy, 1.0)
    if grid is not None:
        room = free_way(*grid, route, nearest) - FRONT - GAP
        wanted = min(
            wanted, math.sqrt(2.0 * BRAKING * max(room, 0.0)) if math.isfinite(room) else wanted
        )
    return min(wanted, speed + 0.2), curvature * max(speed, 0.5)


class EgoConsumer(Node):
    """Drives until Ctrl-C; says each verdict."""

    def __init__(self) -> None:
        super().__init__("ego_consumer")
        self.speed = self.declare_parameter("speed", 8.0).value
        self.lock_step = self.declare_parameter("lock_step", False).value
        self.route: np.ndarray | None = None
        self.grid: tuple[np.ndarray, np.ndarray, float] | None = None
        self._vehicle, self._odometry = "", None
        self._command = self.create_publisher(Twist, "ego/cmd_vel", 10)
        self._step = self.create_client(Trigger, "traffic/step")
        self.create_subscription(Odometry, "ego/goal", self._hear_goal, LATCHED)
        self.create_subscription(Path, "ego/route", self._hear_route, LATCHED)
        self.create_subscription(OccupancyGrid, "traffic/local_map", self._hear_map, 1)
        self.create_subscription(
            DiagnosticArray, "verdicts", self._hear_verdict, QoSProfile(depth=100)
        )

    def _hear_goal(self, message: Odometry) -> None:
        topic = f"{message.child_frame_id}/odom"
        if self._odometry is not None and self._vehicle != topic:
            self.destroy_subscription(self._odometry)
            self._odometry = None
        if self._odometry is None:
            self._vehicle, self._odometry = (
                topic,
                self.create_subscription(Odometry, topic, self._drive, 10),
            )

    def _hear_route(self, message: Path) -> None:
        poses = [stamped.pose for stamped in message.poses]
        self.route = np.array(
            [(pose.position.x, pose.position.y, heading(pose.orientation)) for pose in poses]
        )

    def _hear_map(self, message: OccupancyGrid) -> None:
        info = message.info
        cells = np.array(message.data, dtype=np.int8).reshape(info.height, info.width)
        self.grid = (
            cells,
            np.array([info.origin.position.x, info.origin.position.y]),
            info.resolution,
        )

    def _hear_verdict(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self.get_logger().info(f"{status.name}: {status.message}")

    def _drive(self, message: Odometry) -> None:
        if self.route is None or not len(self.route):
            return
        place = message.pose.pose
        pose = np.array((place.position.x, place.position.y, heading(place.orientation)))
        self._say(*decide(pose, message.twist.twist.linear.x, self.route, self.grid, self.speed))

    def _say(self, speed: float, yaw_rate: float) -> None:
        command = Twist()
        command.linear.x, command.angular.z = float(speed), float(yaw_rate)
        self._command.publish(command)
        if self.lock_step and self._step.service_is_ready():
            self._step.call_async(Trigger.Request())


def main() -> None:
    """Run until Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # rclpy handles it: nothing breaks off a message
    rclpy.init(args=sys.argv)
    node = EgoConsumer()
    try:
        rclpy.spin(node)
    except ExternalShutdownException:
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
