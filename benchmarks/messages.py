# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Messages: encoding beside rclpy (CPU time), and deliveries between processes over DDS."""

from collections.abc import Callable
import math
import os
from pathlib import Path
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
from msg_conventions.scenarios import decode_scenario, encode_scenario
from scenario_gen.bags.storage.bag import bag_topics
from scenario_gen.base.ros_domain import free_domain, this_host_only
from scenario_gen.logs.synthetic import bundled
from scenario_gen.numerics.arrays import Floats
from scenario_gen.types import Vehicle
from scenario_gen.types.scenario import Scenario

POINTS_COUNT = 200
LARGE_COUNT = sized(1000, quick=20)
"""Messages of the size of a scenario that are sent to a raw consumer."""
SMALL_COUNT, SMALL_HZ = sized(6000, quick=20), 2000.0
"""Messages that are sent to the recorder, and their rate."""
REQUESTS_COUNT = sized(40, quick=2)


def run() -> list[Row]:
    """Measure."""
    os.environ.update(this_host_only())
    rows = [_encoding()]
    with free_domain() as domain, tempfile.TemporaryDirectory() as folder:
        rows += [_consumer(domain), _recorder(domain, Path(folder))]
    with free_domain() as domain, tempfile.TemporaryDirectory() as folder:
        rows.append(_request_time(domain, Path(folder)))
    with (
        free_domain() as domain,
        tempfile.TemporaryDirectory() as folder,
        Client(domain) as client,
    ):
        rows += many(domain, Path(folder), client, wait_until)
    return rows


def _scenario(vehicles: int) -> Scenario:
    clock: Floats = 0.1 * np.arange(POINTS_COUNT, dtype=np.float64)
    rng = np.random.default_rng(1)
    heading = np.cumsum(rng.normal(0.0, 0.02, (vehicles, POINTS_COUNT)), axis=1)
    step = 0.8 * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    position: Floats = np.cumsum(step, axis=1)
    speed = np.full((vehicles, POINTS_COUNT), 8.0)
    names = tuple(Vehicle(str(k)) for k in range(vehicles))
    return Scenario(names, clock, position, heading, speed, np.zeros_like(speed))


def _cpu(work: Callable[[], object], rounds: int) -> float:
    """Return the CPU seconds of one call: the best of five times `rounds`."""
    best = np.inf
    for _ in range(sized(5, quick=1)):
        started = process_time()
        for _ in range(rounds):
            work()
        best = min(best, (process_time() - started) / rounds)
    return float(best)


def _encoding() -> Row:
    """Encode a scenario of four vehicles, with rclpy and with ours.

    Raises:
        RuntimeError: the two messages differ.
    """
    from geometry_msgs.msg import Transform, Twist
    from rclpy.serialization import deserialize_message, serialize_message
    from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

    scenario = _scenario(4)
    data = encode_scenario(scenario, 0)
    names = list(deserialize_message(data, MultiDOFJointTrajectory).joint_names)

    def rclpy_message() -> bytes:
        message = MultiDOFJointTrajectory(joint_names=names)
        message.header.frame_id = "map"
        for k in range(POINTS_COUNT):
            point = MultiDOFJointTrajectoryPoint()
            offset = point.time_from_start
            offset.sec, offset.nanosec = divmod(k * 100_000_000, 10**9)
            for i in range(4):
                transform, velocity, acceleration = Transform(), Twist(), Twist()
                position, yaw = scenario.position[i, k].tolist(), float(scenario.heading[i, k])
                transform.translation.x, transform.translation.y = position
                transform.rotation.z = math.sin(0.5 * yaw)
                transform.rotation.w = math.cos(0.5 * yaw)
                velocity.linear.x = float(scenario.speed[i, k])
                acceleration.linear.x = float(scenario.acceleration[i, k])
                point.transforms.append(transform)
                point.velocities.append(velocity)
                point.accelerations.append(acceleration)
            message.points.append(point)
        return bytes(serialize_message(message))

    peer_data = rclpy_message()
    decoded = decode_scenario(peer_data)[1].position
    if len(peer_data) != len(data) or not np.array_equal(decoded, scenario.position):
        raise RuntimeError("the two encoders do not make the same message")
    theirs, ours = _cpu(rclpy_message, 5), _cpu(lambda: encode_scenario(scenario, 0), 200)
    peer = f"rclpy {1e3 * theirs:.2f} ms, ours {1e3 * ours:.4f} ms"
    return higher("encode a scenario, 4 vehicles, 200 points", theirs / ours, "×", 50.0, peer)


