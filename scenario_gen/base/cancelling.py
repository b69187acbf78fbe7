# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Work that somebody may have given up meanwhile: it asks now and then, wherever it stands, and ends."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from scenario_gen.base.errors import ScenarioGenError

_asked: ContextVar[Callable[[], bool]] = ContextVar("cancelled", default=lambda: False)


class CancelledError(ScenarioGenError):
    """Nobody waits for the result any more."""


@contextmanager
def cancellable(cancelled: Callable[[], bool]) -> Iterator[None]:
    """Let `stop_if_cancelled` ask `cancelled` while the work inside goes on, on this thread."""
    before = _asked.set(cancelled)
    try:
        yield
    finally:
        _asked.reset(before)


def stop_if_cancelled() -> None:
    """End the work here if it was cancelled; called between pieces of long work.

    Raises:
        CancelledError: it was.
    """
    if _asked.get()():
        raise CancelledError("cancelled")
