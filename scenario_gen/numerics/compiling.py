# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Kernels that are not in numba's cache are compiled once: by processes of their own, under a lock, while who needs them waits.

`python -m scenario_gen.numerics.compiling` compiles all of the project, or those of the packages that are named, and shows
its progress.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
import fcntl
import importlib
import os
from pathlib import Path
import subprocess
import sys
from time import monotonic, sleep
from typing import Any

from scenario_gen.numerics import kernel_cache, kernels

WORKERS = max(1, min(4, os.cpu_count() or 1))
LOCK = "compiling.lock"
NAME = 128  # bytes of a kernel's name in the queue
LOOK = 0.5  # seconds between two looks at what is there
Entry = tuple[Any, Any]
Progress = Callable[[int, int, float], None]  # kernels that are there, kernels that are needed, seconds

_workers: list["subprocess.Popen[bytes]"] = []


def make_ready(report: Progress = lambda *_: None) -> int:
    """Load every kernel of the modules that have been imported; compile what is not there; return their number.

    Several processes may do so at once: one has the rest compiled, the others wait for what they need. Where no folder can be
    written to, this process compiles for itself.

    Args:
        report: called now and then while something is not there.
    """
    needed, started = kernels.registered(), monotonic()
    folder = kernel_cache.folder()
    absent = list(needed)

    def look() -> list[Entry]:
        absent[:] = missing(absent)
        if absent:
            report(len(needed) - len(absent), len(needed), monotonic() - started)
        return absent

    while folder is not None and look():
        with _lock(str(folder / LOCK)) as lock:
            if lock is not None:
                _compile(absent, lock, lambda: bool(look()))
                break
        sleep(LOOK)
    for done, (compiled, argument_types) in enumerate(needed):
        if folder is None:
            report(done, len(needed), monotonic() - started)
        compiled.compile(argument_types)
    return len(needed)


def missing(entries: Sequence[Entry]) -> list[Entry]:
    """Return those that are not in the cache."""
    return [entry for entry in entries if not kernels.is_cached(*entry)]


def end_workers() -> None:
    """End the processes that compile for this one; what they have compiled stays."""
    for worker in _workers:
        worker.kill()


def name_of(compiled: Any) -> str:
    """Return what tells one kernel from all others."""
    return f"{compiled.__module__}:{compiled.__name__}"


def _weight(entry: Entry) -> int:
    """How long a kernel takes to be compiled, about: the bytes of its code and of what it calls."""
    return kernel_cache.size(entry[0].__wrapped__)


@contextmanager
def _lock(path: str) -> Iterator[int | None]:
    """Hold the lock, or None if another process does; where there are no locks everyone compiles."""
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        yield None
        return
    except OSError:
        pass
    try:
        yield descriptor
    finally:
        os.close(descriptor)


def _compile(absent: Sequence[Entry], lock: int, wanting: Callable[[], bool]) -> None:
    """Have kernels compiled by workers, who take their names from one pipe, the longest first, and hold the lock, too."""
    names = [name_of(compiled) for compiled, _ in sorted(absent, key=_weight, reverse=True)]
    queue, filled = os.pipe()
    os.set_blocking(filled, False)
    os.write(filled, b"".join(name.encode().ljust(NAME) for name in names))  # a pipe holds 500 names
    os.close(filled)
    command = [sys.executable, "-m", "scenario_gen.numerics.compiling", "--worker"]
    try:
        for _ in range(min(WORKERS, len(names))):
            worker = subprocess.Popen(command, stdin=queue, pass_fds=(lock,), start_new_session=True)  # not the terminal's Ctrl-C
            _workers.append(worker)
        while wanting() and any(worker.poll() is None for worker in _workers):
            with suppress(subprocess.TimeoutExpired):
                _workers[0].wait(LOOK)
                _workers.append(_workers.pop(0))
    finally:
        os.close(queue)
        end_workers()
        for worker in _workers:
            worker.wait()
        _workers.clear()


def _work() -> None:
    """Compile what the queue names, until it is empty or nobody is there any more who wants it."""
    parent = os.getppid()
    while os.getppid() == parent and (name := os.read(0, NAME).decode().strip()):
        module = importlib.import_module(name.partition(":")[0])
        for compiled, argument_types in kernels.registered():
            if name_of(compiled) == name and compiled.__module__ == module.__name__:
                compiled.compile(argument_types)


def words(done: int, needed: int, seconds: float) -> str:
    """Say how far it is."""
    often = "once per machine" if kernel_cache.folder() else "at every start: no folder to keep them, set NUMBA_CACHE_DIR to one"
    return f"kernels: {done} of {needed} compiled, {seconds:.0f} s; {often}"


def main() -> None:
    """Compile the kernels of the packages that are named, or all."""
    if "--worker" in sys.argv:
        _work()
        return
    started = monotonic()
    kernels.import_all(sys.argv[1:])
    end = "\r" if sys.stdout.isatty() else "\n"
    last = ""

    def show(done: int, needed: int, seconds: float) -> None:
        nonlocal last
        text = words(done, needed, seconds)
        if sys.stdout.isatty() or text[:16] != last[:16]:
            print(text, end=end, flush=True)
        last = text

    count = make_ready(show)
    kernel_cache.sweep({Path(kernel_cache.keep(compiled).cache_path or "").name for compiled, _ in kernels.registered()})
    print(f"{count} kernels ready after {monotonic() - started:.1f} s", flush=True)


if __name__ == "__main__":
    from scenario_gen.numerics import compiling  # noqa: PLW0406 - one module, not two

    compiling.main()
