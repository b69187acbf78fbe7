# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Processes of the messages benchmark: the suite's nodes, a publisher, a caller; each on a ROS domain of its own.

`python -m benchmarks._messages_processes publish TOPIC SIZE COUNT RATE` publishes COUNT messages, RATE a second (0: unpaced).
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
import json
import os
from pathlib import Path
import signal
import subprocess
import sys
import time

from scenario_gen.base.ros_domain import this_host_only


def environment(domain: int) -> dict[str, str]:
    """Return the environment of a process on `domain`, this host only."""
    return {**os.environ, **this_host_only(), "ROS_DOMAIN_ID": str(domain), "RCUTILS_COLORIZED_OUTPUT": "0"}


@dataclass(frozen=True)
class Suite:
    """Running nodes: the process that has forked them, and their own ids."""

    process: "subprocess.Popen[str]"
    pids: tuple[int, ...]

    def signalled(self, *signals: signal.Signals) -> float:
        """Send signals to every node, 50 ms apart; return the seconds until the last one has gone."""
        assert self.process.stdout is not None
        started = time.perf_counter()
        for number in signals:
            for pid in self.pids:
                os.kill(pid, number)
            time.sleep(0.05)
        for _ in self.pids:
            self.process.stdout.readline()  # exited
        return time.perf_counter() - started

    def end(self) -> None:
        """End the nodes as the demo does."""
        if self.process.stdin is not None and not self.process.stdin.closed:
            self.process.stdin.close()
        self.process.wait(30.0)


@contextmanager
def nodes(folder: Path, domain: int, arguments: Mapping[str, Sequence[str]]) -> Iterator[Suite]:
    """Run nodes, each with its ROS arguments, as the demo does; they are ended at the end."""
    specification = [
        {"node": node, "arguments": ["--ros-args", *own], "log": str(folder / f"{node}.log")} for node, own in arguments.items()
    ]
    (folder / "suite.json").write_text(json.dumps(specification), encoding="utf-8")
    process = subprocess.Popen(
        [sys.executable, "-m", "scenario_gen.ros.plumbing.start", "fork", str(folder / "suite.json")],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=environment(domain) | {"ROS_LOG_DIR": str(folder)},
    )
    assert process.stdout is not None
    process.stdout.readline()  # loaded
    suite = Suite(process, tuple(json.loads(process.stdout.readline())["pid"] for _ in arguments))
    try:
        yield suite
    finally:
        suite.end()


def publisher(domain: int, topic: str, size: int, count: int, rate: float) -> "subprocess.Popen[str]":
    """Start a publisher; it waits for a subscription, and for a second more."""
    words = ["publish", topic, str(size), str(count), str(rate)]
    return subprocess.Popen([sys.executable, "-m", "benchmarks._messages_processes", *words], text=True, env=environment(domain))


def publish(topic: str, size: int, count: int, rate: float) -> None:
    """Publish `count` strings of `size` bytes, numbered, raw; stay until they have been taken."""
    import rclpy
    from rclpy.qos import QoSProfile
    from std_msgs.msg import String

    from msg_conventions.cdr import CdrWriter
    import scenario_gen.ros.nodes  # noqa: F401  (what the wheels need)

    rclpy.init()
    node = rclpy.create_node("benchmark_publisher")
    sender = node.create_publisher(String, topic, QoSProfile(depth=1000))
    while sender.get_subscription_count() == 0:
        time.sleep(0.05)
    time.sleep(1.0)
    data = CdrWriter().string("x" * max(0, size - 9)).finish()
    started = time.perf_counter()
    for k in range(count):
        if rate:
            time.sleep(max(0.0, started + k / rate - time.perf_counter()))
        sender.publish(data)
    time.sleep(5.0)


if __name__ == "__main__":
    publish(sys.argv[2], int(sys.argv[3]), int(sys.argv[4]), float(sys.argv[5]))
