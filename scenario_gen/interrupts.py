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

from collections.abc import Iterator
from contextlib import contextmanager
import signal

_held = False
_pending = 0


class Interrupted(BaseException):
    """A signal asks for the end; no Exception, so that no handler of errors swallows it."""

    def __init__(self, number: int) -> None:
        super().__init__(f"stopped by {signal.Signals(number).name}")
        self.exit_code = 128 + number  # as a shell says it


def interrupt(number: int, _frame: object) -> None:
    """Signal handler: raise Interrupted, at once or when `uninterrupted` work is done."""
    global _pending  # noqa: PLW0603 - a signal has no other place to be noted
    if _held:
        _pending = number
    else:
        raise Interrupted(number)


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Let the work inside be finished before a signal takes effect; not to be nested."""
    global _held, _pending  # noqa: PLW0603
    _held = True
    try:
        yield
    finally:
        _held = False
    if _pending:
        number, _pending = _pending, 0
        raise Interrupted(number)
