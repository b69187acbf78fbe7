# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Kernels that are not in the cache are compiled once: by several processes, under a lock, and the user is told.

`python -m scenario_gen.numerics.compiling` compiles all of the project, or those of the packages that are named.
"""

from collections.abc import Callable
from contextlib import suppress
import importlib
import logging
import os
import shutil
import subprocess
import sys
from time import monotonic, time

from filelock import FileLock, Timeout

from scenario_gen.numerics.kernels import folder, import_all, is_lasting, Kernel, registered

WORKERS = max(1, min(4, os.cpu_count() or 1))
POLL_S = 0.5
UNUSED_S = 60.0 * 86400.0  # after which kernels of another version are removed
ONLY = "--only"
Progress = Callable[[int, int, float], None]  # kernels that are there, kernels that are needed, seconds

_workers: list["subprocess.Popen[bytes]"] = []


def words(done: int, needed: int, seconds: float) -> str:
    """Say how far it is."""
    often = (
        "once for this installation" if is_lasting() else "at every start: set NUMBA_CACHE_DIR to a folder that can be written to"
    )
    return f"kernels: {done} of {needed} compiled, {seconds:.0f} s; {often}"


def _log(done: int, needed: int, seconds: float) -> None:
    """Say once that it begins; a program without logging of its own has it on the standard error."""
    if seconds < POLL_S:
        logging.getLogger("scenario_gen").warning("%s; this takes a minute or two", words(done, needed, seconds))


def make_ready(report: Progress = _log) -> int:
    """Compile what is not in the cache of the kernels of all modules that have been imported; return their number.

    Of several processes one has them compiled; the others wait.

    Args:
        report: called now and then while something is not there.
    """
    needed, started = registered(), monotonic()

    def show(absent: int) -> None:
        report(len(needed) - absent, len(needed), monotonic() - started)

    while absent := len(_missing(needed)):
        show(absent)
        with suppress(Timeout), FileLock(folder() / "compiling.lock").acquire(timeout=POLL_S):
            _compile(_missing(needed), lambda: show(len(_missing(needed))))
            break  # what does not compile says why where it is called
    return len(needed)


def _missing(kernels: list[Kernel]) -> list[Kernel]:
    """Those that are not in the cache."""
    return [each for each in kernels if not each.mark.exists()]


def _compile(absent: list[Kernel], show: Callable[[], None]) -> None:
    """Have kernels compiled by processes, each its share of them."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder().parent)}
    names = [each.name for each in sorted(absent, key=lambda each: each.size, reverse=True)]
    command = [sys.executable, "-m", "scenario_gen.numerics.compiling", ONLY]
    try:
        for k in range(min(WORKERS, len(names))):  # in a session of its own: not the terminal's Ctrl-C
            share = names[k::WORKERS]
            _workers.append(subprocess.Popen([*command, *share], env=environment, start_new_session=True))
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


def _work(names: list[str]) -> None:
    """Compile these kernels, as long as somebody waits for them."""
    parent = os.getppid()
    for name in names:
        if os.getppid() == parent:
            module, _, function = name.partition(":")
            getattr(importlib.import_module(module), function).compile()


def main() -> None:
    """Compile the kernels of the packages that are named, or all; remove those of versions that were not used for long."""
    if ONLY in sys.argv:
        _work(sys.argv[2:])
        return
    started = monotonic()
    import_all(sys.argv[1:])
    end, last = "\r" if sys.stdout.isatty() else "\n", ""

    def show(done: int, needed: int, seconds: float) -> None:
        nonlocal last
        text = words(done, needed, seconds)
        if sys.stdout.isatty() or text[:16] != last[:16]:
            print(text, end=end, flush=True)
        last = text

    count = make_ready(show)
    folder().touch()
    for old in folder().parent.glob("kernels-*"):
        if time() - old.stat().st_mtime > UNUSED_S:
            shutil.rmtree(old, ignore_errors=True)
    print(f"{count} kernels ready after {monotonic() - started:.1f} s", flush=True)


if __name__ == "__main__":
    main()
