# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Start and end of the nodes, as separate processes and composed: with kernels in the cache and without, and at a load of 16.

Figures of the clock depend on what else the machine does, so the seconds of the CPU stand beside them.
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

from benchmarks._messages_processes import environment
from benchmarks._size import sized
from benchmarks.messages import _Client, _done
from benchmarks.row import lower, Row
from scenario_gen.bags.storage.bag import read_messages
from scenario_gen.base.ros_domain import free_domain, this_host_only

NODES = ("evaluator", "gp_sampler", "planner", "segmenter", "road_server", "log_player")[
    sized(0, quick=5) :
]
LOAD = sized(16, quick=1)
LAUNCH = 5.0  # seconds that launch gives a node after Ctrl-C, and once more after SIGTERM
BARE = "import rclpy\nrclpy.init()\nnode = rclpy.create_node('bare')\ntry:\n    rclpy.spin(node)\nexcept BaseException:\n    pass"
Process = subprocess.Popen[bytes]


def run() -> list[Row]:
    """Measure."""
    os.environ.update(this_host_only())
    with tempfile.TemporaryDirectory() as folder, free_domain() as domain:
        place = Path(folder)
        peer = _peer(place, domain)
        rows = _start("six nodes, warm", place, domain, [[node] for node in NODES], 5.0, peer)
        rows += _start(
            "composed suite, warm",
            place,
            domain,
            [["suite", "--nodes", ",".join(NODES)]],
            3.0,
            peer,
        )
        if sized(True, quick=False):
            rows += _start(
                "six nodes, cold", place, domain, [[node] for node in NODES], None, peer, cold=True
            )
        return rows + _exit(place, domain, peer)


@contextmanager
def _running(
    folder: Path, domain: int, commands: Sequence[Sequence[str]], **variables: str
) -> Iterator[list[Process]]:
    """Start processes together; whatever is left of them at the end is killed."""
    variables = environment(domain) | {"ROS_LOG_DIR": str(folder)} | variables
    with (folder / "nodes.log").open("ab") as log:
        processes = [
            subprocess.Popen([sys.executable, *words], stdout=log, stderr=log, env=variables)
            for words in commands
        ]
    try:
        yield processes
    finally:
        for process in processes:
            process.kill()
            process.wait()


def _cpu(pid: int) -> float:
    """Seconds of the CPU that a process and those of its children that have ended have used."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")


def _active(client: _Client, nodes: Sequence[str]) -> None:
    """Wait until all nodes are active; rclpy's own `wait_for_service` looks only every 0.25 s."""
    from lifecycle_msgs.srv import GetState

    services = {node: client.node.create_client(GetState, f"{node}/get_state") for node in nodes}
    waiting = set(nodes)
    while waiting:
        for node in sorted(waiting):
            if services[node].service_is_ready():
                state = _done(services[node].call_async(GetState.Request()))
                waiting -= {node} if state.current_state.label == "active" else set()
        time.sleep(0.02)
    for service in services.values():
        client.node.destroy_client(service)


def _start(
    name: str,
    folder: Path,
    domain: int,
    which: list[list[str]],
    target: float | None,
    peer: str,
    *,
    cold: bool = False,
) -> list[Row]:
    commands = [["-m", "scenario_gen.ros.common.start", *words] for words in which]
    with tempfile.TemporaryDirectory() as cache, _Client(domain) as client:
        variables = {"NUMBA_CACHE_DIR": cache} if cold else {}
        started = time.monotonic()
        with _running(folder, domain, commands, **variables) as processes:
            _active(client, NODES)
            wall, used = (
                time.monotonic() - started,
                sum(_cpu(process.pid) for process in processes),
            )
            for process in processes:
                process.send_signal(signal.SIGINT)
            for process in processes:
                process.wait(60.0)
    return [
        lower(f"{name}: all active", wall, "s", target, peer),
        lower(f"{name}: CPU until all are active", used, "s", None, peer),
    ]


def _peer(folder: Path, domain: int) -> str:
    """What a node of rclpy's with nothing in it takes."""
    from rcl_interfaces.srv import ListParameters

    with _Client(domain) as client:
        service = client.node.create_client(ListParameters, "bare/list_parameters")
        started = time.monotonic()
        with _running(folder, domain, [["-c", BARE]]) as (process,):
            service.wait_for_service(60.0)
            wall, used = time.monotonic() - started, _cpu(process.pid)
            started = time.monotonic()
            process.send_signal(signal.SIGINT)
            process.wait(60.0)
            gone = time.monotonic() - started
    return f"one bare rclpy node: there after {wall:.1f} s, {used:.2f} s of CPU; gone {gone:.2f} s after Ctrl-C"


def _exit(folder: Path, domain: int, peer: str) -> list[Row]:
    """End the nodes and a recorder as launch does, beside busy loops."""
    bag = folder / "bag"
    commands = [["-m", "scenario_gen.ros.common.start", node] for node in NODES]
    record = [
        "-m",
        "scenario_gen.ros.common.start",
        "recorder",
        "--ros-args",
        "-p",
        f"bag:={bag}",
        "-p",
        "topics:=.*",
    ]
    with _running(folder, domain, [*commands, record]) as processes, _Client(domain) as client:
        _active(client, NODES)
        while not list(bag.glob("*.mcap")):
            time.sleep(0.1)
        with _running(folder, domain, [["-c", "while True: pass"]] * LOAD):
            time.sleep(sized(3.0, quick=0.1))
            started, used = (
                time.monotonic(),
                {process.pid: _cpu(process.pid) for process in processes},
            )
            slowest, killed = 0.0, 0
            for number in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
                left = [process for process in processes if process.poll() is None]
                killed += len(left) if number is signal.SIGKILL else 0
                for process in left:
                    process.send_signal(number)
                deadline = time.monotonic() + LAUNCH
                while (
                    any(process.poll() is None for process in left) and time.monotonic() < deadline
                ):
                    time.sleep(0.01)
                slowest = time.monotonic() - started if left else slowest
    whole = len(list(read_messages(bag))) if killed == 0 else 0
    words = f"{len(used)} processes at a load of {LOAD} on {os.cpu_count()} cores; {whole} messages in the bag; {peer}"
    return [
        lower("the slowest node ends after Ctrl-C, machine busy", slowest, "s", LAUNCH, words),
        lower("nodes that launch would have killed, machine busy", killed, "nodes", 0.0, words),
    ]
