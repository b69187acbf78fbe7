# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Ctrl-C, SIGTERM and SIGHUP: received by a thread (nodes), or deferred by work that must not be interrupted (commands)."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
import ctypes
import multiprocessing
import os
import signal
import sys
import threading

PR_SET_PDEATHSIG = 1  # linux/prctl.h
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_held = 0
_pending: int | None = None
_endings: list[Callable[[], None]] = []
_orderly: Callable[[], None] | None = None
_hearing = 0  # id of the process that has the thread; a fork has none


def end_with_parent() -> None:
    """Let a worker process end when its parent does, however that ends; a Ctrl-C is for the parent alone.

    This module imports little, so that a worker calls this before it loads the modules of its tasks.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is None:
        return
    if sys.platform == "linux":  # takes effect at once, also in compiled code
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)

    def wait() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True, name="parent").start()


def hear() -> None:
    """Start a thread that receives the signals, so that all other work, also compiled code, is not interrupted.

    A signal ends the process at once, or calls the function given to `end_orderly`. To be called before other threads start:
    they would receive the signals.
    """
    global _hearing  # noqa: PLW0603
    if _hearing == os.getpid():
        return
    _hearing = os.getpid()
    heard = {
        number
        for number in SIGNALS
        if number != signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN
    }
    signal.pthread_sigmask(signal.SIG_BLOCK, heard)
    for number in heard:  # an ignored signal (of a job in the background, say) would never come
        signal.signal(number, lambda number, _: _take(number))  # for threads that started earlier
    threading.Thread(target=_hear, args=(heard,), daemon=True, name="signals").start()


def end_orderly(end: Callable[[], None]) -> None:
    """Let a signal call `end`, on the thread of the signals, instead of ending the process."""
    global _orderly  # noqa: PLW0603
    _orderly = end


def _hear(heard: set[signal.Signals]) -> None:
    while True:
        _take(signal.sigwait(heard))


def _take(number: int) -> None:
    if _orderly is None:
        _leave(number)
    else:
        _orderly()


def leave(number: int, _frame: object) -> None:
    """Signal handler of commands: clean up and end the process, at once or when `uninterrupted` work is done.

    It raises nothing: Python swallows exceptions in callbacks (after the import of a module, say), and compiled code may crash on
    them.
    """
    global _pending  # noqa: PLW0603 - a signal handler has no other state
    if _held:
        _pending = number
    else:
        _leave(number)


@contextmanager
def ending(clean_up: Callable[[], None]) -> Iterator[None]:
    """Let `leave` call `clean_up` during the work inside."""
    _endings.append(clean_up)
    try:
        yield
    finally:
        _endings.remove(clean_up)


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Defer signals until the work inside is finished; of nested ones the outermost."""
    global _held  # noqa: PLW0603
    _held += 1
    try:
        yield
    finally:
        _held -= 1
    if _pending is not None and not _held:
        _leave(_pending)


@contextmanager
def starting() -> Iterator[None]:
    """Start processes inside with Ctrl-C blocked: a terminal sends it to them too, but this process handles it, afterwards.

    It is blocked before their first line, for an interrupted import would end in a traceback.
    """
    from multiprocessing import resource_tracker

    with uninterrupted():
        resource_tracker.ensure_running()  # it unblocks Ctrl-C when it starts, by default with the first process
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _leave(number: int) -> None:
    signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)  # a second Ctrl-C does not interrupt this
    for clean_up in reversed(_endings):
        with suppress(Exception):
            clean_up()
    cursor = "\x1b[?25h" if os.isatty(2) else ""  # a progress bar hides it
    with suppress(OSError):
        os.write(2, f"{cursor}stopped by {signal.Signals(number).name}\n".encode())
    os._exit(128 + number)  # as a shell reports it
