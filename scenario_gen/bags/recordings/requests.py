# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Which scenarios of a request are there: entries and summaries of `scenarios/info` matched with the scenarios.

Messages come in any order. A message that comes twice (from a sampler that was restarted, or after a subscriber was lost and
found again) counts once.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
import heapq

from msg_conventions.diagnostics import Level, Status
from msg_conventions.scenario_info import decode_info, Info, RequestSummary, ScenarioEntry
from msg_conventions.scenarios import digest
from scenario_gen.base.errors import InputError

MOST_ENTRIES = 300_000  # that are remembered; beyond, the oldest requests are forgotten
MOST_UNMATCHED = 10_000  # scenarios that wait for their entry; beyond, the oldest are forgotten
MOST_WHOLE = 1000  # requests that are remembered as whole
NO_STATUS = Status(
    "", Level.OK, ""
)  # of waiting entries: their texts are long, and there may be very many


@dataclass
class TrackedRequest:
    """One request: which entries of it came, and which scenarios.

    Attributes:
        request: its id.
        seed: None until an entry names it.
        entries: SHA-256 of its scenarios by index, in the order of the entries.
        awaited: entries whose scenarios have not come, by SHA-256.
        came: how many scenarios have come.
        summary: its summary, once there is one.
        kept: scenarios, where `keep` is called.
    """

    request: str
    seed: int | None = None
    entries: dict[int, str] = field(default_factory=dict)
    awaited: dict[str, ScenarioEntry] = field(default_factory=dict)
    came: int = 0
    summary: RequestSummary | None = None
    kept: list[tuple[str, int, ScenarioEntry, bytes]] = field(default_factory=list)

    @property
    def whole(self) -> bool:
        """Whether it is closed and no scenario is missing."""
        return self.summary is not None and not self.missing

    @property
    def missing(self) -> int:
        """How many published scenarios have not come."""
        return max(0, (self.summary.published if self.summary else len(self.entries)) - self.came)

    def keep(self, entry: ScenarioEntry, data: bytes, seed: int, most: int) -> None:
        """Keep a scenario; of more than `most`, drop one by lot, which depends on the seed and not on the order of arrival."""
        lot = digest(f"{seed} {entry.sha256}".encode())
        heapq.heappush(self.kept, (lot, entry.index, entry, data))
        if len(self.kept) > most:
            heapq.heappop(self.kept)

    def in_order(self) -> list[tuple[bytes, ScenarioEntry]]:
        """Return the kept scenarios with their entries, in the order of the entries."""
        kept = {index: (data, entry) for _, index, entry, data in self.kept}
        return [kept[index] for index in self.entries if index in kept]

    def sentence(self) -> str:
        """Return a sentence on what is missing."""
        if self.summary is None:
            return f"request {self.request} was not closed: {self.came} scenarios are there, {self.missing} more have an entry"
        return f"request {self.request}: {self.came} of {self.summary.published} scenarios are there, {self.missing} are missing"


Match = tuple[
    TrackedRequest, ScenarioEntry, bytes
]  # a request, one of its entries, and what came with the scenario


