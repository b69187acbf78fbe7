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

"""The open requests of a sampler: who waits, how far the one at work is, how one of them is cancelled by its name."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import count
import re
import threading
from time import monotonic
from typing import Any

from msg_conventions.diagnostics import Level
from scenario_gen.errors import InputError

SHOWN = 20  # waiting requests that are named
SILENCE = 10.0  # seconds after which a line on the terminal says how far a request is, though it is hardly farther
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_.-]{0,63}")


@dataclass
class OpenRequest:
    """One request: its name, the job that does it, and how far it is."""

    name: str
    job: str
    wanted: int
    began: float | None = None
    accepted: int = 0
    candidates: int = 0
    stamp_ns: int = 0
    said: tuple[int, float] = field(default=(0, 0.0))  # tenths and time of the last line on the terminal

    def progress(self, accepted: int, candidates: int, stamp_ns: int) -> None:
        """Take in how far it is."""
        self.accepted, self.candidates, self.stamp_ns = accepted, candidates, stamp_ns

    def seconds(self) -> float:
        """For how long it has been at work."""
        return 0.0 if self.began is None else monotonic() - self.began

    def values(self) -> dict[str, str]:
        """What /diagnostics says of it."""
        return {
            "request": self.name,
            "requested": str(self.wanted),
            "accepted": str(self.accepted),
            "candidates": str(self.candidates),
            "seconds": f"{self.seconds():.1f}",
        }


class OpenRequests:
    """The requests of a node that are open, as its statuses `progress` and `generate` on /diagnostics say."""

    def __init__(self, node: Any, cancel: Callable[[str], Sequence[str]]) -> None:
        """`cancel` ends the jobs of a name and returns those that there were."""
        self._node, self._cancel = node, cancel
        self._open: dict[str, OpenRequest] = {}
        self._numbers = count(1)
        self._one_at_a_time = threading.Lock()

    def add(self, asked: str = "", job: str = "", wanted: int = 0) -> OpenRequest:
        """Open a request; without a name of its own, or a job's, it has the next number.

        Raises:
            InputError: the name is none, or that of an open request.
        """
        with self._one_at_a_time:
            if asked and not NAME.fullmatch(asked):
                raise InputError(f"request is {asked!r}; a letter and up to 63 letters, digits, `_`, `-` or `.` are a name")
            if asked in self._open:
                raise InputError(f"request {asked!r} is open already; give another name, or wait for its answer")
            name = asked or str(next(self._numbers))
            self._open[name] = OpenRequest(name, job or f"request {name}", wanted)
            return self._open[name]

    def begin(self, request: OpenRequest) -> None:
        """Its turn has come."""
        request.began = monotonic()
        request.said = (0, request.began)
        self.tell()

    def end(self, request: OpenRequest, level: Level, message: str, **more: str) -> None:
        """It is done, cancelled or refused; `more` is said on /diagnostics beside how far it came."""
        with self._one_at_a_time:
            self._open.pop(request.name, None)
        self._node.status(level, f"request {request.name}: {message}", "generate", request.stamp_ns, **request.values(), **more)
        self._node.health.settle("generate")
        self.tell()

    def cancel(self, name: str) -> str:
        """Cancel one of them; return what to answer.

        Raises:
            InputError: none has that name.
        """
        with self._one_at_a_time:
            request, known = self._open.get(name), ", ".join(list(self._open)[:SHOWN])
        if request is None or not self._cancel(request.job):
            raise InputError(f"no request {name!r} is open; open: {known or 'none'}")
        return f"request {name} is cancelled, {request.accepted} of {request.wanted} scenarios were found"

    def tell(self) -> None:
        """Say on /diagnostics how far the request at work is, and on the terminal, if it is a good deal farther."""
        with self._one_at_a_time:
            running = next((request for request in self._open.values() if request.began is not None), None)
            waiting = [request for request in self._open.values() if request.began is None]
        if running is None:
            self._node.health.say(Level.OK, "no request is at work", "progress", {}, log=False)
            return
        values = running.values() | {"waiting": str(len(waiting))}
        values |= {f"waiting.{request.name}": f"{request.wanted} scenarios" for request in waiting[:SHOWN]}
        words = f"{running.accepted} of {running.wanted} scenarios from {running.candidates} candidates"
        message = f"request {running.name}: {words}, {running.seconds():.0f} s"
        tenths, now = 10 * running.accepted // max(running.wanted, 1), monotonic()
        farther = now - running.said[1] >= 1.0 and running.said[0] < tenths < 10
        log = farther or now - running.said[1] >= SILENCE
        if log:
            running.said = (tenths, now)
        self._node.health.say(Level.OK, message, "progress", values, running.stamp_ns, log=log)
