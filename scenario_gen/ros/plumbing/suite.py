# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Run the whole suite for some jobs, over DDS, into one bag: the recorder in one process, all other nodes in another."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
import multiprocessing
from multiprocessing.process import BaseProcess
import os
from pathlib import Path
import shutil
import signal
import sys
import tempfile
import time
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
import yaml

from msg_conventions.diagnostics import decode_diagnostics, Level, Status
from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.base.interrupts import end_with_parent, ending, starting
from scenario_gen.base.parameters import flatten
from scenario_gen.base.ros_domain import own_domain
from scenario_gen.method.config import PipelineConfig
from scenario_gen.ros.plumbing.ros_parameters import config_of
from scenario_gen.ros.plumbing.start import node_class, start
from scenario_gen.ros.plumbing.topics import create_subscription

NODES = ("gp_sampler", "planner", "segmenter", "road_server", "log_player")
# who must have spoken before the next one can: topic -> node
CHAIN = {
    "tracks": "log_player",
    "map": "road_server",
    "changepoints": "segmenter",
    "fit": "planner",
    "scenarios/info": "gp_sampler",
}
END_S = 30.0  # seconds that a process has to end by itself
POLL_S = 0.2
Tell = Callable[[str], None]


@dataclass(frozen=True)
class Job:
    """One template on one road, in a namespace of its own such as `/case_1`."""

    namespace: str
    log: Path
    road: str
    encounter: int = 0


@dataclass
class Progress:
    """What has been heard of the jobs so far."""

    jobs: Sequence[Job]
    tell: Tell
    heard: set[str] = field(default_factory=set)  # topics, by their full names
    published: dict[str, int] = field(default_factory=dict)  # scenarios, by namespace
    recorded: dict[str, int] = field(default_factory=dict)  # messages in the bag, by topic
    told: dict[str, str] = field(
        default_factory=dict
    )  # messages by status: /diagnostics has all again every second

    def complete(self) -> bool:
        """Say whether every job's scenarios have been published and recorded."""
        return all(
            (count := self.published.get(job.namespace)) is not None
            and self.recorded.get(f"{job.namespace}/scenarios", 0) >= count
            and self.recorded.get(f"{job.namespace}/scenarios/info", 0) > count
            for job in self.jobs
        )

    def late(self) -> str:
        """Return the first node of the chain that has not answered, and for which job."""
        for job in self.jobs:
            for topic, node in CHAIN.items():
                if f"{job.namespace}/{topic}" not in self.heard:
                    return f"{job.namespace}/{node}"
        return "/recorder"

    def take(self, topic: str, data: bytes) -> None:
        """Take a message in.

        Raises:
            InputError, RefusedError: a node reports an error of that kind.
        """
        self.heard.add(topic)
        if not topic.endswith(("/diagnostics", "/info")):
            return
        for status in decode_diagnostics(data)[1]:
            if topic == "/diagnostics":
                self._take_status(status)
            elif "published" in status.values:
                self.published[topic.removesuffix("/scenarios/info")] = int(
                    status.values["published"]
                )
                self.tell(f"{topic.removesuffix('/scenarios/info')}: {status.message}")

    def _take_status(self, status: Status) -> None:
        if status.name == "/recorder: recorded":
            self.recorded = {name: int(count) for name, count in status.values.items()}
        elif status.level >= Level.ERROR:
            error = InputError if status.values.get("error") == "InputError" else RefusedError
            raise error(f"{status.name}: {status.message}")
        elif (
            "progress" in status.name
            and "request" in status.values
            and self.told.get(status.name) != status.message
        ):
            self.told[status.name] = status.message
            self.tell(f"{status.name.partition(':')[0]}: {status.message}")


def parameters(
    jobs: Sequence[Job], config: PipelineConfig, count: int, seed: int, bag: Path
) -> dict[str, Any]:
    """Return the parameter file of the suite: of every node what it declares of the pipeline's parameters."""
    values = {name: value for name, (_, value) in flatten(config).items()} | {
        "count": count,
        "seed": seed,
    }
    common = {
        node: {
            name: values[name] for name in flatten(config_of(node_class(node))) if name in values
        }
        for node in NODES
    }
    result: dict[str, Any] = {"/recorder": {"bag": str(bag)}}
    for job in jobs:
        own = {
            "log_player": {"log_path": str(job.log.resolve()), "encounter": job.encounter},
            "road_server": {"road_name": job.road, "wait_for_tracks": True},
        }
        result |= {f"{job.namespace}/{node}": common[node] | own.get(node, {}) for node in NODES}
    return {name: {"ros__parameters": body} for name, body in result.items()}


