# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Tasks: pure functions that each write one file, mapped over processes; what is done is what is there.

A task writes to a temporary name, syncs and renames, so a file that is there is whole, whoever was killed. Dask does the
distribution, nothing else: it holds no state that a killed run would lose.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager, ExitStack, suppress
from dataclasses import dataclass
from functools import partial
import json
import logging
import multiprocessing
import os
from pathlib import Path
import shutil
import tempfile
import traceback
from typing import Any, Protocol, TypeVar
from uuid import uuid4

from scenario_gen.base.documents import read_json
from scenario_gen.base.errors import describe, InputError, needs, of_system, ScenarioGenError
from scenario_gen.base.folders import naming, scratch, sync, sync_tree, write_text
from scenario_gen.base.folders.scratch import claimed, PREFIX, sweep_tree
from scenario_gen.base.signals import cleaned_up, ctrl_c_blocked
from scenario_gen.base.stores import create, fetched, Place, Remote, upload
from scenario_gen.base.stores import temporary as scratch_folder


class _Task(Protocol):
    """What writes one file."""

    @property
    def target(self) -> Place:
        """The file."""


Task = TypeVar("Task")
Target = TypeVar("Target", bound=_Task)
Progress = Callable[[int, int], None]
"""Called with how many tasks are done, of how many."""
WORKERS = {  # their environment: one thread each; Dask's own has them return every freed array to the system, a fifth of all CPU
    **dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"),
    "DASK_LOGGING__DISTRIBUTED": "critical",
}


@contextmanager
def arriving(target: Place) -> Iterator[Path]:
    """Give a temporary path beside `target`; at the end what was written there, file or folder, takes its name, synced.

    To a store it is copied: each object is whole or not there.

    Raises:
        OSError: the disk is full, or fails; it names the file.
        InputError: the store refuses it or goes on failing.
    """
    if isinstance(target, Remote):
        with scratch(scratch_folder()) as place:
            yield place / target.name
            upload(place / target.name, target)
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    with scratch(target.parent) as place:
        temporary = place / target.name  # for a bag's files are called as its folder is
        yield temporary
        sync_tree(temporary)
        with naming(target):
            if target.is_dir():  # of a task that was killed before its last file
                shutil.rmtree(target)
            temporary.replace(target)
        sync(target.parent)


def check_out(out: Place, read: Sequence[Place]) -> None:
    """Refuse a file as the folder of results, and a folder in what is read.

    Raises:
        InputError: it is one.
    """
    if isinstance(out, Path) and out.exists() and not out.is_dir():
        raise InputError(f"--out {out} is a file; name a folder")
    own, *others = (
        f"{place.resolve() if isinstance(place, Path) else place}/" for place in (out, *read)
    )
    for source, other in zip(read, others, strict=True):
        if own.startswith(other):
            raise InputError(
                f"{out} lies in {source}, of which it would become a part; name a folder outside of it"
            )


@contextmanager
def held(out: Place) -> Iterator[None]:
    """Keep other runs out of a folder of results, and remove at the end what runs have left there.

    A store has no locks: there two runs that `agreed` write the same bytes, each object whole.

    Raises:
        InputError: another run is at work there.
    """
    if isinstance(out, Remote):
        yield
        return
    with claimed(out / f"{PREFIX}run", out), cleaned_up(partial(sweep_tree, out)):
        sweep_tree(out)
        yield
        sweep_tree(out)


def agree(out: Place, name: str, document: Mapping[str, Any], kind: str) -> None:
    """Write down what results are of, or see that what was written there before is the same.

    Args:
        out: folder of the results.
        name: of the file.
        document: its content.
        kind: of results, in messages.

    Raises:
        InputError: the folder holds something else.
    """
    place, text = out / name, json.dumps(document, indent=1) + "\n"
    if not place.exists():
        if (
            out.exists()
            if isinstance(out, Remote)
            else any(not path.name.startswith(".") for path in out.iterdir())
        ):
            raise InputError(f"{out} is not empty and no {kind}; name another folder")
        if isinstance(place, Path):
            with arriving(place) as part:
                write_text(part, text)
            return
        if create(place, text.encode()):
            return
    with fetched([place]) as (here,):
        before = read_json(here, {"type": "object"})
    if other := [key for key in document if before.get(key) != document[key]]:
        raise InputError(
            f"{out} is a {kind} of other {', '.join(other)}; name another folder, or remove this one"
        )


def undone(tasks: Sequence[Target]) -> list[Target]:
    """Return the tasks whose file is not there; each folder is listed once."""
    there = {
        str(path) for folder in {task.target.parent for task in tasks} for path in folder.glob("*")
    }
    return [task for task in tasks if str(task.target) not in there]


@dataclass(frozen=True)
class Workers:
    """Who does the tasks of a command.

    Attributes:
        count: processes; 1 runs in this one, 0 takes one for each core.
        scheduler: address of a Dask scheduler, instead of `count`.
        told: called with how far it is.
    """

    count: int = 1
    scheduler: str = ""
    told: Progress = lambda *_: None


