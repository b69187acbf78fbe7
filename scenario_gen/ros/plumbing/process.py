# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The life of a process of nodes: created, started when their kernels are ready, spun, ended by a signal or when all are done.

Signals are heard by a thread of their own (`scenario_gen/base/interrupts.py`), and rclpy's handlers are not installed: nothing is
raised in the midst of a callback, and the context is valid until the nodes have ended.

The kernels of all nodes are loaded, or compiled once per machine, by a thread while the nodes are spun. So these answer meanwhile
(parameters, get_state: unconfigured) and report on /diagnostics how far it is; who asks for `configure` waits.

Answers of services reach their callers, also those whose readers DDS has not found yet: a request may come before the node has
found the caller's reader, on a busy machine by seconds. rmw_fastrtps then waits 100 ms, drops the answer and warns; the caller
waits for ever. Sending it again is all that is missing.
"""

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
import ctypes
import faulthandler
from functools import partial
import importlib
import os
from pathlib import Path
import pkgutil
import sys
import threading
from time import CLOCK_MONOTONIC, monotonic
import traceback
from typing import Any, NoReturn
import warnings

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
import rclpy
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rclpy.utilities import remove_ros_args

from scenario_gen.base.errors import print_error, ScenarioGenError
from scenario_gen.base.interrupts import end_orderly, ending, hear
from scenario_gen.numerics.compiling import end_workers, make_ready, Progress, words
from scenario_gen.ros.plumbing.ros_parameters import help_of, USAGE

OFTEN = 5.0  # seconds between two reports of how many kernels are there
SIGEV_THREAD = 2  # <signal.h>
DUMP_SECONDS = 0.5  # seconds that writing the stack traces may take
ENDING = 5.0  # seconds that a node may take to react to a signal, and again to leave its ROS domain
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
    where = namespaces(arguments)
    hear()
    rclpy.init(args=list(arguments), signal_handler_options=SignalHandlerOptions.NO)
    executor = SingleThreadedExecutor()
    nodes: list[Any] = []
    code = 0
    with ending(end_workers):
        try:
            for namespace in where:
                for make in makers:
                    nodes.append(make(namespace))
                    ResponseRetry(nodes[-1])
                    executor.add_node(nodes[-1])
            code = _spin(executor, nodes)
        except ExternalShutdownException:
            pass
        except (ScenarioGenError, OSError) as error:
            code = print_error(error)
        except Exception:
            traceback.print_exc()
            code = 1
        end_orderly(lambda: None)  # a Ctrl-C does not disturb the clean end
        end_workers()
        code = _end(nodes, executor, code)
    return _leave(code)


def asks_for_help(arguments: Sequence[str]) -> bool:
    """Return whether `--help` stands among the words that are not ROS's."""
    return bool({"-h", "--help"} & set(remove_ros_args(list(arguments))[1:]))


