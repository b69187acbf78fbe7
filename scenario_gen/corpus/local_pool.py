# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Local processes that run tasks; only the task that ends its process fails.

The processes are connected to their parent by pipes, so that no other account of the machine can
reach them.
"""

from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from itertools import islice
import multiprocessing
from typing import TypeVar

from scenario_gen.base.signals import (
    cleaned_up,
    ctrl_c_blocked,
    environment_set,
    worker_pool,
)

Task = TypeVar("Task")

# One thread for each worker. The processes are started with these variables.
WORKER_ENVIRONMENT = dict.fromkeys(
    ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"
)
_SUBMITTED_RATIO = 2  # tasks for each process: one that runs, and one that waits


class LocalPool:
    """Processes on this machine, started when the first task needs them."""

    def __init__(self, count: int) -> None:
        self._count = count
        self._executor: ProcessPoolExecutor | None = None

    def outcomes(self, run: Callable[[Task], str], tasks: Sequence[Task]) -> Iterator[str]:
        """Yield what a function returns for each task as it finishes.

        Args:
            run: module-level; it may be repeated.
            tasks: each has a name.
        """
        suspects = yield from self._attempt(run, tasks)
        for task in suspects:
            failed = yield from self._attempt(run, [task])
            if failed:
                name = getattr(task, "name", task)
                yield f"{name}: its process died: it crashed, or was killed for lack of memory"

    def _attempt(
        self, run: Callable[[Task], str], tasks: Sequence[Task]
    ) -> Generator[str, None, list[Task]]:
        """Yield the outcomes of tasks; return those that ran or waited when a process died."""
        waiting = iter(tasks)
        running: dict[Future[str], Task] = {}
        lost: list[Task] = []
        while True:
            for task in islice(waiting, _SUBMITTED_RATIO * self._count - len(running)):
                running[self._submit(run, task)] = task
            if not running:
                return lost
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            if any(map(_has_died, done)):
                done, _ = wait(running)
                self.end()
            lost += [running[future] for future in done if _has_died(future)]
            yield from (future.result() for future in done if not _has_died(future))
            running = {future: task for future, task in running.items() if future not in done}

    def _submit(self, run: Callable[[Task], str], task: Task) -> "Future[str]":
        """Submit a task, to new processes if one has died."""
        with ctrl_c_blocked(), environment_set(WORKER_ENVIRONMENT):
            if self._executor is not None:
                with suppress(BrokenProcessPool):
                    return self._executor.submit(run, task)
            self._executor = worker_pool(self._count)
            return self._executor.submit(run, task)

    def end(self) -> None:
        """End the processes at once; they write no more."""
        executor, self._executor = self._executor, None
        if executor is not None:
            _kill_children()
            executor.shutdown(cancel_futures=True)


def _has_died(future: "Future[str]") -> bool:
    """Return whether the process of a finished task has died."""
    return isinstance(future.exception(), BrokenProcessPool)


def _kill_children() -> None:
    """Kill the processes, and wait until their locks are free."""
    children = multiprocessing.active_children()
    for process in children:
        process.kill()
    for process in children:
        process.join(5.0)


@contextmanager
def local_pool(count: int) -> Iterator[LocalPool]:
    """Give local processes, which end with the block, or with a signal."""
    pool = LocalPool(count)
    with cleaned_up(_kill_children):
        try:
            yield pool
        finally:
            pool.end()
