# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Long work off the executor's thread, as named jobs in order.

A new job replaces a waiting one with its name.

`concurrent.futures` replaces no waiting job, cancels no running one, and waits at the end for all.
"""

from collections import OrderedDict
from collections.abc import Callable
from contextlib import suppress
import threading
from time import monotonic

from scenario_gen.base.cancelling import cancellable, CancelledError
from scenario_gen.base.errors import RefusedError

Job = Callable[[Callable[[], bool]], object]
MAX_WAITING_COUNT = 1000  # jobs: as many as a service's queue of requests
_this_thread = threading.local()


def stop_if_abandoned() -> None:
    """End this thread's job if its worker has been closed; does nothing on other threads.

    Raises:
        CancelledError: the worker has been closed.
    """
    worker = getattr(_this_thread, "worker", None)
    if worker is not None and worker.closed:
        raise CancelledError("cancelled: the node is not active any more")


class Worker:
    """Runs jobs in the order of their submission.

    Each job gets a function that returns whether it has been cancelled; a long job calls
    `stop_if_cancelled` repeatedly. A job that is cancelled before its turn, or that exceeds the
    limit of waiting jobs, still runs at once, so that it can answer a caller.
    """

    def __init__(
        self,
        failed: Callable[[str, BaseException], None],
        owner: str = "node",
        done: Callable[[str], None] = lambda _: None,
        threads: int = 1,
    ) -> None:
        """Start the threads.

        Args:
            failed: called with a job's name and its error.
            owner: part of the threads' names.
            done: called with the name of a job that has succeeded.
            threads: jobs that run at a time; two jobs with one name never do.
        """
        self._failed = failed
        self._done = done
        self._waiting: OrderedDict[str, tuple[Job, threading.Event]] = OrderedDict()
        self._running: dict[str, tuple[threading.Event, float]] = {}  # cancelled, start time [s]
        self._changed = threading.Condition()
        self.closed = False
        self._threads = [
            threading.Thread(target=self._run, daemon=True, name=f"worker of {owner}")
            for _ in range(threads)
        ]
        for thread in self._threads:
            thread.start()

    def submit(self, name: str, job: Job) -> None:
        """Queue a job; a waiting one with its name is replaced, a running one is cancelled."""
        with self._changed:
            self._waiting.pop(name, None)
            is_full = len(self._waiting) >= MAX_WAITING_COUNT
            if not is_full:
                self._waiting[name] = (job, threading.Event())
                if name in self._running:
                    self._running[name][0].set()
                self._changed.notify()
        if is_full:
            message = f"{MAX_WAITING_COUNT} jobs wait already; ask again when some are done"
            self._failed(name, RefusedError(message))
            self._execute(name, job, lambda: True)

    def cancel(self, only: str | None = None) -> list[str]:
        """Cancel all jobs, or those with one name; return their names, the running ones first.

        Waiting jobs run at once on this thread, so that they can answer.
        """
        with self._changed:
            running = [name for name in self._running if only in (None, name)]
            for name in running:
                self._running[name][0].set()
            names = [name for name in self._waiting if only in (None, name)]
            waiting = {name: self._waiting.pop(name)[0] for name in names}
        for name, job in waiting.items():
            self._execute(name, job, lambda: True)
        return running + names

    def status(self) -> dict[str, str]:
        """Return the running jobs, the longest time [s] and the count of waiting jobs.

        {} when idle.
        """
        with self._changed:
            if not self._running:
                return {}
            start = min(start for _, start in self._running.values())
            return {
                "job": ", ".join(self._running),
                "seconds": f"{monotonic() - start:.0f}",
                "waiting": str(len(self._waiting)),
            }

    def close(self, timeout: float = 0.5) -> None:
        """Cancel everything and end the threads.

        A job that continues after `timeout` seconds is abandoned.

        An abandoned job has no further effect: see `stop_if_abandoned`.
        """
        self.cancel()
        with self._changed:
            self.closed = True
            self._changed.notify_all()
        deadline = monotonic() + timeout
        for thread in self._threads:
            thread.join(max(0.0, deadline - monotonic()))

    def _next(self) -> str | None:
        """Return the name of the first waiting job that no running one shares."""
        return next((name for name in self._waiting if name not in self._running), None)

    def _run(self) -> None:
        _this_thread.worker = self
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self.closed or self._next() is not None)
                name = self._next()
                if name is None:
                    return
                job, cancelled = self._waiting.pop(name)
                self._running[name] = (cancelled, monotonic())
            self._execute(name, job, cancelled.is_set)
            with self._changed:
                del self._running[name]
                self._changed.notify()

    def _execute(self, name: str, job: Job, cancelled: Callable[[], bool]) -> None:
        with suppress(CancelledError):  # nobody waits for its result
            try:
                with cancellable(cancelled):
                    job(cancelled)
                if not cancelled():
                    self._done(name)
            except Exception as error:
                stop_if_abandoned()
                self._failed(name, error)
