# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Cancellation of long work: the work checks a flag between its pieces, and ends."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_is_cancelled: ContextVar[Callable[[], bool]] = ContextVar("cancelled", default=lambda: False)


class CancelledError(BaseException):
    """The work was cancelled: nobody waits for its result.

    As asyncio's, it is no Exception: what takes an error for a refusal, and goes on, lets it pass.
    """


@contextmanager
def cancellable(cancelled: Callable[[], bool]) -> Iterator[None]:
    """Let `stop_if_cancelled` call `cancelled` during the work inside, on this thread."""
    before = _is_cancelled.set(cancelled)
    try:
        yield
    finally:
        _is_cancelled.reset(before)


def stop_if_cancelled() -> None:
    """End the work if it was cancelled; called between pieces of long work.

    Raises:
        CancelledError: it was.
    """
    if _is_cancelled.get()():
        raise CancelledError("cancelled")