class RequestTracker:
    """The requests of one namespace."""

    def __init__(self, most_unmatched: int = MOST_UNMATCHED) -> None:
        self.open: dict[str, TrackedRequest] = {}  # by request
        self._awaited: dict[str, list[str]] = {}  # SHA-256 -> requests
        self._unmatched: dict[
            str, list[bytes]
        ] = {}  # SHA-256 -> data of scenarios that came before their entry
        self._whole: dict[
            str, tuple[int | None, int]
        ] = {}  # request -> seed and number of scenarios
        self._most_unmatched = most_unmatched
        self._entries = 0  # of all open requests
        self._partial: dict[
            str, tuple[str, ...]
        ] = {}  # SHA-256 of a message -> those of all messages of its scenario, then that of the scenario

    def add_scenario(self, sha256: str, data: bytes = b"") -> Match | None:
        """Take a scenario and its data; return them with the entry, if that has come.

        A message of a scenario that has several is kept until the others and the entry are there.
        """
        if sha256 in self._partial:
            self._unmatched.setdefault(sha256, []).append(data)
            joined = self._join(self._partial[sha256])
            return None if joined is None else self.add_scenario(*joined)
        requests = self._awaited.get(sha256)
        if not requests:
            self._unmatched.setdefault(sha256, []).append(data)
            while len(self._unmatched) > self._most_unmatched:
                self._unmatched.pop(next(iter(self._unmatched)))
            return None
        tracked = self.open[requests[0]]
        self._await_no_more(sha256, tracked.request)
        tracked.came += 1
        return tracked, tracked.awaited.pop(sha256), data

    def add_message(self, data: bytes) -> None:
        """Take a message of `scenarios/info`; one that is damaged is passed over."""
        try:
            for info in decode_info(data):
                self.add_info(info)
        except InputError:
            return

    def add_info(self, info: Info) -> Match | None:
        """Take an entry or a summary; return an entry with its scenario, if that had come."""
        if isinstance(info, RequestSummary):
            self.open.setdefault(info.request, TrackedRequest(info.request)).summary = info
            return None
        entry, request, sha256 = info, info.request, info.sha256
        parts = self._parts_of(entry)
        if parts and (joined := self._join(parts)) is not None:
            self._unmatched.setdefault(sha256, []).append(joined[1])
        tracked = self.open.setdefault(request, TrackedRequest(request))
        if tracked.seed is None:
            tracked.seed = entry.seed
        if entry.seed != tracked.seed or tracked.entries.get(entry.index, sha256) != sha256:
            self.forget(request)  # by another sampler, which counts its requests from 1 again
            tracked = self.open[request] = TrackedRequest(request, entry.seed)
        repeated = entry.index in tracked.entries
        if not repeated:
            tracked.entries[entry.index] = sha256
            self._entries += 1
            while self._entries > MOST_ENTRIES and len(self.open) > 1:
                self.forget(next(iter(self.open)))
        data = self._take_unmatched(sha256)
        if repeated:
            return None
        if data is None and sha256 not in tracked.awaited:
            tracked.awaited[sha256] = replace(entry, status=NO_STATUS)
            self._awaited.setdefault(sha256, []).append(request)
            return None
        tracked.came += 1  # a second one of the same bytes counts with the first
        return tracked, entry, data or b""

    def _parts_of(self, entry: ScenarioEntry) -> tuple[str, ...]:
        """Remember the messages of an entry's scenario, if there are several, with the scenario's own SHA-256 at the end."""
        messages = entry.messages
        if len(messages) == 1:
            return ()
        parts = (*messages, entry.sha256)
        self._partial.update(dict.fromkeys(messages, parts))
        while len(self._partial) > self._most_unmatched:
            self._partial.pop(next(iter(self._partial)))
        return parts

    def _join(self, parts: tuple[str, ...]) -> tuple[str, bytes] | None:
        """Return SHA-256 and bytes of a scenario all of whose messages have come, and forget these."""
        *messages, sha256 = parts
        if not all(message in self._unmatched for message in messages):
            return None
        data = b"".join(self._take_unmatched(message) or b"" for message in messages)
        for message in messages:
            self._partial.pop(message, None)
        return sha256, data

    def _take_unmatched(self, sha256: str) -> bytes | None:
        waiting = self._unmatched.get(sha256)
        if not waiting:
            return None
        data = waiting.pop()
        if not waiting:
            del self._unmatched[sha256]
        return data

    def _await_no_more(self, sha256: str, request: str) -> None:
        waiting = self._awaited.get(sha256, [])
        if request in waiting:
            waiting.remove(request)
        if not waiting:
            self._awaited.pop(sha256, None)

    def forget(self, request: str) -> None:
        """Stop waiting for scenarios of a request."""
        tracked = self.open.pop(request, None)
        if tracked is not None:
            self._entries -= len(tracked.entries)
            for sha256 in tracked.awaited:
                self._await_no_more(sha256, request)

    def settle(self) -> None:
        """Forget the requests that are complete."""
        for request, tracked in list(self.open.items()):
            if tracked.summary is None:
                continue
            key = (tracked.seed, tracked.summary.published)
            if tracked.whole or self._whole.get(request) == key:
                self._whole[request] = key
                self.forget(request)
        while len(self._whole) > MOST_WHOLE:
            self._whole.pop(next(iter(self._whole)))

    def incomplete(self, *, closed: bool) -> Iterator[TrackedRequest]:
        """Yield the requests of which something is missing; with `closed`, only of those that are closed."""
        for tracked in self.open.values():
            if tracked.missing and (tracked.summary is not None or not closed):
                yield tracked
