# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Messages: encoding against rclpy (CPU time), and what goes through real processes over DDS (wall time)."""

from collections.abc import Callable
import math
import os
from pathlib import Path
import signal
import tempfile
import threading
import time
from time import process_time
from typing import Any

import numpy as np

from benchmarks._messages_many import many
from benchmarks._messages_processes import nodes, publisher
from benchmarks._size import sized
from benchmarks.row import higher, lower, Row
from msg_conventions.paths import encode_path
from msg_conventions.scenarios import decode_scenario, encode_scenario
from scenario_gen.bags.storage.bag import bag_topics
from scenario_gen.base.ros_domain import free_domain, this_host_only
from scenario_gen.logs.synthetic import bundled
from scenario_gen.numerics.arrays import Floats
from scenario_gen.types import Vehicle
from scenario_gen.types.scenario import Scenario

POINTS = 200
SCENARIOS = sized(1000, quick=20)
SMALL = sized(6000, quick=20)  # messages sent to the recorder
RATE = 2000.0  # a second
INTERRUPT, TERMINATE = signal.SIGINT, signal.SIGTERM
CALLS = sized(40, quick=2)
EXITS = (("Ctrl-C", INTERRUPT), ("Ctrl-C twice", INTERRUPT, INTERRUPT), ("SIGTERM", TERMINATE))[
    : sized(None, quick=1)
]


def run() -> list[Row]:
    """Measure."""
    os.environ.update(this_host_only())
    rows = [_path(), _trajectory()]
    with free_domain() as domain, tempfile.TemporaryDirectory() as folder:
        rows.append(_consumer(domain))
        rows.append(_recorder(domain, Path(folder)))
    with free_domain() as domain, tempfile.TemporaryDirectory() as folder:
        rows += _calls(domain, Path(folder))
        rows += [_exit(domain, Path(folder), *how) for how in EXITS]
    with (
        free_domain() as domain,
        tempfile.TemporaryDirectory() as folder,
        _Client(domain) as client,
    ):
        rows += many(domain, Path(folder), client, _until)
    return rows


def _scenario(n: int) -> Scenario:
    clock = np.arange(POINTS, dtype=np.float64) * np.float64(0.1)
    rng = np.random.Generator(np.random.PCG64(1))
    heading = np.cumsum(rng.normal(0.0, 0.02, (n, POINTS)), axis=1)
    speed = np.full((n, POINTS), 8.0)
    position: Floats = np.cumsum(
        0.8 * np.stack([np.cos(heading), np.sin(heading)], axis=-1), axis=1
    )
    return Scenario(
        tuple(Vehicle(str(k)) for k in range(n)),
        clock,
        position,
        heading,
        speed,
        np.zeros_like(speed),
    )


def _cpu(work: Callable[[], object], rounds: int) -> float:
    """CPU seconds of one call: the best of five times `rounds`."""
    best = np.inf
    for _ in range(sized(5, quick=1)):
        started = process_time()
        for _ in range(rounds):
            work()
        best = min(best, (process_time() - started) / rounds)
    return float(best)


def _path() -> Row:
    from geometry_msgs.msg import PoseStamped
    from nav_msgs.msg import Path as PathMessage
    from rclpy.serialization import serialize_message

    poses = np.column_stack([_scenario(1).position[0], _scenario(1).heading[0]])
    stamps = np.arange(POINTS) * 100_000_000

    def theirs() -> bytes:
        message = PathMessage()
        message.header.frame_id = "map"
        for (x, y, yaw), stamp in zip(poses.tolist(), stamps.tolist(), strict=True):
            pose = PoseStamped()
            pose.header.frame_id = "map"
            pose.header.stamp.sec, pose.header.stamp.nanosec = divmod(stamp, 10**9)
            pose.pose.position.x, pose.pose.position.y = x, y
            pose.pose.orientation.z, pose.pose.orientation.w = (
                math.sin(0.5 * yaw),
                math.cos(0.5 * yaw),
            )
            message.poses.append(pose)
        return bytes(serialize_message(message))

    def own() -> bytes:
        return encode_path(poses, stamps, "map", 0)

    if len(theirs()) != len(own()):
        raise RuntimeError("the two encoders do not make the same message")
    return _ratio("encode a 200-pose Path", own, theirs, 100.0)


