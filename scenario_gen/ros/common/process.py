# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The life of a process with nodes: create, compile kernels, spin, end.

rclpy's signal handlers are not installed, because they invalidate the context. Nodes can publish
until they have ended.

The kernels of all nodes are loaded, or compiled once per machine, before the executor spins.
Requests that arrive meanwhile are answered then.
"""

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
import faulthandler
import gc
import importlib
import os
from pathlib import Path
import pkgutil
import re
import signal
import sys
from time import sleep
import traceback
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.logging import get_logger
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from scenario_gen.base.cancelling import cancellable, stop_if_cancelled
from scenario_gen.base.errors import describe, InputError, print_error, ScenarioGenError
from scenario_gen.base.signals import SIGNALS
from scenario_gen.numerics.compiling import end_workers, make_ready, Progress, words
from scenario_gen.numerics.kernels import registered
from scenario_gen.ros.common.ros_parameters import help_of, USAGE
from scenario_gen.ros.common.timers import create_steady_timer

REPORT_PERIOD_S = 5.0  # between two reports of how many kernels are compiled
NODE_END_S = 5.0  # in which a node reacts to a signal, and again leaves its ROS domain
REMEDY = (
    "write -r FROM:=TO and -p NAME:=VALUE, an empty text as -p \"NAME:=''\", "
    "a text with colons or brackets as -p \"NAME:='1: 10 2'\""
)
NodeMaker = Callable[[str | None], Any]


def run_nodes(makers: Sequence[NodeMaker], arguments: Sequence[str] | None = None) -> int:
    """Spin one node of each maker per `--namespace` until a signal, or until all are done.

    Returns:
        The exit code.
    """
    arguments = sys.argv if arguments is None else arguments
    if asks_for_help(arguments):
        print_help(help_of(Path(arguments[0]).name, makers))
        return 0
    spaces = namespaces(arguments)

    process = NodeProcess()
    code = 0
    try:
        rclpy.init(args=list(arguments), signal_handler_options=SignalHandlerOptions.NO)
        process.handle_signals()
        process.create(makers, spaces)
        code = process.spin()
    except (ScenarioGenError, OSError) as error:
        code = print_error(error)
    except Exception:
        traceback.print_exc()
        code = 1
    code = process.close() or code

    end_within(NODE_END_S)
    gc.collect()  # a lifecycle node leaves its ROS domain once nothing refers to it
    rclpy.try_shutdown()
    return code


class NodeProcess:
    """The nodes of this process and their executor."""

    def __init__(self) -> None:
        self._nodes: list[Any] = []
        self._executor: SingleThreadedExecutor | None = None
        self._stopping = False

    def handle_signals(self) -> None:
        """Let a signal end the spinning; an ignored SIGHUP (nohup) stays ignored."""
        for number in SIGNALS:
            if number != signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, self._stop)

    def _stop(self, _number: int, _frame: object) -> None:
        if not self._stopping:
            end_within(max(map(end_seconds, self._nodes), default=NODE_END_S))
        self._stopping = True

    def create(self, makers: Sequence[NodeMaker], spaces: Sequence[str | None]) -> None:
        """Create the nodes, for each namespace one of each maker."""
        self._executor = SingleThreadedExecutor()
        for namespace in spaces:
            for make in makers:
                self._nodes.append(make(namespace))
                self._executor.add_node(self._nodes[-1])
        # The longest wait of the executor, which signals do not end.
        create_steady_timer(self._nodes[0], 0.25, lambda: None)

    def spin(self) -> int:
        """Start the nodes once their kernels are compiled, and spin them; return the exit code."""
        assert self._executor is not None
        stages = dict.fromkeys(
            stage for node in self._nodes for stage in getattr(node, "STAGES", ())
        )
        with ThreadPoolExecutor(1) as pool:
            loading = pool.submit(self._load_kernels, stages)
            while not (self._stopping or loading.done()):
                sleep(0.02)
            if self._stopping:
                end_workers()
                return 0
            loading.result()
        for node in self._nodes:
            if not self._stopping:
                node.autostart()
        self._align_timers()
        while not self._stopping and not all(getattr(node, "done", False) for node in self._nodes):
            try:
                self._executor.spin_once()
            except RuntimeError as error:  # rclpy: an impossible lifecycle transition
                get_logger("lifecycle").warning(f"a request is dropped: {error}")
        return max(getattr(node, "exit_code", 0) for node in self._nodes)

    def _align_timers(self) -> None:
        """Let all timers begin now: each wake-up of the executor costs more than a callback."""
        for node in self._nodes:
            for timer in node.timers:
                if not timer.is_canceled():
                    timer.reset()

    def _load_kernels(self, stages: Iterable[str]) -> None:
        """Load or compile kernels until a signal, and report the progress on standard error."""
        last_report_s = -REPORT_PERIOD_S

        def report(done: int, needed: int, seconds: float) -> None:
            nonlocal last_report_s
            stop_if_cancelled()
            if seconds >= last_report_s + REPORT_PERIOD_S:
                last_report_s = seconds
                print(words(done, needed, seconds), file=sys.stderr, flush=True)

        with cancellable(lambda: self._stopping):
            kernels_ready(stages, report)

    def close(self) -> int:
        """End the nodes in order; return the exit code of an error while doing so, 0 without any.

        Each node has its own time, because on a busy machine many nodes need longer than one.
        """
        self._stopping = True
        code = 0
        for node in self._nodes:  # all at once, so that no node waits for the end of another
            getattr(node, "cancel", list)()
        for step in ("close", "destroy_node"):
            for node in self._nodes:
                end_within(end_seconds(node))
                try:
                    getattr(node, step, list)()
                except (ScenarioGenError, OSError) as error:  # e.g. a bag that cannot be closed
                    code = print_error(error)
        self._nodes.clear()
        return code


def end_seconds(node: Any) -> float:
    """Return how long a node may take to end [s]."""
    return float(getattr(node, "END_S", NODE_END_S))


def end_within(seconds: float) -> None:
    """End the process after `seconds`, with exit code 1 and its stack on standard error.

    DDS can deadlock in a call that holds Python's lock.
    """
    faulthandler.dump_traceback_later(seconds, exit=True, file=2)


def non_ros_args(arguments: Sequence[str]) -> list[str]:
    """Return the arguments after the program's name that are not ROS's.

    Raises:
        InputError: ROS cannot parse those after --ros-args.
    """
    try:
        return list(remove_ros_args(list(arguments))[1:])
    except RuntimeError as error:  # RCLInvalidROSArgsError and UnknownROSArgsError of rclpy
        reason = re.sub(r"(\. Error: error not set)?\s*, at [^\s,]+", "", describe(error))
        raise InputError(f"{reason}; {REMEDY}" if "rule" in reason else reason) from error


def asks_for_help(arguments: Sequence[str]) -> bool:
    """Return whether the arguments contain `--help`."""
    return bool({"-h", "--help"} & set(non_ros_args(arguments)))


def print_help(text: str) -> None:
    """Print a text whose reader may stop early: `--help | head`."""
    try:
        print(text, flush=True)
    except BrokenPipeError:  # Python would complain at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def namespaces(arguments: Sequence[str]) -> list[str | None]:
    """Return the values of `--namespace`, one node for each in this process.

    [None] without any.
    """
    rest = non_ros_args(arguments)
    if any(word != "--namespace" for word in rest[::2]) or len(rest) % 2:
        raise SystemExit(f"{USAGE.format(name=arguments[0])}\n--help lists the parameters")
    return [name or None for name in rest[1::2]] or [None]


def kernels_ready(stages: Iterable[str], progress: Progress = lambda *_: None) -> int:
    """Load or compile the kernels of some stages; return their number.

    A node imports its own stages only: all of them would cost seconds.
    """
    for stage in stages:
        package = importlib.import_module(f"scenario_gen.{stage}")
        for module in pkgutil.iter_modules(getattr(package, "__path__", ())):
            stop_if_cancelled()
            importlib.import_module(f"scenario_gen.{stage}.{module.name}")
    return make_ready(registered(on_demand=False), progress) if stages else 0