def show(text: str) -> None:
    """Print a text that somebody may read in part only: `--help | head`."""
    try:
        print(text, flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # or Python complains when it ends


def namespaces(arguments: Sequence[str]) -> list[str | None]:
    """Return the values of `--namespace` (one node for each, all in this process); [None] if there is none."""
    rest = remove_ros_args(list(arguments))[1:]
    if any(word != "--namespace" for word in rest[::2]) or len(rest) % 2:
        raise SystemExit(f"{USAGE.format(name=arguments[0])}\n--help lists the parameters")
    return [name or None for name in rest[1::2]] or [None]


def kernels_ready(stages: Iterable[str], progress: Progress = lambda *_: None) -> tuple[int, float]:
    """Load the kernels of some stages, compile what is not in the cache; return their number and the seconds it took.

    Only those of the node's own stages: to import all of them would cost every node seconds.
    """
    started = monotonic()
    for stage in stages:
        package = importlib.import_module(f"scenario_gen.{stage}")
        for module in pkgutil.iter_modules(getattr(package, "__path__", ())):
            importlib.import_module(f"scenario_gen.{stage}.{module.name}")
    return make_ready(progress) if stages else 0, monotonic() - started


class _Preparation:
    """Makes the kernels ready and then calls back, on the executor's thread."""

    def __init__(self, executor: SingleThreadedExecutor, nodes: Sequence[Any], then: Callable[[], None]) -> None:
        """Start. `nodes`: those with stages; their `configure` waits from now on."""
        self._executor, self._nodes, self._then = executor, nodes, then
        self._ready = Future()
        self._reported = -OFTEN
        for node in nodes:
            for service in node.services:
                if service.srv_type is ChangeState:
                    service.callback = self._once_ready(node, service.callback)
        threading.Thread(target=self._run, daemon=True, name="kernels").start()

    def _run(self) -> None:
        error: Exception | None = None
        try:
            count, seconds = kernels_ready(dict.fromkeys(stage for node in self._nodes for stage in node.STAGES), self._report)
            self._nodes[0].get_logger().info(f"{count} kernels ready after {seconds:.1f} s")
        except Exception as caught:
            error = caught
        self._executor.create_task(self._finish, error)

    def _finish(self, error: Exception | None) -> None:
        if error is not None:
            raise error
        self._ready.set_result(None)
        self._then()

    def _report(self, done: int, needed: int, seconds: float) -> None:
        if seconds < self._reported + OFTEN:
            return
        self._reported = seconds
        self._nodes[0].get_logger().info(words(done, needed, seconds))
        for node in self._nodes:
            node.diagnostics.state(words(done, needed, seconds))

    def _once_ready(self, node: Any, change: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
        """Let `configure` wait, and a transition that cannot be be refused: rclpy would end the node."""

        async def changed(request: Any, response: Any) -> Any:
            if request.transition.id == Transition.TRANSITION_CONFIGURE or request.transition.label == "configure":
                await self._ready
            try:
                return change(request, response)
            except rclpy_implementation.RCLError as error:
                node.get_logger().warning(f"no such transition now: {error}")
                response.success = False
                return response

        return changed


def _spin(executor: SingleThreadedExecutor, nodes: Sequence[Any]) -> int:
    """Start the nodes, once their kernels are there, and spin them; return the exit code."""
    requested = threading.Event()

    def end() -> None:
        if not requested.is_set():
            _leave_within(max(getattr(node, "ENDING", ENDING) for node in nodes))
        requested.set()
        executor.create_task(lambda: None)  # so that it looks up

    def start() -> None:
        for node in nodes:
            if not requested.is_set():
                node.autostart()

    end_orderly(end)
    with_kernels = [node for node in nodes if getattr(node, "STAGES", ())]
    if with_kernels:
        _Preparation(executor, with_kernels, start)
    else:
        start()
    while not requested.is_set() and rclpy.ok() and not all(getattr(node, "done", False) for node in nodes):
        executor.spin_once()
    return max(getattr(node, "exit_code", 0) for node in nodes)


def _end(nodes: Sequence[Any], executor: SingleThreadedExecutor, code: int) -> int:
    """Destroy the nodes, also after an error of one of them; return the exit code, `code` if all goes well."""
    for node in nodes:
        getattr(node, "cancel", list)()  # all at once, so that no node waits for the end of another
    for node in nodes:
        try:
            getattr(node, "close", list)()
        except (ScenarioGenError, OSError) as error:  # a bag that cannot be closed, say
            code = print_error(error)
    _flush()
    _leave_within(ENDING, code)  # nothing is lost from here on
    for node in nodes:
        try:
            node.destroy_node()
        except (ScenarioGenError, OSError) as error:
            code = print_error(error)
    executor.shutdown(timeout_sec=1.0)
    for node in nodes:
        # rclpy lets it keep its node, so that others would not hear of the end for 20 s
        if (machine := getattr(node, "_state_machine", None)) is not None:
            machine.destroy_when_not_in_use()
    rclpy.try_shutdown()
    return code


def _leave_within(seconds: float, code: int = 1) -> None:
    """End the process after so many seconds whatever it does, with an exit code and where it stood on its standard error.

    DDS was seen to wait for itself for ever, in a call that holds Python's lock; what ends the process here does without it: a
    timer of the system's, whose thread calls `_exit`. Where there is none, the exit code is 1.
    """
    try:
        system = ctypes.CDLL(None)
        create, settime, delete = system.timer_create, system.timer_settime, system.timer_delete
    except (AttributeError, OSError):
        faulthandler.dump_traceback_later(seconds, exit=True, file=2)
        return
    faulthandler.dump_traceback_later(seconds, exit=False, file=2)
    while _timers:
        delete(_timers.pop())
    leave = ctypes.cast(system._exit, ctypes.c_void_p)
    timer, event = ctypes.c_void_p(), _TimerEvent(value=code, notify=SIGEV_THREAD, function=leave)
    if create(CLOCK_MONOTONIC, ctypes.byref(event), ctypes.byref(timer)) == 0:
        _timers.append(timer)
        after = int((seconds + DUMP_SECONDS) * 1e9)
        settime(timer, 0, (ctypes.c_long * 4)(0, 0, after // 10**9, after % 10**9), None)


_timers: list[ctypes.c_void_p] = []  # the one that is running


class _TimerEvent(ctypes.Structure):
    """`struct sigevent`: a timer's end calls `function` with `value` in a thread of its own."""

    _fields_ = (
        ("value", ctypes.c_size_t),
        ("signal", ctypes.c_int),
        ("notify", ctypes.c_int),
        ("function", ctypes.c_void_p),
        ("attributes", ctypes.c_void_p),
        ("unused", ctypes.c_char * 32),
    )


def _leave(code: int) -> NoReturn:
    """End the process: all that matters is closed, and to take Python and the compiler down costs half a second of the CPU."""
    _flush()
    os._exit(code)


def _flush() -> None:
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()


AGAIN = 0.1  # seconds between two attempts, of which each takes 100 ms
PATIENCE = 60.0  # seconds after which a caller is given up
MOST = 1000  # answers kept; then the oldest caller is given up

Send = Callable[[Any, Any], None]  # of a response and the header of its request


class ResponseRetry:
    """Keeps the answers of a node's services that could not be sent, and sends them again until they could."""

    def __init__(self, node: Node) -> None:
        """Take over the answers of all services that the node has by now."""
        self._node = node
        self._kept: deque[tuple[float, Callable[[], None]]] = deque()
        self._timer = node.create_timer(AGAIN, self._again, clock=Clock(clock_type=ClockType.STEADY_TIME), autostart=False)
        for service in node.services:
            service.send_response = partial(self._send, service.send_response)

    def _send(self, send: Send, response: Any, header: Any) -> None:
        if not delivered(partial(send, response, header)):
            if len(self._kept) >= MOST:
                self._kept.popleft()
                self._node.get_logger().warning(f"{MOST} callers are not found; the oldest one's answer is dropped")
            self._kept.append((monotonic() + PATIENCE, partial(send, response, header)))
            self._timer.reset()

    def _again(self) -> None:
        """Try the one that waits longest, so that others are served between."""
        self._timer.cancel()
        deadline, attempt = self._kept.popleft()
        if not delivered(attempt):
            if monotonic() < deadline:
                self._kept.append((deadline, attempt))
            else:
                self._node.get_logger().warning(f"a caller is not found after {PATIENCE:.0f} s; its answer is dropped")
        if self._kept:
            self._timer.reset()


def delivered(attempt: Callable[[], None]) -> bool:
    """Send an answer; return False if it was dropped, which rclpy reports by a warning only."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        attempt()
    return not any("failed to send response (timeout)" in str(warning.message) for warning in caught)
