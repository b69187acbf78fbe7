# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The time in a bag while it is played."""

from collections.abc import Callable
import threading
from time import monotonic

MAX_LAG_S = 1.0  # real time by which messages may be late and are caught up with
MAX_WAIT_S = 0.1  # between two looks at the rate


class BagTime:
    """Seconds since the bag's beginning; they pass `rate` times as fast as real time.

    One thread waits for the messages' times; any thread may pause, resume or end.
    """

    def __init__(self, rate: Callable[[], float]) -> None:
        """Begin paused at 0; `rate` returns the present rate."""
        self._rate = rate
        self._elapsed = 0.0
        self._updated_at = monotonic()
        self._due = 0.0  # time of the next message
        self._changed = threading.Condition(threading.RLock())
        self.paused = True
        self.ended = False

    def shown(self) -> float:
        """Return the time [s], at most that of the next message."""
        with self._changed:
            self._update()
            return min(self._elapsed, self._due)

    def pause(self, paused: bool) -> None:
        """Stop the time, or let it pass."""
        with self._changed:
            self._update()
            self.paused = paused
            self._changed.notify_all()

    def end(self) -> None:
        """End all waits."""
        with self._changed:
            self.ended = True
            self._changed.notify_all()

    def begin(self) -> None:
        """Begin a round."""
        with self._changed:
            self._elapsed = self._due = 0.0
            self._updated_at = monotonic()

    def wait(self, due: float) -> bool:
        """Wait until a message's time [s]; return False if the time ends before."""
        with self._changed:
            self._due = due
            while not self.ended:
                self._update()
                if not self.paused and self._elapsed >= due:
                    self._elapsed = min(self._elapsed, due + MAX_LAG_S * self._rate())
                    return True
                remaining = (due - self._elapsed) / self._rate()
                self._changed.wait(None if self.paused else min(remaining, MAX_WAIT_S))
            return False

    def _update(self) -> None:
        now = monotonic()
        if not self.paused:
            self._elapsed += (now - self._updated_at) * self._rate()
        self._updated_at = now
