# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Kernels that are not in the cache are compiled once: by several processes, under a lock, and the user is told."""

from collections.abc import Callable, Sequence
from contextlib import suppress
import logging
import os
from pathlib import Path
import subprocess
import sys
from time import monotonic
from typing import Protocol

from filelock import FileLock, Timeout

from scenario_gen.numerics.kernel_cache import is_lasting, root

WORKERS = max(1, min(4, os.cpu_count() or 1))
POLL_S = 0.5
ONLY = "--only"
Progress = Callable[
    [int, int, float], None
]  # kernels that are there, kernels that are needed, seconds


class Compilable(Protocol):
    """A kernel: what tells it from all others, the file that says that it is in the cache, and how long it takes, about."""

    @property
    def name(self) -> str: ...  # noqa: D102
    @property
    def mark(self) -> Path: ...  # noqa: D102
    @property
    def size(self) -> int: ...  # noqa: D102


_workers: list["subprocess.Popen[bytes]"] = []


def words(done: int, needed: int, seconds: float) -> str:
    """Say how far it is."""
    often = (
        "once for this installation"
        if is_lasting()
        else "at every start: set NUMBA_CACHE_DIR to a folder that can be written to"
    )
    return f"kernels: {done} of {needed} compiled, {seconds:.0f} s; {often}"


def _log(done: int, needed: int, seconds: float) -> None:
    """Say once that it begins; a program without logging of its own has it on the standard error."""
    if seconds < POLL_S:
        logging.getLogger("scenario_gen").warning(
            "%s; this takes a minute or two", words(done, needed, seconds)
        )


def make_ready(needed: Sequence[Compilable], report: Progress = _log) -> int:
    """Compile what is not in the cache of the kernels that are needed; return their number.

    Of several processes one has them compiled; the others wait.

    Args:
        needed: the kernels, of modules that have been imported.
        report: called now and then while something is not there.
    """
    started = monotonic()

    def show(absent: int) -> None:
        report(len(needed) - absent, len(needed), monotonic() - started)

    while absent := len(_missing(needed)):
        show(absent)
        with suppress(Timeout), FileLock(root() / "compiling.lock").acquire(timeout=POLL_S):
            _compile(_missing(needed), lambda: show(len(_missing(needed))))
            break  # what does not compile says why where it is called
    return len(needed)


def _missing(kernels: Sequence[Compilable]) -> list[Compilable]:
    """Those that are not in the cache."""
    return [each for each in kernels if not each.mark.exists()]


def _compile(absent: Sequence[Compilable], show: Callable[[], None]) -> None:
    """Have kernels compiled by processes, each its share of them."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(root())}
    names = [each.name for each in sorted(absent, key=lambda each: each.size, reverse=True)]
    command = [sys.executable, "-m", "scenario_gen.numerics", ONLY]
    try:
        for k in range(
            min(WORKERS, len(names))
        ):  # in a session of its own: not the terminal's Ctrl-C
            share = names[k::WORKERS]
            _workers.append(
                subprocess.Popen([*command, *share], env=environment, start_new_session=True)
            )
        for worker in _workers:
            while worker.poll() is None:
                with suppress(subprocess.TimeoutExpired):
                    worker.wait(POLL_S)
                show()
    finally:
        end_workers()


def end_workers() -> None:
    """End the processes that compile for this one; what they have compiled stays."""
    while _workers:
        worker = _workers.pop()
        worker.kill()
        worker.wait()
