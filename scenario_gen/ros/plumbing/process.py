# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The life of a process of nodes: created, started when their kernels are there, spun, ended by a signal or when all are done.

Signals are received by a thread of their own (`scenario_gen/base/interrupts.py`), and rclpy's handlers are not installed: nothing
is raised in the midst of a callback, and the context is valid until the nodes have ended.

The kernels of all nodes are loaded, or compiled once per machine, before the first one is spun: what it is asked meanwhile, to
configure say, it answers then.
"""

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
import faulthandler
import gc
import importlib
import os
from pathlib import Path
import pkgutil
import re
import sys
import threading
import traceback
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from scenario_gen.base.errors import describe, InputError, print_error, ScenarioGenError
from scenario_gen.base.interrupts import end_orderly, hear
from scenario_gen.numerics.compiling import end_workers, make_ready, Progress, words
from scenario_gen.numerics.kernels import registered
from scenario_gen.ros.plumbing.ros_parameters import help_of, USAGE

REPORT_S = 5.0  # seconds between two reports of how many kernels are there
ENDING = (
    5.0  # seconds that a node may take to react to a signal, and again to leave its ROS domain
)
REMEDY = (
    "write -r FROM:=TO and -p NAME:=VALUE, an empty text as -p \"NAME:=''\", "
    "a text with colons or brackets as -p \"NAME:='1: 10 2'\""
)
Maker = Callable[[str | None], Any]


def run_nodes(makers: Sequence[Maker], arguments: Sequence[str] | None = None) -> int:
    """Spin one node of each maker per `--namespace` until Ctrl-C, SIGTERM, SIGHUP, or all are done; end the process.

    Returns:
        The exit code, but only where there was nothing to be spun.
    """
    arguments = sys.argv if arguments is None else arguments
    if asks_for_help(arguments):
        show(help_of(Path(arguments[0]).name, makers))
        return 0
    spaces = namespaces(arguments)
    hear()
    code = _run(makers, arguments, spaces)
    leave_within(ENDING)
    gc.collect()  # a lifecycle node leaves its ROS domain when nothing refers to it any more
    rclpy.try_shutdown()
    _flush()
    os._exit(
        code
    )  # all that matters is closed, and to take Python and the compiler down costs half a second of the CPU


def _run(makers: Sequence[Maker], arguments: Sequence[str], spaces: Sequence[str | None]) -> int:
    """Create, spin and destroy the nodes; return the exit code."""
    nodes: list[Any] = []
    code = 0
    try:
        rclpy.init(args=list(arguments), signal_handler_options=SignalHandlerOptions.NO)
        executor, requested = SingleThreadedExecutor(), threading.Event()

        def end() -> None:
            if not requested.is_set():
                leave_within(
                    max((getattr(node, "ENDING", ENDING) for node in nodes), default=ENDING)
                )
            requested.set()
            executor.create_task(lambda: None)  # so that it looks up

        end_orderly(end)  # from now on, for whoever sees one of the nodes may end it
        for namespace in spaces:
            for make in makers:
                nodes.append(make(namespace))
                executor.add_node(nodes[-1])
        code = _spin(executor, nodes, requested)
    except ExternalShutdownException:
        pass
    except (ScenarioGenError, OSError) as error:
        code = print_error(error)
    except Exception:
        traceback.print_exc()
        code = 1
    end_orderly(lambda: None)  # a Ctrl-C does not disturb the clean end
    end_workers()
    for node in nodes:
        getattr(
            node, "cancel", list
        )()  # all at once, so that no node waits for the end of another
    for step in ("close", "destroy_node"):
        for (
            node
        ) in nodes:  # each has its time, for on a busy machine many take longer than one may
            leave_within(getattr(node, "ENDING", ENDING))
            try:
                getattr(node, step, list)()
            except (ScenarioGenError, OSError) as error:  # a bag that cannot be closed, say
                code = print_error(error)
        _flush()
    return code


def own_words(arguments: Sequence[str]) -> list[str]:
    """Return the words behind the program's name that are not ROS's.

    Raises:
        InputError: those behind --ros-args are not as ROS reads them.
    """
    try:
        return list(remove_ros_args(list(arguments))[1:])
    except RuntimeError as error:  # RCLInvalidROSArgsError and UnknownROSArgsError of rclpy
        reason = re.sub(r"(\. Error: error not set)?\s*, at [^\s,]+", "", describe(error))
        raise InputError(f"{reason}; {REMEDY}" if "rule" in reason else reason) from error


def asks_for_help(arguments: Sequence[str]) -> bool:
    """Return whether `--help` stands among the words that are not ROS's."""
    return bool({"-h", "--help"} & set(own_words(arguments)))


def show(text: str) -> None:
    """Print a text that somebody may read in part only: `--help | head`."""
    try:
        print(text, flush=True)
    except BrokenPipeError:
        os.dup2(
            os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno()
        )  # or Python complains when it ends


def namespaces(arguments: Sequence[str]) -> list[str | None]:
    """Return the values of `--namespace` (one node for each, all in this process); [None] if there is none."""
    rest = own_words(arguments)
    if any(word != "--namespace" for word in rest[::2]) or len(rest) % 2:
        raise SystemExit(f"{USAGE.format(name=arguments[0])}\n--help lists the parameters")
    return [name or None for name in rest[1::2]] or [None]


def kernels_ready(stages: Iterable[str], progress: Progress = lambda *_: None) -> int:
    """Load the kernels of some stages, compile what is not in the cache; return their number.

    Only those of the nodes' own stages: to import all of them would cost every node seconds.
    """
    for stage in stages:
        package = importlib.import_module(f"scenario_gen.{stage}")
        for module in pkgutil.iter_modules(getattr(package, "__path__", ())):
            importlib.import_module(f"scenario_gen.{stage}.{module.name}")
    return make_ready(registered(), progress) if stages else 0


def _print_progress() -> Progress:
    """Return what says on the terminal, now and then, how many kernels are compiled."""
    reported = -REPORT_S

    def report(done: int, needed: int, seconds: float) -> None:
        nonlocal reported
        if seconds >= reported + REPORT_S:
            reported = seconds
            print(words(done, needed, seconds), file=sys.stderr, flush=True)

    return report


def _spin(
    executor: SingleThreadedExecutor, nodes: Sequence[Any], requested: threading.Event
) -> int:
    """Start the nodes, once their kernels are there, and spin them until their end is `requested`; return the exit code."""
    stages = dict.fromkeys(stage for node in nodes for stage in getattr(node, "STAGES", ()))
    loading = ThreadPoolExecutor(1).submit(kernels_ready, stages, _print_progress())
    while not requested.is_set() and not loading.done():
        requested.wait(0.02)
    for node in nodes:
        if not requested.is_set():
            loading.result()
            node.autostart()
    while (
        not requested.is_set()
        and rclpy.ok()
        and not all(getattr(node, "done", False) for node in nodes)
    ):
        try:
            executor.spin_once()
        except RuntimeError as error:  # rclpy raises it of a lifecycle transition that cannot be
            nodes[0].get_logger().warning(f"a request is dropped: {error}")
    return max(getattr(node, "exit_code", 0) for node in nodes)


def leave_within(seconds: float) -> None:
    """End the process after so many seconds, whatever it does, with exit code 1 and where it stood on its standard error.

    DDS was seen to wait for itself for ever, in a call that holds Python's lock.
    """
    faulthandler.dump_traceback_later(seconds, exit=True, file=2)


def _flush() -> None:
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
