# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Real nodes in real processes, and a client to talk to them."""

from collections import defaultdict
from collections.abc import Iterable
import os
from pathlib import Path
import signal
import sys
import threading
import time

from scenario_gen.base.ros_domain import this_host_only
from support.known_readers import until_known_at
from support.node_server import Forked, start_nodes

ROOT = Path(__file__).resolve().parents[2]
RESOURCES = ROOT / "scenario_gen" / "resources"
os.environ.setdefault("AMENT_PREFIX_PATH", sys.prefix)
os.environ.update(this_host_only())


APART = ("recorder", "player")


class Processes:
    """Nodes by name with their ROS arguments, as the demo runs them: the recorder, and a player, in processes of their own.

    The others are a composed suite, but for those that are `apart`, of which some may have `namespaces`.
    """

    def __init__(
        self,
        folder: Path,
        domain: int,
        nodes: dict[str, list[str]],
        namespaces: dict[str, tuple[str, ...]] | None = None,
        *,
        apart: Iterable[str] = (),
    ):
        self.folder, self.processes = folder, {}
        self.environment = {
            "ROS_DOMAIN_ID": str(domain),
            "RCUTILS_COLORIZED_OUTPUT": "0",
            "ROS_LOG_DIR": str(folder),
        }
        together = [node for node in nodes if node not in (*apart, *APART)]
        if together:
            own = [
                word if word == "-p" else f"{node}:{word}"
                for node in together
                for word in nodes[node]
            ]
            self.processes = dict.fromkeys(
                together, self._start("suite", "--nodes", ",".join(together), "--ros-args", *own)
            )
        for node in nodes.keys() - set(together):
            spaces = [
                word for name in (namespaces or {}).get(node, ()) for word in ("--namespace", name)
            ]
            self.processes[node] = self._start(node, *spaces, "--ros-args", *nodes[node])
        self.pids = {node: process.pid for node, process in self.processes.items()}

    def _start(self, name: str, *words: str) -> Forked:
        return start_nodes(name, *words, log=self.folder / f"{name}.log", **self.environment)

    def end(self) -> dict[str, int]:
        """End all nodes as Ctrl-C does; return their exit codes."""
        for process in dict.fromkeys(self.processes.values()):
            process.send_signal(signal.SIGINT)
        return {node: process.wait(180.0) for node, process in self.processes.items()}

    def kill(self) -> None:
        """Kill those that still run."""
        for process in self.processes.values():
            process.kill()

    def log(self, node: str) -> str:
        return self.processes[node].output()


class Client:
    """A node of the test's own that hears topics raw and calls services."""

    def __init__(self, domain: int, name: str = "test_client"):
        import rclpy
        from rclpy.executors import SingleThreadedExecutor

        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = rclpy.create_node(name, context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.heard: dict[str, list[bytes]] = defaultdict(list)
        self._publishers, self._callers = {}, {}
        self.thread = threading.Thread(target=self.executor.spin, daemon=True)
        self.thread.start()

    def hear(self, *topics: str) -> None:
        for topic in topics:
            message, quality = self._kind_of(topic)
            take = self.heard[topic].append
            self.node.create_subscription(message, topic, take, quality, raw=True)

    def announce(self, topic: str) -> None:
        if topic not in self._publishers:
            message, quality = self._kind_of(topic)
            self._publishers[topic] = self.node.create_publisher(message, topic, quality)

    def say(self, topic: str, data: bytes) -> None:
        self.announce(topic)
        self._publishers[topic].publish(data)

    @staticmethod
    def _kind_of(topic: str):
        from msg_conventions.topics import topic_entry
        from scenario_gen.ros.common.topics import message_class, qos

        kind, quality = topic_entry(topic)
        return message_class(kind), qos(quality)

    def wait(self, topic: str, count: int = 1, timeout: float = 180.0) -> list[bytes]:
        self.until(
            lambda: len(self.heard[topic]) >= count, f"{count} messages on {topic}", timeout
        )
        return self.heard[topic]

    def until(self, condition, what: str, timeout: float = 180.0) -> None:
        deadline = time.monotonic() + timeout
        while not condition():
            assert time.monotonic() < deadline, f"waited {timeout} s for {what}"
            time.sleep(0.02)

    def call_later(self, kind, name: str, request):
        if (
            name not in self._callers
        ):  # one for all calls of a service, so that they arrive in order
            self._callers[name] = self.node.create_client(kind, name)
            assert self._callers[name].wait_for_service(180.0), name
            until_known_at(self.node, name.rpartition("/")[0], self._wait)
        return self._callers[name].call_async(request)

    @staticmethod
    def _wait(answer) -> None:
        """Wait for what the executor's thread does, a second at most."""
        done = threading.Event()
        answer.add_done_callback(lambda _: done.set())
        done.wait(1.0)

    def call(self, kind, name: str, request, timeout: float = 180.0):
        future = self.call_later(kind, name, request)
        self.until(future.done, f"an answer of {name}", timeout)
        return future.result()

    def statuses(self, topic: str = "/diagnostics"):
        """All statuses that were heard so far."""
        from msg_conventions.diagnostics import decode_diagnostics

        return [
            status for data in list(self.heard[topic]) for status in decode_diagnostics(data)[1]
        ]

    def infos(self):
        """All entries and summaries that were heard so far."""
        from msg_conventions.scenario_info import decode_info

        return [decode_info(data) for data in list(self.heard["/scenarios/info"])]

    def counted(self, topic: str, node: str = "/recorder") -> int:
        """How many messages of a topic a recorder says are in its bag."""
        if not self.heard["/diagnostics"]:
            self.hear("/diagnostics")
            self.wait("/diagnostics")
        return max(
            (
                int(s.values.get(topic, 0))
                for s in self.statuses()
                if s.name == f"{node}: recorded"
            ),
            default=0,
        )

    def generate_later(self, **values):
        """Ask the sampler for scenarios; return the future."""
        from rcl_interfaces.srv import SetParametersAtomically
        from rclpy.parameter import Parameter

        parameters = [
            Parameter(key, value=value).to_parameter_msg() for key, value in values.items()
        ]
        request = SetParametersAtomically.Request(parameters=parameters)
        return self.call_later(SetParametersAtomically, "/gp_sampler/generate", request)

    def generate(self, **values):
        """Ask the sampler for scenarios; return its answer."""
        future = self.generate_later(**values)
        self.until(future.done, "an answer of the sampler", 600.0)
        return future.result().result

    def close(self) -> None:
        self.executor.shutdown(timeout_sec=2.0)
        self.thread.join(2.0)
        self.node.destroy_node()
        self.context.try_shutdown()


def memory(pid: int, key: str) -> int:
    """Return VmRSS or VmHWM [kB] of a process; 0 if it is gone."""
    path = Path("/proc") / str(pid) / "status"
    lines = path.read_text().splitlines() if path.exists() else ()
    return next((int(line.split()[1]) for line in lines if line.startswith(key)), 0)
