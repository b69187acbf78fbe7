# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Long work off the executor's thread: one thread per node, jobs in order, a newer job replaces a waiting one of its name."""

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
    """Runs jobs one after the other; each gets a function that says whether it has been cancelled.

    A job that is cancelled before its turn still runs, at once, so that it can answer whoever waits for it: it looks first. So
    does one that comes when too many wait. A job that takes long asks `stop_if_cancelled` now and then.
    """

    def __init__(
        self,
        failed: Callable[[str, BaseException], None],
        owner: str = "node",
        done: Callable[[str], None] = lambda _: None,
    ) -> None:
        """Start the thread, named after its `owner`; `failed` gets a job's name and what it raised, `done` another's name."""
        self._failed, self._done = failed, done
        self._waiting: OrderedDict[str, tuple[Job, threading.Event]] = OrderedDict()
        self._running: tuple[str, threading.Event] | None = None
        self._began = 0.0
        self._changed = threading.Condition()
        self.closed = False
        self._thread = threading.Thread(target=self._run, daemon=True, name=f"worker of {owner}")
        self._thread.start()

    def submit(self, name: str, job: Job) -> None:
        """Queue a job; one of the same name that still waits is replaced, one that runs is cancelled."""
        with self._changed:
            self._waiting.pop(name, None)
            full = len(self._waiting) >= MOST_WAITING
            if not full:
                self._waiting[name] = (job, threading.Event())
                if self._running is not None and self._running[0] == name:
                    self._running[1].set()
                self._changed.notify()
        if full:
            self._failed(name, RefusedError(f"{MOST_WAITING} jobs wait already; ask again when some are done"))
            self._do(name, job, lambda: True)

    def cancel(self, only: str | None = None) -> list[str]:
        """Cancel the running job and the waiting ones, or those of one name; return their names, the running one first.

        Those that wait answer at once, on this thread, and not only when it would be their turn.
        """
        with self._changed:
            running = [self._running] if self._running and only in (None, self._running[0]) else []
            for _, cancelled in running:
                cancelled.set()
            waiting = [(name, self._waiting.pop(name)[0]) for name in list(self._waiting) if only in (None, name)]
        for name, job in waiting:
            self._do(name, job, lambda: True)
        return [name for name, _ in running] + [name for name, _ in waiting]

    def account(self) -> dict[str, str]:
        """Return what runs, for how many seconds, and how many jobs wait; nothing if none does."""
        with self._changed:
            if self._running is None:
                return {}
            return {
                "job": self._running[0],
                "seconds": f"{monotonic() - self._began:.0f}",
                "waiting": str(len(self._waiting)),
            }

    def close(self, timeout: float = 0.5) -> None:
        """Cancel everything and end the thread; a job that does not listen is abandoned after `timeout` seconds.

        What it still does has no effect: see `stop_if_abandoned`.
        """
        self.cancel()
        with self._changed:
            self.closed = True
            self._changed.notify()
        self._thread.join(timeout)

    def _run(self) -> None:
        _own.worker = self
        while True:
            with self._changed:
                self._running = None
                self._changed.wait_for(lambda: self.closed or bool(self._waiting))
                if not self._waiting:
                    return
                name, (job, cancelled) = self._waiting.popitem(last=False)
                self._running, self._began = (name, cancelled), monotonic()
            self._do(name, job, cancelled.is_set)

    def _do(self, name: str, job: Job, cancelled: Callable[[], bool]) -> None:
        with suppress(CancelledError):  # nobody waits for it
            try:
                with cancellable(cancelled):
                    job(cancelled)
                if not cancelled():
                    self._done(name)
            except CancelledError:
                raise
            except Exception as error:
                stop_if_abandoned()
                self._failed(name, error)
