# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Run the suite for some jobs, over DDS, into one bag.

The recorder in one process, all other nodes in another.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
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
import time
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
import yaml

from msg_conventions.diagnostics import decode_diagnostics, Level, Status, Subject
from msg_conventions.scenario_info import decode_info, RequestSummary
from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.base.folders import scratch
from scenario_gen.base.parameters import flatten, values_of
from scenario_gen.base.ros_domain import own_domain
from scenario_gen.base.signals import cleaned_up, ctrl_c_blocked, end_with_parent
from scenario_gen.method.config import PipelineConfig
from scenario_gen.ros.common.ros_parameters import config_of
from scenario_gen.ros.common.start import node_class, start
from scenario_gen.ros.common.topics import create_subscription
from scenario_gen.ros.node_names import GENERATORS

# Each topic is published once the topics before it are: topic -> node.
CHAIN = {
    "tracks": "log_player",
    "map": "road_server",
    "changepoints": "segmenter",
    "fit": "planner",
    "scenarios/info": "gp_sampler",
}
END_S = 30.0  # in which a process has to end by itself
POLL_S = 0.2
Notify = Callable[[str], None]


@dataclass(frozen=True)
class Job:
    """One template on one road, in a namespace of its own such as `/case_1`."""

    namespace: str
    log: Path
    road: str
    encounter: int = 0


@dataclass
class Progress:
    """The progress of the jobs, from the messages of their nodes."""

    jobs: Sequence[Job]
    notify: Notify
    received: set[str] = field(default_factory=set)  # topics, by their full names
    published: dict[str, int] = field(default_factory=dict)  # scenarios, by namespace
    recorded: dict[str, int] = field(default_factory=dict)  # messages in the bag, by topic
    last_messages: dict[str, str] = field(default_factory=dict)  # /diagnostics repeats them

    def complete(self) -> bool:
        """Return whether every job's scenarios have been published and recorded."""
        return all(self._is_complete(job.namespace) for job in self.jobs)

    def _is_complete(self, namespace: str) -> bool:
        count = self.published.get(namespace)
        return (
            count is not None
            and self.recorded.get(f"{namespace}/scenarios", 0) >= count
            and self.recorded.get(f"{namespace}/scenarios/info", 0) > count
        )

    def pending_node(self) -> str:
        """Return the first node of the chain that has published nothing for a job."""
        for job in self.jobs:
            for topic, node in CHAIN.items():
                if f"{job.namespace}/{topic}" not in self.received:
                    return f"{job.namespace}/{node}"
        return "/recorder"

    def receive(self, topic: str, data: bytes) -> None:
        """Update the progress by a message.

        Raises:
            InputError, RefusedError: a node reports an error of that kind.
        """
        self.received.add(topic)
        if topic == "/diagnostics":
            for status in decode_diagnostics(data)[1]:
                self._receive_status(status)
        elif topic.endswith("/scenarios/info"):
            namespace = topic.removesuffix("/scenarios/info")
            info = decode_info(data)
            if isinstance(info, RequestSummary):
                self.published[namespace] = info.published
                self.notify(f"{namespace}: {info.message()}")

    def _receive_status(self, status: Status) -> None:
        if status.subject == Subject.RECORDED:
            self.recorded = {name: int(count) for name, count in status.values.items()}
        elif status.level >= Level.ERROR:
            kind = InputError if status.values.get("error") == "InputError" else RefusedError
            raise kind(f"{status.name}: {status.message}")
        elif (
            status.subject == Subject.PROGRESS
            and "request" in status.values
            and self.last_messages.get(status.node) != status.message
        ):
            self.last_messages[status.node] = status.message
            self.notify(f"{status.node}: {status.message}")


def parameters(
    jobs: Sequence[Job], config: PipelineConfig, count: int, seed: int, bag: Path
) -> dict[str, Any]:
    """Return the suite's parameter file.

    For each node the pipeline's parameters that it declares.
    """
    values = values_of(config)
    values |= {"count": count, "seed": seed}
    common = {}
    for node in GENERATORS:
        declared = flatten(config_of(node_class(node)))
        common[node] = {name: values[name] for name in declared if name in values}

    result: dict[str, Any] = {"/recorder": {"bag": str(bag)}}
    for job in jobs:
        of_job = {
            "log_player": {"log_path": str(job.log.resolve()), "encounter": job.encounter},
            "road_server": {"road_name": job.road, "wait_for_tracks": True},
        }
        for node in GENERATORS:
            result[f"{job.namespace}/{node}"] = common[node] | of_job.get(node, {})
    return {name: {"ros__parameters": body} for name, body in result.items()}


