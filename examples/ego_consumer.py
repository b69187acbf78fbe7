# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""A small downstream planner: it asks for a plan, drives an ego along it among the vehicles of every scenario, counts crashes.

Only rclpy, numpy and standard messages: nothing of scenario_gen is imported. One vehicle of each scenario (parameter `ego`)
is taken out, and the ego drives from that vehicle's start to its goal. Replace `Driver` by the planner that you want to test.
"""

from dataclasses import dataclass
import math
import sys

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from nav_msgs.srv import GetPlan
import numpy as np
import rclpy
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from trajectory_msgs.msg import MultiDOFJointTrajectory

STEP = 0.1  # seconds
HORIZON = np.arange(1, 51) * STEP  # how far the driver looks ahead, seconds
LATCHED = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@dataclass(frozen=True)
class Traffic:
    """A scenario on an even clock: ids, sizes (N, 2) and states (N, T, 4) as x, y, yaw, speed."""

    frame: str
    ids: list[str]
    sizes: np.ndarray
    states: np.ndarray


def read_scenario(message: MultiDOFJointTrajectory) -> Traffic:
    """Read the conventions: joint name `<id>:<length>x<width>`, poses of the footprints' centres, speed as linear.x."""
    ids, sizes = [], []
    for name in message.joint_names:
        identity, _, size = name.partition(":")
        ids.append(identity)
        sizes.append([float(value) for value in size.split("x")] if size else [4.8, 1.9])
    time = np.array([point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec for point in message.points])
    raw = np.array(
        [
            [
                (t.translation.x, t.translation.y, 2.0 * math.atan2(t.rotation.z, t.rotation.w), v.linear.x)
                for t, v in zip(point.transforms, point.velocities, strict=True)
            ]
            for point in message.points
        ]
    ).swapaxes(0, 1)
    raw[..., 2] = np.unwrap(raw[..., 2], axis=1)
    even = np.arange(0.0, time[-1] + 0.5 * STEP, STEP)
    states = np.array([[np.interp(even, time, column) for column in vehicle.T] for vehicle in raw]).swapaxes(1, 2)
    return Traffic(message.header.frame_id, ids, np.array(sizes), states)


def overlap(one: np.ndarray, size_one: np.ndarray, other: np.ndarray, size_other: np.ndarray) -> np.ndarray:
    """Say for each of K instants whether two oriented rectangles, poses (K, 3) as x, y, yaw, meet: separating axes."""
    apart = np.zeros(len(one), dtype=bool)
    offset = other[:, :2] - one[:, :2]
    for yaw in (one[:, 2], one[:, 2] + 0.5 * np.pi, other[:, 2], other[:, 2] + 0.5 * np.pi):
        distance = np.abs(offset[:, 0] * np.cos(yaw) + offset[:, 1] * np.sin(yaw))
        reach = np.zeros(len(one))
        for pose, (length, width) in ((one, size_one), (other, size_other)):
            reach += 0.5 * (length * np.abs(np.cos(yaw - pose[:, 2])) + width * np.abs(np.sin(yaw - pose[:, 2])))
        apart |= distance > reach
    return ~apart


def time_to_collision(ego: np.ndarray, size: np.ndarray, others: np.ndarray, sizes: np.ndarray) -> float:
    """Return the seconds until the first overlap if all keep heading and speed (states: x, y, yaw, speed); inf beyond 5 s."""
    first = math.inf
    for other, other_size in zip(others, sizes, strict=True):
        hits = overlap(_ahead(ego), size, _ahead(other), other_size)
        if hits.any():
            first = min(first, float(HORIZON[np.argmax(hits)]))
    return first


def _ahead(state: np.ndarray) -> np.ndarray:
    x, y, yaw, speed = state
    way = speed * HORIZON
    return np.column_stack([x + way * np.cos(yaw), y + way * np.sin(yaw), np.full(len(way), yaw)])


@dataclass(frozen=True)
class Driver:
    """Follows the plan at a speed [m/s], and brakes while a collision is nearer than `brake_ttc` [s]."""

    speed: float
    brake_ttc: float
    acceleration: float = 2.0
    braking: float = 5.0

    def drive(self, plan: np.ndarray, size: np.ndarray, traffic: Traffic) -> tuple[int, float]:
        """Drive along the plan (M, 3); return the steps in collision and the least time to collision [s]."""
        length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(plan[:, :2], axis=0).T))])
        heading = np.unwrap(plan[:, 2])
        way, speed, crashes, least = 0.0, float(traffic.states[traffic.ids.index("ego"), 0, 3]), 0, math.inf
        others = [k for k, name in enumerate(traffic.ids) if name != "ego"]
        for now in traffic.states[others].swapaxes(0, 1):
            pose = [np.interp(way, length, column) for column in (plan[:, 0], plan[:, 1], heading)]
            ego = np.array([*pose, speed])
            touching = [overlap(ego[None, :3], size, now[i : i + 1, :3], traffic.sizes[k])[0] for i, k in enumerate(others)]
            crashes += any(touching)
            ttc = 0.0 if any(touching) else time_to_collision(ego, size, now, traffic.sizes[others])
            least = min(least, ttc)
            change = -self.braking if ttc < self.brake_ttc else self.acceleration
            speed = min(max(speed + change * STEP, 0.0), self.speed)
            way = min(way + speed * STEP, length[-1])
        return crashes, least


