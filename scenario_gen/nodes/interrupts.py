"""Ctrl-C and SIGTERM, kept out of what must not be cut in two, such as a record that a bag is being given."""

from collections.abc import Iterator
from contextlib import contextmanager

_held = False
_pending = False


def interrupt(_number: int, _frame: object) -> None:
    """Signal handler: raise KeyboardInterrupt, at once or when `uninterrupted` work is done."""
    global _pending  # noqa: PLW0603 - a signal has no other place to be noted
    if _held:
        _pending = True
    else:
        raise KeyboardInterrupt


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Let the work inside be finished before a signal takes effect; not to be nested."""
    global _held  # noqa: PLW0603
    _held = True
    try:
        yield
    finally:
        _held = False
    if _pending:
        raise KeyboardInterrupt
