# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Ctrl-C, SIGTERM and SIGHUP in commands: clean up, then end the process by the same signal.

The handler raises no exception. Python ignores exceptions in some callbacks, for example after
the import of a module, and compiled code may crash on them.
"""

from collections.abc import Callable, Iterator, Mapping
import concurrent.futures
from contextlib import contextmanager, suppress
import multiprocessing
from multiprocessing import resource_tracker
import os
import signal
import threading

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_clean_ups: list[Callable[[], None]] = []
_deferral_count = 0
_deferred_signal: int | None = None


def handle_signals() -> None:
    """Let the signals clean up and end this process; an ignored one (nohup) stays ignored."""
    for number in SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, on_signal)


def on_signal(number: int, _frame: object) -> None:
    """Clean up and end the process, at once or after the work inside `signals_deferred`."""
    global _deferred_signal  # noqa: PLW0603 - a signal handler has no other state
    if _deferral_count:
        _deferred_signal = number
    else:
        _end_process(number)


@contextmanager
def cleaned_up(clean_up: Callable[[], None]) -> Iterator[None]:
    """Let a signal during the work inside call `clean_up` before the process ends."""
    _clean_ups.append(clean_up)
    try:
        yield
    finally:
        _clean_ups.remove(clean_up)


@contextmanager
def signals_deferred() -> Iterator[None]:
    """Defer signals until the work inside, or the outermost work of nested ones, has finished."""
    global _deferral_count  # noqa: PLW0603
    _deferral_count += 1
    try:
        yield
    finally:
        _deferral_count -= 1
    if _deferred_signal is not None and not _deferral_count:
        _end_process(_deferred_signal)


@contextmanager
def environment_set(variables: Mapping[str, str]) -> Iterator[None]:
    """Set environment variables for processes that are started within the block."""
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


@contextmanager
def ctrl_c_blocked() -> Iterator[None]:
    """Start child processes inside with Ctrl-C blocked: the terminal sends it to them, too.

    It is blocked before their first statement, because an interrupted import ends in a traceback.
    Python searches modules in the current folder only after a child has got its parent's path:
    code that lies beside the data is not run.
    """
    with signals_deferred(), environment_set({"PYTHONSAFEPATH": "1"}):
        resource_tracker.ensure_running()  # its start would unblock Ctrl-C
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)


def worker_pool(count: int) -> "concurrent.futures.ProcessPoolExecutor":
    """Return a pool of processes that end with this one; submit tasks within `ctrl_c_blocked`."""
    context = multiprocessing.get_context("spawn")
    with ctrl_c_blocked():
        return concurrent.futures.ProcessPoolExecutor(count, context, end_with_parent)


def end_with_parent() -> None:
    """Let a worker process end with its parent, however that ends; ignore Ctrl-C in the worker.

    This module imports little, so that a worker can call this before it loads its tasks' modules.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def wait() -> None:
        parent.join()
        os.kill(os.getpid(), signal.SIGKILL)

    threading.Thread(target=wait, daemon=True, name="wait for parent").start()


def _end_process(number: int) -> None:
    for each in SIGNALS:  # a second Ctrl-C must not interrupt the clean-up
        signal.signal(each, signal.SIG_IGN)
    for clean_up in reversed(_clean_ups):
        with suppress(Exception):
            clean_up()
    show_cursor = "\x1b[?25h" if os.isatty(2) else ""  # a progress bar hides the cursor
    with suppress(OSError):
        os.write(2, f"{show_cursor}stopped by {signal.Signals(number).name}\n".encode())
    signal.signal(number, signal.SIG_DFL)
    signal.raise_signal(number)
