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

"""Ctrl-C and SIGTERM, kept out of what must not be cut in two, such as a record that a bag is being given."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
import os
import signal

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_held = False
_pending: Callable[[], None] | None = None
_endings: list[Callable[[], None]] = []


def interrupt(_number: int, _frame: object) -> None:
    """Signal handler of nodes: raise KeyboardInterrupt, at once or when `uninterrupted` work is done."""
    _now_or_later(_raise)


def leave(number: int, _frame: object) -> None:
    """Signal handler of commands: clean up and end the process, at once or when `uninterrupted` work is done.

    Nothing is raised: an exception out of the blue is swallowed where Python calls back (when a module has been imported, say),
    and compiled code that it meets may crash.
    """
    _now_or_later(partial(_leave, number))


@contextmanager
def ending(clean_up: Callable[[], None]) -> Iterator[None]:
    """Let `leave` call `clean_up` while the work inside goes on."""
    _endings.append(clean_up)
    try:
        yield
    finally:
        _endings.remove(clean_up)


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Let the work inside be finished before a signal takes effect; not to be nested."""
    global _held  # noqa: PLW0603 - a signal has no other place to be noted
    _held = True
    try:
        yield
    finally:
        _held = False
    if _pending is not None:
        _pending()


def _now_or_later(act: Callable[[], None]) -> None:
    global _pending  # noqa: PLW0603
    if _held:
        _pending = act
    else:
        act()


def _raise() -> None:
    raise KeyboardInterrupt


def _leave(number: int) -> None:
    for other in SIGNALS:
        signal.signal(other, signal.SIG_IGN)
    for clean_up in reversed(_endings):
        with suppress(Exception):
            clean_up()
    cursor = "\x1b[?25h" if os.isatty(2) else ""  # a progress bar hides it
    with suppress(OSError):
        os.write(2, f"{cursor}stopped by {signal.Signals(number).name}\n".encode())
    os._exit(128 + number)  # as a shell says it
