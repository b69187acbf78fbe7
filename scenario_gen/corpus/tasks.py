# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Tasks: pure functions that write one file each, distributed over processes.

A task writes to a temporary name, syncs and renames. A file that exists is therefore complete,
even if a run was killed, and the existing files are the only record of progress. Local processes
or a Dask cluster only run the tasks; they hold no state that a killed run would lose.
"""

from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError, Executor, FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, ExitStack, suppress
from dataclasses import dataclass
from functools import partial
from itertools import islice
import json
import logging
import multiprocessing
import os
from pathlib import Path
import shutil
import traceback
from typing import Any, Protocol, TypeVar

from scenario_gen import __version__
from scenario_gen.base.documents import read_json
from scenario_gen.base.errors import describe, InputError, needs, of_system, ScenarioGenError
from scenario_gen.base.folders import (
    claimed,
    naming,
    PREFIX,
    scratch,
    sweep,
    sync,
    sync_tree,
    write_text,
)
from scenario_gen.base.provenance import versions
from scenario_gen.base.signals import (
    cleaned_up,
    ctrl_c_blocked,
    environment_set,
    worker_pool,
)


class _Task(Protocol):
    """A task that writes one file."""

    @property
    def target(self) -> Path:
        """The file."""


Task = TypeVar("Task")
Target = TypeVar("Target", bound=_Task)
Progress = Callable[[int, int], None]
"""Called with the number of finished tasks and the number of all tasks."""
# One thread for each worker. The processes are started with these variables.
WORKER_ENVIRONMENT = dict.fromkeys(
    ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"
)
MANIFEST = {"type": "object", "properties": {"versions": {"type": "object"}}}


@contextmanager
def arriving(target: Path) -> Iterator[Path]:
    """Give a temporary path; at the end its file or folder is synced and renamed to `target`.

    The temporary path is in the folder of `target`.

    Raises:
        OSError: the disk is full or fails; the message names the file.
    """
    target.parent.mkdir(parents=True, exist_ok=True)
    with scratch(target.parent) as folder:
        temporary = folder / target.name  # the files of a bag are named after its folder
        try:
            yield temporary
        except OSError as error:  # libraries name no file, or the temporary one
            if str(error.filename or temporary).startswith(str(temporary)):
                error.filename = str(target)
            raise
        with naming(target):
            sync_tree(temporary)
            if target.is_dir():  # from a task that was killed before it wrote its last file
                shutil.rmtree(target)
            temporary.replace(target)
        sync(target.parent)


def check_out(out: Path, inputs: Sequence[Path]) -> None:
    """Refuse a file as the folder for results, and a folder within an input.

    Raises:
        InputError: `out` is one of these.
    """
    if out.exists() and not out.is_dir():
        raise InputError(f"--out {out} is a file; name a folder")
    for source in inputs:
        if out.resolve().is_relative_to(source.resolve()):
            raise InputError(f"{out} is within the input {source}; name a folder outside of it")


@contextmanager
def held(out: Path) -> Iterator[None]:
    """Lock a folder of results against other runs, and remove temporary files at the end.

    Raises:
        InputError: another run uses the folder.
    """
    with claimed(out / f"{PREFIX}run", out), cleaned_up(partial(sweep, out)):
        sweep(out)
        yield
        sweep(out)


def agree(out: Path, name: str, document: Mapping[str, Any], kind: str) -> dict[str, Any]:
    """Write the manifest of results, or check that an existing one is the same; return it.

    The manifest also has the versions of the release and its libraries.

    Args:
        out: folder of the results.
        name: file name of the manifest.
        document: its content.
        kind: the kind of results, for messages.

    Raises:
        InputError: the folder has other content, or is of another release.
    """
    manifest = out / name
    document = {**document, "versions": versions()}
    text = json.dumps(document, indent=1) + "\n"
    if not manifest.exists():
        if _has_entries(out):
            raise InputError(f"{out} is not empty and no {kind}; name another folder")
        with arriving(manifest) as part:
            write_text(part, text)
        return document
    existing: dict[str, Any] = read_json(manifest, MANIFEST)
    release = existing.get("versions", {}).get("scenario_gen", "")
    if existing.get("format") != document.get("format") or release not in ("", __version__):
        raise InputError(
            f"{out} is a {kind} of release {release or 'before ' + __version__}, this is"
            f" {__version__}: it can be read, but not continued; name another folder"
        )
    changed = [key for key in document if existing.get(key) != document[key] and key != "versions"]
    if changed:
        raise InputError(
            f"{out} is a {kind} with other {', '.join(changed)};"
            " name another folder, or remove this one"
        )
    return existing


def _has_entries(folder: Path) -> bool:
    """Whether a folder has entries; hidden files do not count."""
    return any(not path.name.startswith(".") for path in folder.iterdir())


@dataclass(frozen=True)
class Workers:
    """The processes that run the tasks of a command.

    Attributes:
        count: number of processes; 1 uses only this process, 0 starts one per core.
        scheduler: address of a Dask scheduler, which replaces `count`.
        on_progress: called when a task has finished.
    """

    count: int = 1
    scheduler: str = ""
    on_progress: Progress = lambda *_: None


class Spread:
    """Runs a function on many tasks: in this process, in local processes, or on a Dask cluster.

    Local processes are started when the first task needs them, and are used until the end. They
    are connected to their parent by pipes, which no other account of the machine can reach.
    """

    def __init__(self, workers: Workers, stack: ExitStack) -> None:
        self._workers = workers
        self._count = workers.count or os.cpu_count() or 1
        self._stack = stack
        self._executor: Executor | None = None

    def __call__(self, function: Callable[[Task], Any], tasks: Sequence[Task]) -> list[str]:
        """Run independent tasks.

        Args:
            function: module-level and pure: it writes the file of its task, and may be repeated
                when that file exists.
            tasks: each has a name.

        Returns:
            A sentence for each task that failed; the others are finished.

        Raises:
            InputError: the connection to the scheduler was lost.
        """
        failed = []
        for count, message in enumerate(self._outcomes(function, tasks), start=1):
            if message:
                failed.append(message)
            self._workers.on_progress(count, len(tasks))
        return sorted(failed)

    def _outcomes(self, function: Callable[[Task], Any], tasks: Sequence[Task]) -> Iterator[str]:
        """Yield the error message of each task as it finishes, "" for success."""
        run, scheduler = partial(_guarded, function), self._workers.scheduler
        if self._count == 1 and not scheduler:
            yield from map(run, tasks)
            return
        try:
            # Tasks that ran or waited when a process died are repeated alone.
            for task in (yield from self._attempt(run, tasks)):
                for error in (yield from self._attempt(run, [task])).values():
                    name = getattr(task, "name", task)
                    yield f"{name}: its process died or cannot run it: {describe(error)}"
        except (OSError, TimeoutError, CancelledError) as error:
            if not scheduler:
                raise
            lost = f"{scheduler} is lost or does not answer: {describe(error)}"
            raise InputError(f"{lost}; the same command resumes where it stopped") from error

    def _attempt(
        self, run: Callable[[Task], str], tasks: Sequence[Task]
    ) -> Generator[str, None, dict[Task, BaseException]]:
        """Yield the outcomes of tasks; return the others, whose processes died.

        A cluster has all tasks; local processes have two each, so that few are lost with one.
        """
        waiting = iter(tasks)
        room = len(tasks) if self._workers.scheduler else 2 * self._count
        running: dict[Future[str], Task] = {}
        lost: dict[Task, BaseException] = {}
        while True:
            for task in islice(waiting, room - len(running)):
                running[self._submit(run, task)] = task
            if not running:
                return lost
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            if not self._workers.scheduler and any(future.exception() for future in done):
                done, _ = wait(running)
                self._end()
            for future in done:
                task = running.pop(future)
                if error := future.exception():
                    lost[task] = error
                else:
                    yield future.result()

    def _submit(self, run: Callable[[Task], str], task: Task) -> "Future[str]":
        """Submit a task, to new processes if one has died."""
        with ctrl_c_blocked(), environment_set(WORKER_ENVIRONMENT):
            with suppress(BrokenProcessPool):
                return self._processes().submit(run, task)
            self._end()
            return self._processes().submit(run, task)

    def _processes(self) -> Executor:
        """Return the processes, which are started if there are none."""
        if self._executor is None and self._workers.scheduler:
            client = self._stack.enter_context(_client(self._workers.scheduler))
            self._executor = client.get_executor(pure=False)
        elif self._executor is None:
            self._stack.enter_context(cleaned_up(_kill_children))
            self._stack.callback(self._end)
            self._executor = worker_pool(self._count)
        return self._executor

    def _end(self) -> None:
        """End the local processes at once; they write no more."""
        _kill_children()
        if self._executor is not None:
            self._executor.shutdown(cancel_futures=True)
            self._executor = None


def _kill_children() -> None:
    """Kill the processes, and wait until their locks are free."""
    children = multiprocessing.active_children()
    for process in children:
        process.kill()
    for process in children:
        process.join(5.0)


@contextmanager
def spread(workers: Workers) -> Iterator[Spread]:
    """Give a runner of tasks; its processes end with the block."""
    with ExitStack() as stack:
        yield Spread(workers, stack)


def _guarded(function: Callable[[Any], Any], task: Any) -> str:
    """Run one task; return the message of an error, so that the other tasks continue."""
    name = getattr(task, "name", task)
    try:
        function(task)
    except OSError as error:
        return f"{name}: {of_system(error)}"
    except (ScenarioGenError, MemoryError) as error:
        return f"{name}: {describe(error)}"
    except Exception as error:  # a bug here or in a library: report its place in the source
        *_, (frame, line) = traceback.walk_tb(error.__traceback__)
        place = f"{Path(frame.f_code.co_filename).name}:{line}"
        return f"{name}: {type(error).__name__} at {place}: {describe(error)}"
    return ""


@contextmanager
def _client(scheduler: str) -> Iterator[Any]:
    """Give a client of a running scheduler."""
    needs("corpus", "dask", "distributed")
    from distributed import Client

    # Dead workers and a lost scheduler are reported by the tasks. Each logger has its own level.
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    with Client(scheduler) as client:
        yield client
