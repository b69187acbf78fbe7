# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A large request through a suite and a recorder: nothing is lost, and no node grows.

`SCENARIO_GEN_SOAK_COUNT` is the larger request (100,000 unless given: about 15 minutes and 3 GB of disk on an idle machine).
"""

from collections.abc import Iterator
from functools import partial
import os
from pathlib import Path
import shutil
import time
from typing import Any

from figures import Figure, kept
from support.suite_processes import Client, memory, whole_chain

from msg_conventions.diagnostics import decode_diagnostics
from scenario_gen.bags.storage.bag import bag_topics
from scenario_gen.base.ros_domain import free_domain

COUNT = int(os.environ.get("SCENARIO_GEN_SOAK_COUNT", "100000"))
MOST = 1024  # MiB of any process
PATIENCE = 7200.0  # seconds for one request
TOPICS = {
    "/scenarios": 0,
    "/scenarios/info": 1,
}  # and how many messages it has beside one for each scenario
NODES = (
    "recorder",
    "evaluator",
    "gp_sampler",
    "planner",
    "segmenter",
    "road_server",
    "log_player",
)


def run(state: Path) -> Iterator[Figure]:
    """Do what has not been done yet."""
    found = kept(state / f"many_{COUNT}.json", partial(_measured, state / "many"))
    name, told = f"{COUNT:,} scenarios", f"{found['lost']} messages; {found['said']}"
    yield Figure(f"{name}: lost on the way to the bag", "0", told, found["lost"] == 0)
    yield Figure(
        f"{name}: the evaluator's report", "comes", found["report"], "samples" in found["report"]
    )
    sizes = ", ".join(
        f"{node} {size}" for node, size in sorted(found["peak"].items(), key=lambda one: -one[1])
    )
    yield Figure(
        f"{name}: peak memory [MiB]",
        f"at most {MOST} each",
        sizes,
        max(found["peak"].values()) <= MOST,
    )


def _measured(folder: Path) -> dict[str, Any]:
    """Ask for all, wait for the report, end the nodes, and look at the bag."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    with free_domain() as domain:
        client = Client(domain)
        client.hear("/report", "/diagnostics")
        suite = next(whole_chain(folder, domain, NODES, count=COUNT))
        started = time.monotonic()
        while not client.heard["/report"] and time.monotonic() < started + PATIENCE:
            time.sleep(1.0)
        seconds = time.monotonic() - started
        peak = {node: memory(pid, "VmHWM") // 1024 for node, pid in suite.pids.items()}
        suite.end()
        client.close()
    rows = [status for data in client.heard["/report"] for status in decode_diagnostics(data)[1]]
    said = {
        status.message for status in client.statuses() if status.level and "lost" in status.message
    }
    there = {topic.name: topic.count for topic in bag_topics(folder / "bag")}
    shutil.rmtree(folder)
    return {
        "lost": sum(max(0, COUNT + more - there.get(topic, 0)) for topic, more in TOPICS.items()),
        "said": f"{len(said)} warnings of losses, {seconds:.0f} s",
        "report": f"{rows[-1].values['samples']} samples; {rows[-1].message}" if rows else "none",
        "peak": peak,
    }