class Client:
    """A node of this process; a thread spins it."""

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

    def __enter__(self) -> "Client":
        return self

    def __exit__(self, *_: object) -> None:
        self.executor.shutdown(timeout_sec=2.0)
        self.thread.join(2.0)
        self.node.destroy_node()
        self.context.try_shutdown()


def wait_until(condition: Callable[[], bool], patience: float) -> bool:
    """Wait up to `patience` seconds; return whether the condition is true."""
    deadline = time.monotonic() + patience
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.001)
    return condition()


def result_of(future: Any) -> Any:
    """Return the answer of a service.

    Raises:
        RuntimeError: there is none within 60 s.
    """
    if not wait_until(future.done, 60.0):
        raise RuntimeError("a service did not answer within 60 s")
    return future.result()


def _consumer(domain: int) -> Row:
    """Measure the rate of scenarios from one process to another."""
    from rclpy.qos import QoSProfile
    from std_msgs.msg import String

    size, stamps = len(encode_scenario(_scenario(2), 0)), list[float]()

    def receive(_: object) -> None:
        stamps.append(time.perf_counter())

    with Client(domain) as client:
        client.node.create_subscription(String, "large", receive, QoSProfile(depth=1000), raw=True)
        sender = publisher(domain, "large", size, LARGE_COUNT, 0.0)
        wait_until(lambda: len(stamps) == LARGE_COUNT, 40.0)
        sender.wait(30.0)
    rate = (len(stamps) - 1) / (stamps[-1] - stamps[0]) if len(stamps) > 1 else 0.0
    arrived = f"{len(stamps)} of {LARGE_COUNT} messages of {size} bytes arrived"
    return higher("scenarios received by a raw consumer", rate, "1/s", 500.0, arrived)


def _recorder(domain: int, folder: Path) -> Row:
    """Count the messages that the recorder loses."""
    bag = folder / "bag"
    with nodes(folder, domain, {"recorder": ["-p", f"bag:={bag}", "-p", "topics:=.*/small"]}):
        publisher(domain, "small", 100, SMALL_COUNT, SMALL_HZ).wait(60.0)
    (topic,) = bag_topics(bag)
    name = "messages that the recorder lost at 2,000 a second"
    return lower(name, SMALL_COUNT - topic.count, "messages", 0.0, f"of {SMALL_COUNT}")


def _request_time(domain: int, folder: Path) -> Row:
    """Measure the time from a request for one scenario to its answer, warm."""
    from rcl_interfaces.srv import SetParametersAtomically
    from rclpy.parameter import Parameter

    count = Parameter("count", value=1).to_parameter_msg()
    request = SetParametersAtomically.Request(parameters=[count])
    arguments = {
        "log_player": ["-p", f"log_path:={bundled('c')}"],
        "road_server": ["-p", "road_name:=straight", "-p", "wait_for_tracks:=true"],
        "segmenter": [],
        "planner": [],
        "gp_sampler": ["-p", "generate_on_input:=false"],
    }
    with nodes(folder, domain, arguments), Client(domain) as client:
        service = client.node.create_client(SetParametersAtomically, "gp_sampler/generate")
        service.wait_for_service(30.0)
        while not result_of(service.call_async(request)).result.successful:
            time.sleep(0.5)
        seconds = []
        for _ in range(REQUESTS_COUNT):
            started = time.perf_counter()
            result_of(service.call_async(request))
            seconds.append(time.perf_counter() - started)
    return lower("request for one scenario, warm, median", float(np.median(seconds)), "s", 0.2)
