# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Long work off the executor's thread: jobs in order, a newer job replaces a waiting one of its name."""

from collections import OrderedDict
from collections.abc import Callable
from contextlib import suppress
import threading
from time import monotonic

from scenario_gen.base.cancelling import cancellable, CancelledError
from scenario_gen.base.errors import RefusedError

Job = Callable[[Callable[[], bool]], object]
MOST_WAITING = 1000  # jobs, as many as requests of one service that ROS keeps
_own = threading.local()  # whose thread this is


def stop_if_abandoned() -> None:
    """End the job of this thread here if its worker has been closed; nothing happens on other threads.

    Raises:
        CancelledError: it has.
    """
    worker = getattr(_own, "worker", None)
    if worker is not None and worker.closed:
        raise CancelledError("cancelled: the node is not active any more")


class Worker:
    """Runs jobs in the order in which they came; each gets a function that says whether it has been cancelled.

    A job that is cancelled before its turn still runs, at once, so that it can answer whoever waits for it: it looks first. So
    does one that comes when too many wait. A job that takes long asks `stop_if_cancelled` now and then.
    """

    def __init__(
        self,
        failed: Callable[[str, BaseException], None],
        owner: str = "node",
        done: Callable[[str], None] = lambda _: None,
        threads: int = 1,
    ) -> None:
        """Start the threads, one for each job at a time.

        Args:
            failed: gets a job's name and what it raised.
            owner: after whom the threads are named.
            done: gets the name of a job that has ended well.
            threads: how many jobs run at a time; never two of one name.
        """
        self._failed, self._done = failed, done
        self._waiting: OrderedDict[str, tuple[Job, threading.Event]] = OrderedDict()
        self._running: dict[str, tuple[threading.Event, float]] = {}  # since when
        self._changed = threading.Condition()
        self.closed = False
        self._threads = [
            threading.Thread(target=self._run, daemon=True, name=f"worker of {owner}")
            for _ in range(threads)
        ]
        for thread in self._threads:
            thread.start()

    def submit(self, name: str, job: Job) -> None:
        """Queue a job; one of the same name that still waits is replaced, one that runs is cancelled."""
        with self._changed:
            self._waiting.pop(name, None)
            full = len(self._waiting) >= MOST_WAITING
            if not full:
                self._waiting[name] = (job, threading.Event())
                if name in self._running:
                    self._running[name][0].set()
                self._changed.notify()
        if full:
            self._failed(
                name,
                RefusedError(f"{MOST_WAITING} jobs wait already; ask again when some are done"),
            )
            self._do(name, job, lambda: True)

    def cancel(self, only: str | None = None) -> list[str]:
        """Cancel the running jobs and the waiting ones, or those of one name; return their names, the running ones first.

        Those that wait answer at once, on this thread, and not only when it would be their turn.
        """
        with self._changed:
            running = [name for name in self._running if only in (None, name)]
            for name in running:
                self._running[name][0].set()
            waiting = [
                (name, self._waiting.pop(name)[0])
                for name in list(self._waiting)
                if only in (None, name)
            ]
        for name, job in waiting:
            self._do(name, job, lambda: True)
        return running + [name for name, _ in waiting]

    def account(self) -> dict[str, str]:
        """Return what runs, for how many seconds (the longest), and how many jobs wait; nothing if none does."""
        with self._changed:
            if not self._running:
                return {}
            began = min(since for _, since in self._running.values())
            return {
                "job": ", ".join(self._running),
                "seconds": f"{monotonic() - began:.0f}",
                "waiting": str(len(self._waiting)),
            }

    def close(self, timeout: float = 0.5) -> None:
        """Cancel everything and end the threads; a job that does not listen is abandoned after `timeout` seconds.

        What it still does has no effect: see `stop_if_abandoned`.
        """
        self.cancel()
        with self._changed:
            self.closed = True
            self._changed.notify_all()
        deadline = monotonic() + timeout
        for thread in self._threads:
            thread.join(max(0.0, deadline - monotonic()))

    def _next(self) -> str | None:
        """Return the name of the first job that waits, and of whose name none runs."""
        return next((name for name in self._waiting if name not in self._running), None)

    def _run(self) -> None:
        _own.worker = self
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self.closed or self._next() is not None)
                name = self._next()
                if name is None:
                    return
                job, cancelled = self._waiting.pop(name)
                self._running[name] = (cancelled, monotonic())
            self._do(name, job, cancelled.is_set)
            with self._changed:
                del self._running[name]
                self._changed.notify()

    def _do(self, name: str, job: Job, cancelled: Callable[[], bool]) -> None:
        with suppress(CancelledError):  # nobody waits for it
            try:
                with cancellable(cancelled):
                    job(cancelled)
                if not cancelled():
                    self._done(name)
            except Exception as error:
                stop_if_abandoned()
                self._failed(name, error)
