# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Time limits of planners: drives that take too long are stopped, slow decisions are counted.

Both depend on this machine: they change no verdict and no file.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
import faulthandler
import multiprocessing
import signal
import subprocess
import sys
import threading
from time import perf_counter
from types import FrameType

from scenario_gen.closed_loop.ego import Command, Pose
from scenario_gen.closed_loop.simulation import Observation, Planner, Task

INTERRUPT_PERIOD_S = 1.0  # a planner that catches an interrupt is interrupted again
KILL_DELAY_S = 5.0  # a process that ignores interrupts is killed so long after its time limit


class TooLongError(BaseException):
    """A planner's time is over.

    This is not an Exception, because the planner might catch that.
    """


@dataclass(frozen=True)
class Decisions:
    """Durations of decisions on this machine.

    Attributes:
        count: number of decisions.
        slow: number of decisions that took longer than the limit.
        longest: longest duration [s].
    """

    count: int = 0
    slow: int = 0
    longest: float = 0.0

    @classmethod
    def all_of(cls, drives: "Sequence[Decisions]") -> "Decisions":
        """Return the decisions of several drives together."""
        return cls(
            sum(drive.count for drive in drives),
            sum(drive.slow for drive in drives),
            max((drive.longest for drive in drives), default=0.0),
        )


class Timed:
    """A planner whose decisions are timed."""

    def __init__(self, planner: Planner, limit: float) -> None:
        self._planner, self._limit = planner, limit
        self.decisions = Decisions()

    def reset(self, task: Task) -> None:
        """Begin a new drive."""
        self._planner.reset(task)

    def act(self, observation: Observation) -> Command | Pose | None:
        """Return the planner's decision."""
        start = perf_counter()
        command = self._planner.act(observation)
        duration = perf_counter() - start
        decision = Decisions(1, int(duration > self._limit), duration)
        self.decisions = Decisions.all_of([self.decisions, decision])
        return command


@contextmanager
def bounded(seconds: float) -> Iterator[None]:
    """Interrupt the body of a `with` statement after some seconds of real time.

    A worker process is killed a little later if it ignores the interrupt (compiled code).

    Raises:
        TooLongError: the time is over.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # only the main thread can be interrupted
        return

    def end(_number: int, _frame: FrameType | None) -> None:
        raise TooLongError

    alone = multiprocessing.parent_process() is not None
    before = signal.signal(signal.SIGALRM, end)
    if alone and sys.__stderr__ is not None:
        faulthandler.dump_traceback_later(seconds + KILL_DELAY_S, exit=True, file=sys.__stderr__)
    signal.setitimer(signal.ITIMER_REAL, seconds, INTERRUPT_PERIOD_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
        if alone:
            faulthandler.cancel_dump_traceback_later()


@contextmanager
def end_named() -> Iterator[None]:
    """Print a line if this process ends within the block: by a crash, `os._exit` or a kill.

    A shell waits for a line, which the end of the block writes, or for the end of the pipe.
    """
    message = (
        "error: the planner ended the process: it crashed, called os._exit, or was killed for "
        "lack of memory"
    )
    command = ["/bin/sh", "-c", 'read -r line || echo "$0" >&2', message]
    with subprocess.Popen(command, stdin=subprocess.PIPE) as shell:
        try:
            yield
        finally:
            shell.communicate(b"done\n")
