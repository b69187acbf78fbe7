# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A planner's time: a drive that never comes to an end is ended, and decisions that take long are counted.

Both are of this machine: no verdict and nothing that is written hangs on them.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
import faulthandler
import multiprocessing
import signal
import sys
import threading
from time import perf_counter
from types import FrameType

from scenario_gen.closed_loop.ego import Command, Pose
from scenario_gen.closed_loop.simulation import Observation, Planner, Task

INTERRUPT_AGAIN_S = (
    1.0  # seconds after which a planner that goes on nevertheless is interrupted again
)
GRACE = 5.0  # seconds beyond the limit after which a process that no interrupt reaches is ended


class TooLongError(BaseException):
    """A planner has used up its time; it is no Exception, which the planner itself might catch."""


@dataclass(frozen=True)
class Decisions:
    """How many decisions were made, how many of them took longer than the limit, and the longest [s], on this machine."""

    count: int = 0
    slow: int = 0
    longest: float = 0.0

    @classmethod
    def all_of(cls, several: "Sequence[Decisions]") -> "Decisions":
        """Return the account of several drives."""
        return cls(
            sum(one.count for one in several),
            sum(one.slow for one in several),
            max((one.longest for one in several), default=0.0),
        )


class Timed:
    """A planner whose decisions are timed."""

    def __init__(self, planner: Planner, limit: float) -> None:
        self._planner, self._limit = planner, limit
        self.found = Decisions()

    def reset(self, task: Task) -> None:
        """Begin."""
        self._planner.reset(task)

    def act(self, observation: Observation) -> Command | Pose | None:
        """Return what the planner decides."""
        began = perf_counter()
        asked = self._planner.act(observation)
        took, known = perf_counter() - began, self.found
        self.found = Decisions(
            known.count + 1, known.slow + (took > self._limit), max(known.longest, took)
        )
        return asked


@contextmanager
def bounded(seconds: float) -> Iterator[None]:
    """End what runs inside after some seconds of real time.

    In a process of its own, code that no interrupt reaches (compiled, without end) ends that
    process a little later.

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
        faulthandler.dump_traceback_later(seconds + GRACE, exit=True, file=sys.__stderr__)
    signal.setitimer(signal.ITIMER_REAL, seconds, INTERRUPT_AGAIN_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
        if alone:
            faulthandler.cancel_dump_traceback_later()