class Spread:
    """Runs a function on each of many tasks: in this process, in processes of this machine, or on a cluster.

    A cluster of this machine is started when the first task needs it, and serves until the end.
    """

    def __init__(self, workers: Workers, stack: ExitStack) -> None:
        self._workers = workers.count or os.cpu_count() or 1
        self._scheduler, self._told, self._stack = workers.scheduler, workers.told, stack
        self._client: Any = None

    def __call__(self, function: Callable[[Task], Any], tasks: Sequence[Task]) -> list[str]:
        """Run tasks, none of which depends on another.

        Args:
            function: of a module, pure: it writes its task's file, and may be run again where that file is.
            tasks: each has a name.

        Returns:
            A sentence for each task that failed; the others are done.

        Raises:
            InputError: the scheduler was lost.
        """
        failed = []
        for done, message in enumerate(self._outcomes(function, tasks), start=1):
            failed += [message] if message else []
            self._told(done, len(tasks))
        return sorted(failed)

    def _outcomes(self, function: Callable[[Task], Any], tasks: Sequence[Task]) -> Iterator[str]:
        """Yield for each task, as it ends, why it failed, "" if it did not."""
        if not tasks or (self._workers == 1 and not self._scheduler):
            yield from (_guarded(function, task) for task in tasks)
            return
        needs("corpus", "dask", "distributed")
        try:
            if self._client is None:
                self._client = self._stack.enter_context(_client(self._workers, self._scheduler))
            yield from self._distributed(function, tasks)
        except (OSError, TimeoutError, CancelledError) as error:
            lost = f"{self._scheduler or 'Dask'} is lost or does not answer: {describe(error)}"
            raise InputError(f"{lost}; the same command goes on where it stopped") from error

    def _distributed(
        self, function: Callable[[Task], Any], tasks: Sequence[Task]
    ) -> Iterator[str]:
        """Yield as `_outcomes` does.

        Tasks whose workers died are run again one at a time at the end, so that only the one that ends them fails.
        """
        from distributed import as_completed

        group = uuid4().hex  # one group of keys, which Dask queues
        keys = [(group, k) for k in range(len(tasks))]
        running = dict(
            zip(self._client.map(partial(_guarded, function), tasks, key=keys), tasks, strict=True)
        )
        suspects = []
        for future in as_completed(running):
            if future.status != "error":
                yield future.result()
            elif len(tasks) > 1:
                suspects.append(running[future])
            else:
                yield f"{getattr(tasks[0], 'name', 'a task')}: {future.exception()}"
        for task in suspects:
            yield from self._distributed(function, [task])


@contextmanager
def spread(workers: Workers) -> Iterator[Spread]:
    """Give what runs tasks."""
    with ExitStack() as stack:
        yield Spread(workers, stack)


def _guarded(function: Callable[[Any], Any], task: Any) -> str:
    """Run one task; an error of its own input is a sentence, and does not end the others."""
    try:
        function(task)
    except OSError as error:
        return f"{getattr(task, 'name', task)}: {of_system(error)}"
    except (ScenarioGenError, MemoryError) as error:
        return f"{getattr(task, 'name', task)}: {describe(error)}"
    except Exception as error:  # a fault of ours, or of a library: of this case, and its place is said for who mends it
        *_, (frame, line) = traceback.walk_tb(error.__traceback__)
        place = f"{Path(frame.f_code.co_filename).name}:{line}"
        return (
            f"{getattr(task, 'name', task)}: {type(error).__name__} at {place}: {describe(error)}"
        )
    return ""


@contextmanager
def _client(workers: int, scheduler: str) -> Iterator[Any]:
    """A client of a cluster of processes on this machine, or of one that runs."""
    import dask
    from distributed import Client, LocalCluster

    for name in ("distributed", "distributed.client"):  # each has a level of its own
        logging.getLogger(name).setLevel(
            logging.CRITICAL
        )  # workers that die and a lost scheduler are named here
    with ExitStack() as stack:
        cluster: Any = scheduler
        if not scheduler:
            settings = {
                "temporary-directory": str(
                    stack.enter_context(scratch(Path(tempfile.gettempdir())))
                ),
                "distributed.scheduler.worker-saturation": 1.0,  # who is at work takes no further task
                "distributed.worker.daemon": True,
                "distributed.worker.profile.enabled": False,
                "distributed.admin.tick.interval": "500ms",
                "distributed.nanny.pre-spawn-environ": WORKERS,
            }
            sizes = {"n_workers": workers, "threads_per_worker": 1, "memory_limit": 0}
            stack.enter_context(dask.config.set(settings))
            with ctrl_c_blocked():
                cluster = stack.enter_context(
                    LocalCluster(**sizes, processes=True, dashboard_address="127.0.0.1:0")
                )
                stack.enter_context(cleaned_up(partial(_end, cluster)))
        yield stack.enter_context(Client(cluster))


def _end(cluster: Any) -> None:
    """End the processes of a cluster at once, so that they write nothing more, and nobody starts them again."""
    cluster.loop.add_callback(cluster.loop.stop)
    for process in multiprocessing.active_children():
        process.kill()
        with suppress(
            ChildProcessError
        ):  # Dask was told already, and else is to be told: it fails where another takes the news
            os.waitid(os.P_PID, process.pid or 0, os.WEXITED | os.WNOWAIT)
