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

"""Work that somebody may have given up meanwhile: it asks now and then, wherever it stands, and ends."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from scenario_gen.errors import ScenarioGenError

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
