# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Run the whole suite for some jobs, as separate processes over DDS, into one bag; the demo's way."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
import json
import os
from pathlib import Path
import select
import shutil
import subprocess
import sys
import tempfile
import time
from typing import Any

import yaml

from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.base.interrupts import ending
from scenario_gen.base.parameters import flatten
from scenario_gen.base.ros_domain import free_domain, this_host_only
from scenario_gen.pipeline import PipelineConfig

NODES = ("recorder", "watcher", "gp_sampler", "planner", "segmenter", "road_server", "log_player")
# who must have spoken before the next one can: topic -> node
CHAIN = {"tracks": "log_player", "map": "road_server", "changepoints": "segmenter", "fit": "planner", "scenarios": "gp_sampler"}
SECTIONS = {
    "log_player": ("log",),
    "road_server": ("road",),
    "segmenter": ("segmentation",),
    "planner": ("fitting", "planning"),
    "gp_sampler": ("fitting", "planning", "sampling", "limits"),
}


@dataclass(frozen=True)
class Job:
    """One template on one road, in a namespace of its own such as `/case_1`."""

    namespace: str
    log: Path
    road: str
    encounter: int = 0


@dataclass
class _State:
    """What is known of the jobs so far."""

    published_topics: dict[str, set[str]]
    published: dict[str, int] = field(default_factory=dict)
    recorded: dict[str, int] = field(default_factory=dict)

    def complete(self) -> bool:
        """Say whether every job's scenarios have been published and recorded."""
        return all(
            namespace in self.published
            and self.recorded.get(f"{namespace}/scenarios", 0) >= self.published[namespace]
            and self.recorded.get(f"{namespace}/scenarios/info", 0) > self.published[namespace]
            for namespace in self.published_topics
        )

    def waiting_for(self) -> str:
        """Return the first node of the chain that has not answered, and for which job."""
        for namespace, topics in self.published_topics.items():
            for topic, node in CHAIN.items():
                if topic not in topics:
                    return f"{namespace}/{node}"
        return "/recorder"


def parameters(jobs: Sequence[Job], config: PipelineConfig, count: int, seed: int, bag: Path) -> dict[str, Any]:
    """Return the parameter file of the suite."""
    values = {name: value for name, (_, value) in flatten(config).items()}
    common = {node: {n: v for n, v in values.items() if n.split(".")[0] in heads} for node, heads in SECTIONS.items()}
    for node in ("segmenter", "planner", "gp_sampler"):
        common[node]["seed"] = seed
    common["gp_sampler"]["count"] = count
    common["road_server"]["wait_for_tracks"] = True
    result: dict[str, Any] = {"/recorder": {"bag": str(bag)}}
    for job in jobs:
        own: dict[str, dict[str, Any]] = {
            "log_player": {"log_path": str(job.log.resolve()), "encounter": job.encounter},
            "road_server": {"road_name": job.road},
        }
        for node in SECTIONS:
            result[f"{job.namespace}/{node}"] = common[node] | own.get(node, {})
    return {name: {"ros__parameters": body} for name, body in result.items()}


def run_suite(
    jobs: Sequence[Job],
    config: PipelineConfig,
    *,
    count: int,
    seed: int,
    bag: Path,
    timeout: float = 300.0,
    progress: Callable[[str], None] | None = None,
) -> Path:
    """Generate `count` scenarios for every job with the ROS nodes and record all their topics in the bag `bag`.

    Args:
        jobs: what to do, each in its own namespace.
        config: parameters of the stages.
        count: scenarios per job.
        seed: of every stage.
        bag: folder to record to; it must not exist.
        timeout: seconds after which the suite is given up.
        progress: called with a sentence now and then.

    Returns:
        `bag`, closed and complete.

    Raises:
        InputError: a node was given something it cannot use.
        RefusedError: a stage refused a job, a node died, or one did not answer in time; the message names it.
    """
    if bag.exists():
        raise InputError(f"{bag} exists already; name another folder for the bag, or remove it")
    scratch = Path(tempfile.mkdtemp(prefix="scenario_gen_suite_"))
    try:
        with free_domain() as domain, ending(partial(shutil.rmtree, scratch, ignore_errors=True)):
            body = parameters(jobs, config, count, seed, scratch / bag.name)
            _run(jobs, body, scratch, domain, timeout, progress or (lambda _: None))
        bag.parent.mkdir(parents=True, exist_ok=True)
        shutil.move(scratch / bag.name, bag)
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
    return bag


