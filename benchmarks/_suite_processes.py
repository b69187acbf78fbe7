# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The suite's nodes as processes, and a client of theirs; each on a ROS domain of its own."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
import os
from pathlib import Path
import signal
import subprocess
import sys
import threading
import time
from typing import Any

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