def _trajectory() -> Row:
    from geometry_msgs.msg import Transform, Twist
    from rclpy.serialization import serialize_message
    from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

    scenario = _scenario(4)
    names = decode_names(encode_scenario(scenario, 0))

    def theirs() -> bytes:
        message = MultiDOFJointTrajectory(joint_names=names)
        message.header.frame_id = "map"
        for k in range(POINTS):
            point = MultiDOFJointTrajectoryPoint()
            point.time_from_start.sec, point.time_from_start.nanosec = divmod(
                k * 100_000_000, 10**9
            )
            for i in range(4):
                transform, velocity, acceleration = Transform(), Twist(), Twist()
                transform.translation.x, transform.translation.y = map(
                    float, scenario.position[i, k]
                )
                yaw = float(scenario.heading[i, k])
                transform.rotation.z, transform.rotation.w = (
                    math.sin(0.5 * yaw),
                    math.cos(0.5 * yaw),
                )
                velocity.linear.x, acceleration.linear.x = (
                    float(scenario.speed[i, k]),
                    float(scenario.acceleration[i, k]),
                )
                point.transforms.append(transform)
                point.velocities.append(velocity)
                point.accelerations.append(acceleration)
            message.points.append(point)
        return bytes(serialize_message(message))

    def own() -> bytes:
        return encode_scenario(scenario, 0)

    if len(theirs()) != len(own()) or not np.array_equal(
        decode_scenario(theirs())[1].position, scenario.position
    ):
        raise RuntimeError("the two encoders do not make the same message")
    return _ratio("encode a scenario of 4 vehicles and 200 points", own, theirs, 50.0)


def decode_names(data: bytes) -> list[str]:
    """Return the joint names of a message, as rclpy reads them."""
    from rclpy.serialization import deserialize_message
    from trajectory_msgs.msg import MultiDOFJointTrajectory

    return list(deserialize_message(data, MultiDOFJointTrajectory).joint_names)


def _ratio(
    name: str, own: Callable[[], object], theirs: Callable[[], object], target: float
) -> Row:
    peer, mine = _cpu(theirs, 5), _cpu(own, 200)
    words = f"built and serialised with rclpy: {1e3 * peer:.2f} ms, ours {1e3 * mine:.4f} ms"
    return higher(name, peer / mine, "×", target, words)


class _Client:
    """A node of this process, spun by a thread."""

    def __init__(self, domain: int) -> None:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor

        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = rclpy.create_node("benchmark", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.thread = threading.Thread(target=self.executor.spin, daemon=True)
        self.thread.start()

    def __enter__(self) -> "_Client":
        return self

    def __exit__(self, *_: object) -> None:
        self.executor.shutdown(timeout_sec=2.0)
        self.thread.join(2.0)
        self.node.destroy_node()
        self.context.try_shutdown()


def _until(condition: Callable[[], bool], patience: float) -> bool:
    deadline = time.monotonic() + patience
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.001)
    return condition()


def _consumer(domain: int) -> Row:
    from rclpy.qos import QoSProfile
    from std_msgs.msg import String

    size = len(encode_scenario(_scenario(2), 0))
    stamps: list[float] = []
    with _Client(domain) as client:
        client.node.create_subscription(
            String,
            "large",
            lambda _: stamps.append(time.perf_counter()),
            QoSProfile(depth=1000),
            raw=True,
        )
        sender = publisher(domain, "large", size, SCENARIOS, 0.0)
        _until(lambda: len(stamps) == SCENARIOS, 40.0)
        sender.wait(30.0)
    rate = (len(stamps) - 1) / (stamps[-1] - stamps[0]) if len(stamps) > 1 else 0.0
    words = f"{len(stamps)} of {SCENARIOS} messages of {size} bytes arrived, from one process to another"
    return higher(
        "scenarios received by a raw consumer (2 vehicles, 200 points)", rate, "1/s", 500.0, words
    )


def _recorder(domain: int, folder: Path) -> Row:
    bag = folder / "bag"
    with nodes(folder, domain, {"recorder": ["-p", f"bag:={bag}", "-p", "topics:=.*/small"]}):
        sender = publisher(domain, "small", 100, SMALL, RATE)
        sender.wait(60.0)
    (topic,) = bag_topics(bag)
    words = f"{topic.count} of {SMALL} messages of 100 bytes, 2,000 a second"
    return lower(
        "messages that the recorder lost at 2,000 a second",
        SMALL - topic.count,
        "messages",
        0.0,
        words,
    )