def _run(
    jobs: Sequence[Job], body: dict[str, Any], scratch: Path, domain: int, timeout: float, progress: Callable[[str], None]
) -> None:
    parameter_file = scratch / "parameters.yaml"
    parameter_file.write_text(yaml.safe_dump(body), encoding="utf-8")
    spaces = [word for job in jobs for word in ("--namespace", job.namespace)]
    ros = ["--ros-args", "--params-file", str(parameter_file)]
    arguments = {node: [*spaces, *ros] for node in NODES} | {"recorder": ros, "watcher": ["--namespace", "", *spaces]}
    specification = [{"node": node, "arguments": arguments[node], "log": str(scratch / f"{node}.log")} for node in NODES]
    (scratch / "suite.json").write_text(json.dumps(specification), encoding="utf-8")
    environment = {
        **os.environ,
        **this_host_only(),
        "ROS_DOMAIN_ID": str(domain),
        "ROS_LOG_DIR": str(scratch / "log"),
        "RCUTILS_COLORIZED_OUTPUT": "0",
    }
    suite = subprocess.Popen(
        [sys.executable, "-m", "scenario_gen.ros.plumbing.start", "fork", str(scratch / "suite.json")],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=(scratch / "suite.log").open("w"),
        env=environment,
    )
    state = _State({job.namespace: set() for job in jobs})
    with ending(partial(_end, suite)):
        try:
            _follow(suite, state, scratch, timeout, progress)
        finally:
            _end(suite)


def _end(suite: "subprocess.Popen[bytes]") -> None:
    if suite.stdin is not None:
        suite.stdin.close()  # its end ends the suite, even where this process is killed
    suite.terminate()  # while it loads it does not look there
    try:
        suite.wait(30.0)
    except subprocess.TimeoutExpired:
        suite.kill()
        suite.wait()


def _follow(
    suite: "subprocess.Popen[bytes]", state: _State, scratch: Path, timeout: float, progress: Callable[[str], None]
) -> None:
    """Read events until every job is done and recorded."""
    assert suite.stdout is not None
    deadline = time.monotonic() + timeout
    buffer = b""
    while not state.complete():
        ready, _, _ = select.select([suite.stdout], [], [], max(0.0, deadline - time.monotonic()))
        if not ready:
            late = state.waiting_for()
            raise RefusedError(f"{late} did not answer within {timeout:.0f} s{_tail(scratch, late)}")
        data = os.read(suite.stdout.fileno(), 65536)
        if not data:
            raise RefusedError(f"the nodes ended before they were done{_tail(scratch, 'suite')}")
        *lines, buffer = (buffer + data).split(b"\n")
        for line in lines:
            _take(json.loads(line), state, scratch, progress)


def _take(event: dict[str, Any], state: _State, scratch: Path, progress: Callable[[str], None]) -> None:
    """Take one event in."""
    kind = event["event"]
    if kind == "published":
        state.published_topics[event["namespace"]].add(event["topic"])
    elif kind == "done":
        state.published_topics[event["namespace"]].add("scenarios")
        state.published[event["namespace"]] = event["published"]
        progress(f"{event['namespace']}: {event['text']}")
    elif kind == "recorded":
        state.recorded = event["counts"]
    elif kind == "loaded":
        progress(f"libraries and {event['kernels']} kernels loaded")
    elif kind == "progress":
        progress(f"{event['name'].partition(':')[0]}: {event['text']}")
    elif kind == "exited":
        raise RefusedError(f"{event['node']} ended with code {event['code']}{_tail(scratch, event['node'])}")
    elif kind == "error":
        error = InputError if event["kind"] == "InputError" else RefusedError
        raise error(f"{event['name']}: {event['text']}")


def _tail(scratch: Path, node: str) -> str:
    """Return the last lines a node wrote, to put behind a message."""
    path = scratch / f"{node.rpartition('/')[2]}.log"
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()[-5:] if path.is_file() else []
    return "; its last output: " + " | ".join(lines) if lines else ""
