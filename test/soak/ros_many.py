# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Large requests through real processes, and through a suite composed in one: nothing is lost, and no node grows.

`SCENARIO_GEN_SOAK_COUNT` is the larger request (100,000 unless given: about 15 minutes and 3 GB of disk on an idle machine).
"""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
import os
from pathlib import Path
import shutil
import signal
import subprocess
import sys
import time
from typing import Any

from figures import Figure, kept
from ros_hostile import memory
from suite_processes import Client, Processes, RESOURCES

from scenario_gen.bags.storage.bag import bag_topics
from scenario_gen.base.ros_domain import free_domain

COUNT = int(os.environ.get("SCENARIO_GEN_SOAK_COUNT", "100000"))
COMPOSED = max(1, COUNT // 10)
MOST = 1024  # MiB of any process
PATIENCE = 7200.0  # seconds for one request
TOPICS = {"/scenarios": 0, "/scenarios/info": 1}  # and how many messages it has beside one for each scenario
VALUES = {"log_path": RESOURCES / "synthetic_c", "road_name": "straight", "wait_for_tracks": "true", "seed": 7}


def run(state: Path) -> Iterator[Figure]:
    """Do what has not been done yet."""
    for name, count, measure in (("many", COUNT, _processes), ("composed", COMPOSED, _composed)):
        found = kept(state / f"{name}_{count}.json", partial(measure, state / name, count))
        yield from _figures(f"{count:,} scenarios, {name}", found)


def _figures(name: str, found: dict[str, Any]) -> Iterator[Figure]:
    told = f"{found['lost']} messages; {found['said']}"
    yield Figure(f"{name}: lost on the way to the bag", "0", told, found["lost"] == 0)
    yield Figure(f"{name}: the evaluator's report", "comes", found["report"], "samples" in found["report"])
    sizes = ", ".join(f"{node} {size}" for node, size in sorted(found["peak"].items(), key=lambda one: -one[1]))
    yield Figure(f"{name}: peak memory [MiB]", f"at most {MOST} each", sizes, max(found["peak"].values()) <= MOST)


def _processes(folder: Path, count: int) -> dict[str, Any]:
    """One process for each node."""
    values = [word for key in ("road_name", "wait_for_tracks") for word in ("-p", f"{key}:={VALUES[key]}")]
    nodes = {
        "recorder": ["-p", f"bag:={folder / 'bag'}"],
        "evaluator": [],
        "gp_sampler": ["-p", f"count:={count}", "-p", f"seed:={VALUES['seed']}"],
        "planner": [],
        "segmenter": [],
        "road_server": values,
        "log_player": ["-p", f"log_path:={VALUES['log_path']}"],
    }
    with free_domain() as domain, _client(domain, folder) as client:
        made = Processes(folder, domain, nodes)
        return _followed(client, folder, count, made.pids, made.end)


def _composed(folder: Path, count: int) -> dict[str, Any]:
    """All nodes in one process."""
    values = VALUES | {"count": count, "recorder:bag": folder / "bag"}
    words = [word for key, value in values.items() for word in ("-p", f"{key}:={value}")]
    with free_domain() as domain, _client(domain, folder) as client, (folder / "log").open("w") as log:
        suite = subprocess.Popen(
            [sys.executable, "-m", "scenario_gen.ros.plumbing.start", "suite", "--ros-args", *words],
            env=os.environ | {"ROS_DOMAIN_ID": str(domain)},
            stdout=log,
            stderr=subprocess.STDOUT,
        )

        def end() -> None:
            suite.send_signal(signal.SIGINT)
            suite.wait(300.0)

        return _followed(client, folder, count, {"suite": suite.pid}, end)


@contextmanager
def _client(domain: int, folder: Path) -> Iterator[Client]:
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    client = Client(domain)
    client.hear("/report", "/diagnostics")
    try:
        yield client
    finally:
        client.close()
        shutil.rmtree(folder)


def _followed(client: Client, folder: Path, count: int, pids: dict[str, int], end: Any) -> dict[str, Any]:
    """Wait for the report, end the nodes, and look at the bag."""
    from msg_conventions.diagnostics import decode_diagnostics

    deadline = time.monotonic() + PATIENCE
    started = time.monotonic()
    while not client.heard["/report"] and time.monotonic() < deadline:
        time.sleep(1.0)
    seconds = time.monotonic() - started
    peak = {node: memory(pid, "VmHWM") // 1024 for node, pid in pids.items()}
    end()
    rows = [status for data in client.heard["/report"] for status in decode_diagnostics(data)[1]]
    said = {
        s.message for data in client.heard["/diagnostics"] for s in decode_diagnostics(data)[1] if s.level and "lost" in s.message
    }
    there = {topic.name: topic.count for topic in bag_topics(folder / "bag")}
    return {
        "lost": sum(max(0, count + more - there.get(topic, 0)) for topic, more in TOPICS.items()),
        "said": f"{len(said)} warnings of losses, {seconds:.0f} s",
        "report": f"{rows[-1].values['samples']} samples; {rows[-1].message}" if rows else "none",
        "peak": peak,
    }