def _calls(domain: int, folder: Path) -> list[Row]:
    """Round trips of GetMap, GetPlan and a call of the sampler's own while a generation runs."""
    from nav_msgs.srv import GetMap, GetPlan
    from rcl_interfaces.srv import ListParameters

    rows = []
    with nodes(folder, domain, _arguments()), _Client(domain) as client:
        generate, request = _generation(client), _request(50)
        plan = GetPlan.Request()
        plan.start.pose.position.x, plan.goal.pose.position.x, plan.start.pose.position.y = _ends(
            client
        )
        plan.goal.pose.position.y = plan.start.pose.position.y
        own = ListParameters.Request()
        for kind, name, call in (
            (GetMap, "road_server/get_map", GetMap.Request()),
            (GetPlan, "planner/get_plan", plan),
            (ListParameters, "gp_sampler/list_parameters", own),
        ):
            service = client.node.create_client(kind, name)
            service.wait_for_service(30.0)
            answer = _done(service.call_async(call))
            if not (
                answer.map.data
                if kind is GetMap
                else answer.plan.poses
                if kind is GetPlan
                else answer.result.names
            ):
                raise RuntimeError(f"{name} answers with nothing")
            running, taken = generate.call_async(request), []
            for _ in range(CALLS):
                if running.done():
                    running = generate.call_async(request)
                started = time.perf_counter()
                _done(service.call_async(call))
                taken.append(time.perf_counter() - started)
            _done(running)
            words = f"median {1e3 * float(np.median(taken)):.1f} ms; {CALLS} calls while generations of 50 run"
            rows.append(
                lower(
                    f"{kind.__name__} round trip, 95th percentile",
                    1e3 * _high(taken),
                    "ms",
                    200.0,
                    words,
                )
            )
    return rows


def _arguments() -> dict[str, list[str]]:
    """Five nodes that generate when they are asked to."""
    return {
        "log_player": ["-p", f"log_path:={bundled('c')}"],
        "road_server": ["-p", "road_name:=straight", "-p", "wait_for_tracks:=true"],
        "segmenter": [],
        "planner": [],
        "gp_sampler": ["-p", "generate_on_input:=false"],
    }


def _request(count: int) -> Any:
    """Return a request for so many scenarios."""
    from rcl_interfaces.srv import SetParametersAtomically
    from rclpy.parameter import Parameter

    return SetParametersAtomically.Request(
        parameters=[Parameter("count", value=count).to_parameter_msg()]
    )


def _generation(client: _Client) -> Any:
    """Return the client of a sampler that has all it needs."""
    from rcl_interfaces.srv import SetParametersAtomically

    generate = client.node.create_client(SetParametersAtomically, "gp_sampler/generate")
    generate.wait_for_service(30.0)
    while not _done(generate.call_async(_request(50))).result.successful:
        time.sleep(0.5)
    return generate


def _exit(domain: int, folder: Path, name: str, *signals: signal.Signals) -> Row:
    """How long the nodes take to end in the midst of a generation."""
    with nodes(folder, domain, _arguments()) as suite, _Client(domain) as client:
        running = _generation(client).call_async(_request(20_000))
        time.sleep(2.0)
        if running.done():
            raise RuntimeError("the generation was over too soon")
        words = "all five, while a generation of 20,000 runs"
        return lower(f"nodes end after {name}", suite.signalled(*signals), "s", 2.0, words)


def _ends(client: _Client) -> tuple[float, float, float]:
    """Return x of two places 10 m inside the ends of the straight road, and y of its right lane."""
    from nav_msgs.srv import GetMap

    service = client.node.create_client(GetMap, "road_server/get_map")
    service.wait_for_service(30.0)
    info = _done(service.call_async(GetMap.Request())).map.info
    west, south = info.origin.position.x, info.origin.position.y
    return (
        west + 10.0,
        west + info.width * info.resolution - 10.0,
        south + 0.5 * info.height * info.resolution - 1.75,
    )


def _high(values: list[float]) -> float:
    return float(np.percentile(values, 95))


def _done(future: Any) -> Any:
    if not _until(future.done, 60.0):
        raise RuntimeError("a service did not answer within 60 s")
    return future.result()
