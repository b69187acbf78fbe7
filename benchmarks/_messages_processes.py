# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Processes of the messages benchmark: the suite's nodes, a publisher, a caller; each on a ROS domain of its own.

`python -m benchmarks._messages_processes publish TOPIC SIZE COUNT RATE` publishes COUNT messages, RATE a second (0: unpaced).
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
import os
from pathlib import Path
import signal
import subprocess
import sys
import time

from scenario_gen.base.ros_domain import this_host_only


def environment(domain: int) -> dict[str, str]:
    """Return the environment of a process on `domain`, this host only."""
    return {
        **os.environ,
        **this_host_only(),
        "ROS_DOMAIN_ID": str(domain),
        "RCUTILS_COLORIZED_OUTPUT": "0",
    }


@dataclass(frozen=True)
class Suite:
    """Running nodes."""

    processes: tuple["subprocess.Popen[bytes]", ...]

    @property
    def pids(self) -> tuple[int, ...]:
        """Their processes' ids."""
        return tuple(process.pid for process in self.processes)

    def signalled(self, *signals: signal.Signals) -> float:
        """Send signals to every node, 50 ms apart; return the seconds until the last one has gone."""
        started = time.perf_counter()
        for number in signals:
            for process in self.processes:
                process.send_signal(number)
            time.sleep(0.05)
        for process in self.processes:
            process.wait(30.0)
        return time.perf_counter() - started

    def end(self) -> None:
        """End the nodes that still run."""
        self.signalled(signal.SIGINT)


@contextmanager
def nodes(folder: Path, domain: int, arguments: Mapping[str, Sequence[str]]) -> Iterator[Suite]:
    """Run nodes, each a process with its ROS arguments and a log in the folder; they are ended at the end."""
    processes = []
    for node, own in arguments.items():
        command = [sys.executable, "-m", "scenario_gen.ros.common.start", node, "--ros-args", *own]
        with (folder / f"{node}.log").open("wb") as log:
            variables = environment(domain) | {"ROS_LOG_DIR": str(folder)}
            processes.append(subprocess.Popen(command, stdout=log, stderr=log, env=variables))
    suite = Suite(tuple(processes))
    try:
        yield suite
    finally:
        suite.end()


def publisher(
    domain: int, topic: str, size: int, count: int, rate: float
) -> "subprocess.Popen[str]":
    """Start a publisher; it waits for a subscription, and for a second more."""
    words = ["publish", topic, str(size), str(count), str(rate)]
    return subprocess.Popen(
        [sys.executable, "-m", "benchmarks._messages_processes", *words],
        text=True,
        env=environment(domain),
    )


def publish(topic: str, size: int, count: int, rate: float) -> None:
    """Publish `count` strings of `size` bytes, numbered, raw; stay until they have been taken."""
    import rclpy
    from rclpy.qos import QoSProfile
    from std_msgs.msg import String

    from msg_conventions.cdr import encode
    import scenario_gen.ros.nodes  # noqa: F401  (what the wheels need)

    rclpy.init()
    node = rclpy.create_node("benchmark_publisher")
    sender = node.create_publisher(String, topic, QoSProfile(depth=1000))
    while sender.get_subscription_count() == 0:
        time.sleep(0.05)
    time.sleep(1.0)
    data = encode({"data": "string"}, data="x" * max(0, size - 9))
    started = time.perf_counter()
    for k in range(count):
        if rate:
            time.sleep(max(0.0, started + k / rate - time.perf_counter()))
        sender.publish(data)
    time.sleep(5.0)


if __name__ == "__main__":
    publish(sys.argv[2], int(sys.argv[3]), int(sys.argv[4]), float(sys.argv[5]))