def run_suite(
    jobs: Sequence[Job],
    config: PipelineConfig,
    *,
    count: int,
    seed: int,
    bag: Path,
    timeout: float = 300.0,
    progress: Notify = lambda _: None,
) -> Path:
    """Generate scenarios for every job with the ROS nodes, and record all their topics in a bag.

    Args:
        jobs: each runs in a namespace of its own.
        config: parameters of the stages.
        count: scenarios per job.
        seed: for every stage.
        bag: folder to record to; it must not exist.
        timeout: seconds after which the suite is stopped.
        progress: called with a sentence now and then.

    Returns:
        `bag`, closed and complete.

    Raises:
        InputError: a node cannot use its input.
        RefusedError: a stage refused a job, a node died, or one did not answer in time; the
            message names it.
    """
    if bag.exists():
        raise InputError(f"{bag} exists already; name another folder for the bag, or remove it")
    with scratch() as place, own_domain():
        file = place / "parameters.yaml"
        body = parameters(jobs, config, count, seed, place / bag.name)
        file.write_text(yaml.safe_dump(body), encoding="utf-8")
        ros_args = ["--ros-args", "--params-file", str(file)]
        spaces = [word for job in jobs for word in ("--namespace", job.namespace)]
        commands = (
            ["recorder", *ros_args],
            ["suite", "--nodes", ",".join(GENERATORS), *spaces, *ros_args],
        )
        state = Progress(jobs, progress)
        with _watched(state) as spin_once, _processes(commands, place) as processes:
            _follow(processes, state, spin_once, place, timeout)
        bag.parent.mkdir(parents=True, exist_ok=True)
        shutil.move(place / bag.name, bag)
    return bag


@contextmanager
def _watched(state: Progress) -> Iterator[Callable[[], None]]:
    """Subscribe to the suite's topics.

    Yield a function that receives the messages that have arrived.
    """
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = rclpy.create_node("watcher", enable_rosout=False, start_parameter_services=False)
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        topics = [f"{job.namespace}/{topic}" for job in state.jobs for topic in CHAIN]
        for topic in ("/diagnostics", *topics):
            create_subscription(node, topic, partial(state.receive, topic))
        yield lambda: executor.spin_once(timeout_sec=POLL_S)
        node.destroy_node()
    finally:
        rclpy.try_shutdown()


@contextmanager
def _processes(commands: Sequence[list[str]], place: Path) -> Iterator[Mapping[str, BaseProcess]]:
    """Run executables as child processes, which end with the block, or by Ctrl-C, in order."""
    context = multiprocessing.get_context("spawn")
    processes = {
        words[0]: context.Process(target=_become, args=(words, str(place / f"{words[0]}.log")))
        for words in commands
    }
    with cleaned_up(partial(_end, list(processes.values()))):
        try:
            _start_all(processes.values())
            yield processes
        finally:
            _end(list(processes.values()))


def _start_all(processes: Iterable[BaseProcess]) -> None:
    """Start processes that ignore Ctrl-C until they handle it."""
    with ctrl_c_blocked():
        for process in processes:
            process.start()


def _become(words: list[str], log: str) -> None:
    """Run an executable in this new process, with its output in the file `log`."""
    end_with_parent()
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    descriptor = os.open(log, os.O_WRONLY | os.O_CREAT, 0o644)
    os.dup2(descriptor, 1)
    os.dup2(descriptor, 2)
    os.environ |= {"ROS_LOG_DIR": str(Path(log).with_suffix("")), "RCUTILS_COLORIZED_OUTPUT": "0"}
    sys.argv = words
    start(words[0])


def _end(processes: Sequence[BaseProcess]) -> None:
    for number in (signal.SIGINT, signal.SIGKILL):
        alive = [process for process in processes if process.pid and process.is_alive()]
        for process in alive:
            with suppress(ProcessLookupError):
                os.kill(process.pid or 0, number)
        for process in alive:
            process.join(END_S)


def _follow(
    processes: Mapping[str, BaseProcess],
    state: Progress,
    spin_once: Callable[[], None],
    place: Path,
    timeout: float,
) -> None:
    """Wait until every job is done and recorded.

    Raises:
        InputError, RefusedError: a job failed, a process ended, or the time is over.
    """
    deadline = time.monotonic() + timeout
    while not state.complete():
        spin_once()
        for name, process in processes.items():
            if not process.is_alive():
                output = _last_output(place, name)
                raise RefusedError(f"{name} ended with code {process.exitcode}{output}")
        if time.monotonic() > deadline:
            node = state.pending_node()
            output = _last_output(place, "recorder" if node == "/recorder" else "suite")
            raise RefusedError(f"{node} did not answer within {timeout:.0f} s{output}")


def _last_output(place: Path, name: str) -> str:
    """Return the last lines that a process wrote, as the end of a message."""
    path = place / f"{name}.log"
    if not path.is_file():
        return ""
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()[-5:]
    return "; its last output: " + " | ".join(lines) if lines else ""