def run_suite(
    jobs: Sequence[Job],
    config: PipelineConfig,
    *,
    count: int,
    seed: int,
    bag: Path,
    timeout: float = 300.0,
    progress: Tell = lambda _: None,
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
        with ending(partial(shutil.rmtree, scratch, ignore_errors=True)), own_domain():
            file = scratch / "parameters.yaml"
            file.write_text(
                yaml.safe_dump(parameters(jobs, config, count, seed, scratch / bag.name)),
                encoding="utf-8",
            )
            spaces = [word for job in jobs for word in ("--namespace", job.namespace)]
            words = ["--ros-args", "--params-file", str(file)]
            commands = (
                ["recorder", *words],
                ["suite", "--nodes", ",".join(NODES), *spaces, *words],
            )
            with (
                _watched(Progress(jobs, progress)) as (state, look),
                _processes(commands, scratch) as processes,
            ):
                _follow(processes, state, look, scratch, timeout)
        bag.parent.mkdir(parents=True, exist_ok=True)
        shutil.move(scratch / bag.name, bag)
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
    return bag


@contextmanager
def _watched(state: Progress) -> Iterator[tuple[Progress, Callable[[], None]]]:
    """Let a node of this process listen to the suite; the function given looks at what has arrived."""
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = rclpy.create_node("watcher", enable_rosout=False, start_parameter_services=False)
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        for topic in (
            "/diagnostics",
            *(f"{job.namespace}/{topic}" for job in state.jobs for topic in CHAIN),
        ):
            create_subscription(node, topic, partial(state.take, topic))
        yield state, lambda: executor.spin_once(timeout_sec=POLL_S)
        node.destroy_node()
    finally:
        rclpy.try_shutdown()


@contextmanager
def _processes(
    commands: Sequence[list[str]], scratch: Path
) -> Iterator[Mapping[str, BaseProcess]]:
    """Run nodes as processes of their own, as their executables do; Ctrl-C ends those that are left at the end, in order."""
    context = multiprocessing.get_context("spawn")
    processes = {}
    for name, *words in commands:
        log = scratch / f"{name}.log"
        processes[name] = context.Process(target=_become, args=([name, *words], str(log)))
    with ending(partial(_end, list(processes.values()))):
        try:
            with starting():
                for process in processes.values():
                    process.start()
            yield processes
        finally:
            _end(list(processes.values()))


def _become(words: list[str], log: str) -> None:
    """Turn a new process into an executable of nodes whose output is in a file."""
    end_with_parent()
    descriptor = os.open(log, os.O_WRONLY | os.O_CREAT, 0o644)
    os.dup2(descriptor, 1)
    os.dup2(descriptor, 2)
    os.environ |= {"ROS_LOG_DIR": str(Path(log).with_suffix("")), "RCUTILS_COLORIZED_OUTPUT": "0"}
    sys.argv = words
    start(words[0])


def _end(processes: Sequence[BaseProcess]) -> None:
    for number in (signal.SIGINT, signal.SIGKILL):
        alive = [
            process for process in processes if process.pid is not None and process.is_alive()
        ]
        for process in alive:
            with suppress(ProcessLookupError):
                os.kill(process.pid or 0, number)
        for process in alive:
            process.join(END_S)


def _follow(
    processes: Mapping[str, BaseProcess],
    state: Progress,
    look: Callable[[], None],
    scratch: Path,
    timeout: float,
) -> None:
    """Wait until every job is done and recorded.

    Raises:
        InputError, RefusedError: it never will be.
    """
    deadline = time.monotonic() + timeout
    while not state.complete():
        look()
        for name, process in processes.items():
            if not process.is_alive():
                raise RefusedError(
                    f"{name} ended with code {process.exitcode}{_tail(scratch, name)}"
                )
        if time.monotonic() > deadline:
            late = state.late()
            name = "recorder" if late == "/recorder" else "suite"
            raise RefusedError(
                f"{late} did not answer within {timeout:.0f} s{_tail(scratch, name)}"
            )


def _tail(scratch: Path, name: str) -> str:
    """Return the last lines that a process wrote, to put behind a message."""
    path = scratch / f"{name}.log"
    lines = (
        path.read_text(encoding="utf-8", errors="replace").splitlines()[-5:]
        if path.is_file()
        else []
    )
    return "; its last output: " + " | ".join(lines) if lines else ""
