# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One large request through real processes into a bag: what is lost, what it costs, and how large the processes become."""

import os
from pathlib import Path
from typing import Any

from benchmarks._messages_processes import nodes
from benchmarks._size import sized
from benchmarks.row import higher, lower, Row
from scenario_gen.bags.storage.bag import bag_topics
from scenario_gen.logs.synthetic import bundled

COUNT = sized(100_000, quick=30)
MOST = 1024.0  # MiB
PATIENCE = 3600.0  # seconds


def many(domain: int, folder: Path, client: Any, until: Any) -> list[Row]:
    """Let the suite work off one request, whose set is published as the inputs are complete."""
    from diagnostic_msgs.msg import DiagnosticArray
    from rclpy.qos import DurabilityPolicy, QoSProfile

    heard: list[bytes] = []
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    client.node.create_subscription(DiagnosticArray, "report", heard.append, latched, raw=True)
    arguments = {
        "recorder": ["-p", f"bag:={folder / 'many'}"],
        "evaluator": [],
        "gp_sampler": ["-p", f"count:={COUNT}"],
        "planner": [],
        "segmenter": [],
        "road_server": ["-p", "road_name:=straight", "-p", "wait_for_tracks:=true"],
        "log_player": ["-p", f"log_path:={bundled('c')}"],
    }
    with nodes(folder, domain, arguments) as suite:
        if not until(lambda: bool(heard), PATIENCE):
            raise RuntimeError(f"no report within {PATIENCE:.0f} s")
        pids = dict(zip(arguments, suite.pids, strict=True))
        peaks = {node: _peak(pid) for node, pid in pids.items()}
        seconds = _cpu_seconds(pids["recorder"])
    (there,) = [topic.count for topic in bag_topics(folder / "many") if topic.name == "/scenarios"]
    sizes = ", ".join(f"{node} {size:.0f}" for node, size in peaks.items())
    name = f"one request of {COUNT:,} scenarios: "
    return [
        lower(f"{name}lost on the way to the bag", COUNT - there, "scenarios", 0.0),
        higher(f"{name}recorded", there / seconds, "1/CPU s"),
        lower(f"{name}largest process", max(peaks.values()), "MiB", MOST, sizes),
    ]


def _peak(pid: int) -> float:
    (line,) = [
        line
        for line in Path(f"/proc/{pid}/status").read_text().splitlines()
        if line.startswith("VmHWM")
    ]
    return int(line.split()[1]) / 1024


def _cpu_seconds(pid: int) -> float:
    user, system = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[11:13]
    return max((int(user) + int(system)) / os.sysconf("SC_CLK_TCK"), 0.01)
