# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Long work off the executor's thread: one thread per node, jobs in order, a newer job replaces a waiting one of its name."""

from collections import OrderedDict
from collections.abc import Callable
from contextlib import suppress
import threading

from scenario_gen.cancelling import cancellable, CancelledError
from scenario_gen.errors import RefusedError

Job = Callable[[Callable[[], bool]], object]
MOST_WAITING = 1000  # jobs, as many as requests of one service that ROS keeps
_own = threading.local()  # whose thread this is


def stop_if_left_behind() -> None:
    """End the job of this thread here if its worker has been closed; nothing happens on other threads.

    Raises:
        CancelledError: it has.
    """
    worker = getattr(_own, "worker", None)
    if worker is not None and worker.closed:
        raise CancelledError("cancelled: the node is not active any more")


class Worker:
    """Runs jobs one after the other; each gets a function that says whether it has been cancelled.

    A job that is cancelled before its turn still runs, so that it can answer whoever waits for it: it looks first. So does one
    that comes when too many wait, at once. A job that takes long asks `stop_if_cancelled` now and then.
    """

    def __init__(self, failed: Callable[[str, BaseException], None], owner: str = "node") -> None:
        """Start the thread, named after its `owner`; `failed` is called with a job's name and what it raised."""
        self._failed = failed
        self._waiting: OrderedDict[str, tuple[Job, threading.Event]] = OrderedDict()
        self._running: tuple[str, threading.Event] | None = None
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

    def cancel(self) -> list[str]:
        """Cancel the running job and the waiting ones; return their names, the running one first."""
        with self._changed:
            running = [self._running] if self._running else []
            every = running + [(name, cancelled) for name, (_, cancelled) in self._waiting.items()]
            for _, cancelled in every:
                cancelled.set()
        return [name for name, _ in every]

    def close(self, timeout: float = 0.5) -> None:
        """Cancel everything and end the thread; a job that does not listen is left behind after `timeout` seconds.

        What is left behind goes unheard: see `stop_if_left_behind`.
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
                self._running = (name, cancelled)
            self._do(name, job, cancelled.is_set)

    def _do(self, name: str, job: Job, cancelled: Callable[[], bool]) -> None:
        with suppress(CancelledError):  # nobody waits for it
            try:
                with cancellable(cancelled):
                    job(cancelled)
            except CancelledError:
                raise
            except Exception as error:
                stop_if_left_behind()
                self._failed(name, error)
