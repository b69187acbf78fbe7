# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Compile kernels that are not in the cache: once, by several processes, under a lock."""

from collections.abc import Callable, Sequence
from contextlib import suppress
import logging
import os
from pathlib import Path
import subprocess
import sys
from time import monotonic, sleep
from typing import Protocol

from filelock import FileLock, Timeout

from scenario_gen.numerics.kernel_cache import root, temporary_because

MAX_WORKERS_COUNT = max(1, min(4, os.cpu_count() or 1))
POLL_S = 0.5
QUEUE = "--queue"
NAME_BYTES = 256  # a record of the queue: a kernel's name with spaces, read and written at once
# Without -P, code in the current folder would run; the package may not be installed.
_PROGRAM = f"""
import runpy, sys
sys.path.append({str(Path(__file__).parents[2])!r})
runpy.run_module("scenario_gen.numerics", run_name="__main__")
"""
Progress = Callable[[int, int, float], None]  # compiled kernels, needed kernels, seconds


class Compilable(Protocol):
    """A kernel: unique name, file that exists once it is cached, size of its code [bytes]."""

    @property
    def name(self) -> str: ...  # noqa: D102
    @property
    def mark(self) -> Path: ...  # noqa: D102
    @property
    def size(self) -> int: ...  # noqa: D102


_workers: list["subprocess.Popen[bytes]"] = []


def words(done: int, needed: int, seconds: float) -> str:
    """Describe the progress."""
    why = temporary_because()
    how_often = f"at every start: {why}" if why else "once for this installation"
    return f"kernels: {done} of {needed} compiled, {seconds:.0f} s; {how_often}"


def _log(done: int, needed: int, seconds: float) -> None:
    """Log the start; without logging of its own a program prints it on standard error."""
    if seconds < POLL_S:
        logging.getLogger("scenario_gen").warning(
            "%s; this takes a minute or two", words(done, needed, seconds)
        )


def make_ready(needed: Sequence[Compilable], report: Progress = _log) -> int:
    """Compile the needed kernels that are not in the cache; return the number of needed ones.

    Of several processes that need kernels one compiles them, and the others wait.

    Args:
        needed: kernels of modules that have been imported.
        report: called repeatedly while a kernel is missing.
    """
    started = monotonic()

    def show(missing_count: int) -> None:
        report(len(needed) - missing_count, len(needed), monotonic() - started)

    while missing := _missing(needed):
        show(len(missing))
        with suppress(Timeout), FileLock(root() / "compiling.lock").acquire(timeout=POLL_S):
            _compile(_missing(needed), lambda: show(len(_missing(needed))))
            break  # a kernel that does not compile raises its error when it is called
    return len(needed)


def _missing(kernels: Sequence[Compilable]) -> list[Compilable]:
    """Return the kernels that are not in the cache."""
    return [kernel for kernel in kernels if not kernel.mark.exists()]


def _compile(missing: Sequence[Compilable], show: Callable[[], None]) -> None:
    """Let processes compile kernels from a shared queue, the largest and so slowest first."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(root())}
    command = [sys.executable, "-P", "-c", _PROGRAM, QUEUE]
    queue, writer = os.pipe()
    try:
        # A session of their own keeps the terminal's Ctrl-C from them.
        _workers.extend(
            subprocess.Popen(command, stdin=queue, env=environment, start_new_session=True)
            for _ in range(min(MAX_WORKERS_COUNT, len(missing)))
        )
        os.close(queue)
        with suppress(BrokenPipeError):  # all workers have ended
            for kernel in sorted(missing, key=lambda each: each.size, reverse=True):
                os.write(writer, kernel.name.encode().ljust(NAME_BYTES))
        os.close(writer)
        while any(worker.poll() is None for worker in list(_workers)):
            sleep(POLL_S)
            show()
    finally:
        end_workers()


def next_name() -> str:
    """Return the next kernel's name from the queue on standard input, "" at its end."""
    return os.read(sys.stdin.fileno(), NAME_BYTES).decode().strip()


def end_workers() -> None:
    """End the processes that compile for this one; the kernels that they have compiled stay."""
    while _workers:
        worker = _workers.pop()
        worker.kill()
        worker.wait()
