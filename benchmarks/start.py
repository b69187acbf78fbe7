# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Start of the nodes, as separate processes and composed, with cached kernels and without.

Wall time depends on the load of the machine, so CPU time is measured, too.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
import os
from pathlib import Path
import signal
import subprocess
import sys
import tempfile
import time

from benchmarks._size import sized
from benchmarks._suite_processes import Client, environment, result_of
from benchmarks.row import higher, lower, Row
from scenario_gen.bags.storage.bag import read_messages
from scenario_gen.base.ros_domain import free_domain, this_host_only

NODES = ("evaluator", "gp_sampler", "planner", "segmenter", "road_server", "log_player")[
    sized(0, quick=5) :
]
BARE = "import rclpy\nrclpy.init()\nrclpy.spin(rclpy.create_node('bare'))"
LOAD = sized(16, quick=1)
LAUNCH_S = 5.0
"""Launch gives a node this time after Ctrl-C, and once more after SIGTERM."""
IDLE_S = sized(10.0, quick=0.1)
Process = subprocess.Popen[bytes]


def run() -> list[Row]:
    """Measure."""
    os.environ.update(this_host_only())
    single = [[node] for node in NODES]
    composed = [["suite", "--nodes", ",".join(NODES)]]
    with tempfile.TemporaryDirectory() as folder, free_domain() as domain:
        place = Path(folder)
        peer = _bare_node(place, domain)
        rows = _start("six nodes, warm", place, domain, single, 5.0, peer)
        rows += _start("composed suite, warm", place, domain, composed, 3.0, peer)
        if sized(True, quick=False):
            with tempfile.TemporaryDirectory() as cache:
                rows += _start("six nodes, cold", place, domain, single, None, peer, cache)
        return [*rows, *_exit(place, domain)]


@contextmanager
def _running(
    folder: Path, domain: int, commands: Sequence[Sequence[str]], cache: str = ""
) -> Iterator[list[Process]]:
    """Start processes together; they are interrupted, and killed if they do not end."""
    variables = environment(domain) | {"ROS_LOG_DIR": str(folder)}
    variables |= {"NUMBA_CACHE_DIR": cache} if cache else {}
    with (folder / "nodes.log").open("ab") as log:
        processes = [
            subprocess.Popen([sys.executable, *words], stdout=log, stderr=log, env=variables)
            for words in commands
        ]
    try:
        yield processes
        for process in processes:
            process.send_signal(signal.SIGINT)
        for process in processes:
            process.wait(60.0)
    finally:
        for process in processes:
            process.kill()
            process.wait()


def _cpu(processes: Sequence[Process]) -> float:
    """Return the CPU seconds that processes and their ended children have used."""
    texts = [Path(f"/proc/{process.pid}/stat").read_text() for process in processes]
    ticks = [int(field) for text in texts for field in text.rpartition(")")[2].split()[11:15]]
    return sum(ticks) / os.sysconf("SC_CLK_TCK")


def _wait_for_active(client: Client, nodes: Sequence[str]) -> None:
    """Wait until all nodes are active; rclpy's `wait_for_service` looks only every 0.25 s."""
    from lifecycle_msgs.srv import GetState

    services = {node: client.node.create_client(GetState, f"{node}/get_state") for node in nodes}
    waiting = set(nodes)
    while waiting:
        for node in sorted(waiting):
            if services[node].service_is_ready():
                state = result_of(services[node].call_async(GetState.Request()))
                waiting -= {node} if state.current_state.label == "active" else set()
        time.sleep(0.02)
    for service in services.values():
        client.node.destroy_client(service)


def _start(
    name: str,
    folder: Path,
    domain: int,
    arguments: list[list[str]],
    target: float | None,
    peer: str,
    cache: str = "",
) -> list[Row]:
    """Start nodes, wait until they are active, then leave them idle."""
    commands = [["-m", "scenario_gen.ros.common.start", *words] for words in arguments]
    with Client(domain) as client:
        started = time.monotonic()
        with _running(folder, domain, commands, cache) as processes:
            _wait_for_active(client, NODES)
            wall, used = time.monotonic() - started, _cpu(processes)
            time.sleep(IDLE_S)
            idle = 100.0 * (_cpu(processes) - used) / IDLE_S
    return [
        lower(f"{name}: all active", wall, "s", target, peer),
        lower(f"{name}: CPU until all are active", used, "s", None, peer),
        lower(f"{name}: CPU when idle", idle, "% of a core", 5.0),
    ]


def _exit(folder: Path, domain: int) -> list[Row]:
    """End the nodes and a recorder as launch does, beside busy loops."""
    bag = folder / "bag"
    recorder = ["recorder", "--ros-args", "-p", f"bag:={bag}", "-p", "topics:=.*"]
    started = [[node] for node in NODES]
    commands = [["-m", "scenario_gen.ros.common.start", *words] for words in (*started, recorder)]
    with _running(folder, domain, commands) as processes, Client(domain) as client:
        _wait_for_active(client, NODES)
        while not list(bag.glob("*.mcap")):
            time.sleep(0.1)
        busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(LOAD)]
        began, alive = time.monotonic(), list[Process](processes)
        for number in (signal.SIGINT, signal.SIGTERM):
            for process in alive:
                process.send_signal(number)
            deadline = time.monotonic() + LAUNCH_S
            while alive and time.monotonic() < deadline:
                alive = [process for process in alive if process.poll() is None]
                time.sleep(0.01)
        wall = time.monotonic() - began
        for process in busy:
            process.kill()
            process.wait()
    load = f"{len(processes)} processes at a load of {LOAD} on {os.cpu_count()} cores"
    messages = len(list(read_messages(bag))) if not alive else 0
    return [
        lower("the slowest node ends after Ctrl-C, machine busy", wall, "s", LAUNCH_S, load),
        lower("nodes that launch would have killed, machine busy", len(alive), "nodes", 0.0),
        higher("messages in the readable bag after that", messages, "", 1.0),
    ]


def _bare_node(folder: Path, domain: int) -> str:
    """Return the start time of an empty rclpy node."""
    from rcl_interfaces.srv import ListParameters

    with Client(domain) as client:
        service = client.node.create_client(ListParameters, "bare/list_parameters")
        started = time.monotonic()
        with _running(folder, domain, [["-c", BARE]]) as processes:
            service.wait_for_service(60.0)
            wall, used = time.monotonic() - started, _cpu(processes)
    return f"one bare rclpy node: ready after {wall:.1f} s, {used:.2f} s of CPU"
