# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Ctrl-C, SIGTERM and SIGHUP: heard by a thread (nodes), or kept out of what must not be cut in two (commands)."""

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
_hearing = 0  # the process that has a thread for it; a fork has none


def end_with_parent() -> None:
    """Let a worker process end when the one does that started it, however that ends; a Ctrl-C is for that one.

    It is of this module, which loads next to nothing: so it holds before a worker loads what its tasks need.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is None:
        return
    if sys.platform == "linux":  # at once, in compiled code too
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)

    def wait() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True, name="parent").start()


def hear() -> None:
    """Have the signals heard by a thread of their own from now on: whatever else runs goes on undisturbed, compiled code too.

    A signal ends the process at once, or calls what `end_orderly` was given. To be called before there are other threads: those
    would take the signals.
    """
    global _hearing  # noqa: PLW0603
    if _hearing == os.getpid():
        return
    _hearing = os.getpid()
    heard = {number for number in SIGNALS if number != signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN}
    signal.pthread_sigmask(signal.SIG_BLOCK, heard)
    for number in heard:  # one that is ignored (of a job in the background, say) would never come
        signal.signal(number, lambda number, _: _take(number))  # and should a thread of before take it
    threading.Thread(target=_hear, args=(heard,), daemon=True, name="signals").start()


def end_orderly(end: Callable[[], None]) -> None:
    """Have `end` called by a signal, on the thread of the signals, instead of ending the process."""
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

    Nothing is raised: an exception out of the blue is swallowed where Python calls back (when a module has been imported, say),
    and compiled code that it meets may crash.
    """
    global _pending  # noqa: PLW0603 - a signal has no other place to be noted
    if _held:
        _pending = number
    else:
        _leave(number)


@contextmanager
def ending(clean_up: Callable[[], None]) -> Iterator[None]:
    """Let `leave` call `clean_up` while the work inside goes on."""
    _endings.append(clean_up)
    try:
        yield
    finally:
        _endings.remove(clean_up)


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Let the work inside be finished before a signal takes effect; of nested ones the outermost."""
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
    """Let processes that are started inside hear no Ctrl-C, which a terminal sends to them, too: it is for this one, afterwards.

    They are deaf to it before their first line; what they load meanwhile would end in a traceback.
    """
    from multiprocessing import resource_tracker

    with uninterrupted():
        resource_tracker.ensure_running()  # it unblocks Ctrl-C when it begins, and else begins with the first process
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _leave(number: int) -> None:
    signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)  # a second Ctrl-C does not disturb this
    for clean_up in reversed(_endings):
        with suppress(Exception):
            clean_up()
    cursor = "\x1b[?25h" if os.isatty(2) else ""  # a progress bar hides it
    with suppress(OSError):
        os.write(2, f"{cursor}stopped by {signal.Signals(number).name}\n".encode())
    os._exit(128 + number)  # as a shell says it