class EgoConsumer(Node):
    """Drives among every scenario it hears, and reports on `~/report`."""

    def __init__(self) -> None:
        super().__init__("ego_consumer")
        self.ego = self.declare_parameter("ego", "").value  # id of the vehicle to replace; empty: the first one
        self.driver = Driver(self.declare_parameter("speed", 8.0).value, self.declare_parameter("brake_ttc", 2.0).value)
        self._plans: dict[bytes, tuple[GetPlan.Request, rclpy.task.Future]] = {}  # by start and goal
        self._count = 0
        answers = ReentrantCallbackGroup()  # the answer comes while the callback that asked still waits
        self._planner = self.create_client(GetPlan, "planner/get_plan", callback_group=answers)
        self.create_timer(2.0, self._ask_again, callback_group=answers)
        self._report = self.create_publisher(DiagnosticArray, "~/report", LATCHED)
        self.create_subscription(MultiDOFJointTrajectory, "scenarios", self._hear, LATCHED)

    async def _hear(self, message: MultiDOFJointTrajectory) -> None:
        """Take a scenario, put the ego in place of one of its vehicles, and drive."""
        number, self._count = self._count, self._count + 1
        traffic = read_scenario(message)
        if self.ego and self.ego not in traffic.ids:
            self.get_logger().error(f"scenario {number} has no vehicle {self.ego!r}; it has {', '.join(traffic.ids)}")
            return
        at = traffic.ids.index(self.ego) if self.ego else 0
        traffic.ids[at] = "ego"
        states = traffic.states[at]
        answer = await self._plan(traffic.frame, states[0], states[-1])
        poses = [stamped.pose for stamped in answer.plan.poses]
        yaw = [2.0 * math.atan2(pose.orientation.z, pose.orientation.w) for pose in poses]
        plan = np.array([(pose.position.x, pose.position.y, angle) for pose, angle in zip(poses, yaw, strict=True)])
        if len(plan) < 2:
            self._tell(message, number, DiagnosticStatus.ERROR, "there is no plan; planner/explain says why", {})
            return
        crashes, least = self.driver.drive(plan, traffic.sizes[at], traffic)
        level = DiagnosticStatus.ERROR if crashes else DiagnosticStatus.OK
        words = f"{crashes * STEP:.1f} s in collision" if crashes else f"no collision, least time to collision {least:.1f} s"
        self._tell(message, number, level, words, {"collision_seconds": crashes * STEP, "min_time_to_collision": least})

    def _plan(self, frame: str, start: np.ndarray, goal: np.ndarray) -> rclpy.task.Future:
        """Ask once for every pair of start and goal; all scenarios of a template share theirs."""
        key = np.round([start[:2], goal[:2]]).tobytes()
        if key not in self._plans:
            request = GetPlan.Request()
            for stamped, state in ((request.start, start), (request.goal, goal)):
                stamped.header.frame_id = frame
                stamped.pose.position.x, stamped.pose.position.y = float(state[0]), float(state[1])
                stamped.pose.orientation.z, stamped.pose.orientation.w = math.sin(0.5 * state[2]), math.cos(0.5 * state[2])
            self._plans[key] = request, rclpy.task.Future(executor=self.executor)
            self._ask(*self._plans[key])
        return self._plans[key][1]

    def _ask(self, request: GetPlan.Request, plan: rclpy.task.Future) -> None:
        def answered(answer: rclpy.task.Future) -> None:
            if not plan.done():
                plan.set_result(answer.result())

        if self._planner.service_is_ready():
            self._planner.call_async(request).add_done_callback(answered)

    def _ask_again(self) -> None:
        """Ask for plans that are still missing: the planner was not there yet, or it answered before it knew this client."""
        for request, plan in self._plans.values():
            if not plan.done():
                self._ask(request, plan)

    def _tell(self, message: MultiDOFJointTrajectory, number: int, level: bytes, words: str, values: dict[str, float]) -> None:
        self.get_logger().info(f"scenario {number}: {words}")
        pairs = [KeyValue(key=key, value=repr(value)) for key, value in values.items()]
        status = DiagnosticStatus(level=level, name=f"ego_consumer: scenario {number}", message=words, values=pairs)
        self._report.publish(DiagnosticArray(header=message.header, status=[status]))


def main() -> None:
    """Run until Ctrl-C."""
    rclpy.init(args=sys.argv)
    node = EgoConsumer()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
