# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Matches the scenarios of requests with their entries and summaries on `scenarios/info`.

Messages arrive in any order. A message that arrives twice (from a restarted sampler, or after a
reconnection) counts once.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
import heapq
from typing import Generic, TypeVar

from msg_conventions.scenario_info import decode_info, Info, RequestSummary, ScenarioEntry
from msg_conventions.scenarios import digest
from scenario_gen.base.errors import InputError

_MAX_ENTRY_COUNT = 300_000  # of open requests; the oldest requests are dropped
_MAX_COMPLETE_COUNT = 1000  # remembered complete requests
_Message = TypeVar("_Message")


class MessagePool(Generic[_Message]):
    """Messages by their SHA-256, each of which is taken once."""

    def __init__(self, max_count: int) -> None:
        """Hold the messages with the last `max_count` hashes."""
        self._messages: dict[str, list[_Message]] = {}
        self._max_count = max_count

    def add(self, sha256: str, message: _Message) -> None:
        """Add a message; beyond the bound, drop the oldest."""
        self._messages.setdefault(sha256, []).append(message)
        while len(self._messages) > self._max_count:
            self._messages.pop(next(iter(self._messages)))

    def pop_all(self, hashes: Sequence[str]) -> list[_Message]:
        """Remove and return a message for each hash; none if one is missing."""
        if not all(sha256 in self._messages for sha256 in hashes):
            return []
        return [self._pop_one(sha256) for sha256 in hashes]

    def _pop_one(self, sha256: str) -> _Message:
        messages = self._messages[sha256]
        if len(messages) == 1:
            del self._messages[sha256]
            return messages[0]
        return messages.pop()


@dataclass
class TrackedRequest:
    """One request: its entries and scenarios so far.

    Attributes:
        request: id.
        seed: None before the first entry.
        entries: SHA-256 of its scenarios by index, in the order of the entries.
        awaited: entries whose scenarios have not arrived, by index.
        arrived: number of scenarios.
        summary: None before it arrives.
        stored: scenarios for which `store` was called.
    """

    request: str
    seed: int | None = None
    entries: dict[int, str] = field(default_factory=dict)
    awaited: dict[int, ScenarioEntry] = field(default_factory=dict)
    arrived: int = 0
    summary: RequestSummary | None = None
    stored: list[tuple[str, int, ScenarioEntry, bytes]] = field(default_factory=list)

    @property
    def is_complete(self) -> bool:
        """Whether it is closed and no scenario is missing."""
        return self.summary is not None and not self.missing

    @property
    def missing(self) -> int:
        """Number of published scenarios that have not arrived."""
        published = self.summary.published if self.summary else len(self.entries)
        return max(0, published - self.arrived)

    def store(self, entry: ScenarioEntry, data: bytes, seed: int, most: int) -> None:
        """Store a scenario; of more than `most`, drop one by lot.

        The lot depends on the seed, not on the order of arrival.
        """
        lot = digest(f"{seed} {entry.sha256}".encode())
        heapq.heappush(self.stored, (lot, entry.index, entry, data))
        if len(self.stored) > most:
            heapq.heappop(self.stored)

    def in_order(self) -> list[tuple[bytes, ScenarioEntry]]:
        """Return the stored scenarios with their entries, in the order of the entries."""
        stored = {index: (data, entry) for _, index, entry, data in self.stored}
        return [stored[index] for index in self.entries if index in stored]

    def sentence(self) -> str:
        """Return a sentence on what is missing."""
        if self.summary is None:
            return (
                f"request {self.request} was not closed: {self.arrived} scenarios are there, "
                f"{self.missing} more have an entry"
            )
        return (
            f"request {self.request}: {self.arrived} of {self.summary.published} scenarios are "
            f"there, {self.missing} are missing"
        )


Match = tuple[TrackedRequest, ScenarioEntry, list[bytes]]
"""A request, one of its entries, and the messages of the scenario."""


class RequestTracker:
    """The requests of one namespace; `open` are those that are not complete, by id."""

    def __init__(self, max_unmatched: int = 10_000, *, with_witness: bool = False) -> None:
        """Hold the last messages without an entry.

        Args:
            max_unmatched: their number.
            with_witness: a scenario has arrived with the reference drive that its entry names,
                which `add_scenario` gets, too. Otherwise entries are `join_key`s.
        """
        self.open: dict[str, TrackedRequest] = {}
        self._with_witness = with_witness
        self._n_entries = 0  # of all open requests
        self._awaiting: dict[str, list[ScenarioEntry]] = {}  # by SHA-256 of a message
        self._unmatched = MessagePool[bytes](max_unmatched)
        self._complete: dict[str, tuple[int | None, int]] = {}  # seed and number of scenarios

    def add_scenario(self, sha256: str, data: bytes = b"") -> Match | None:
        """Add a message of a scenario; return the scenario if it is complete, with its entry."""
        self._unmatched.add(sha256, data)
        return next(filter(None, map(self._match, self._awaiting.get(sha256, ()))), None)

    def _match(self, entry: ScenarioEntry) -> Match | None:
        """Return an entry with the messages that it names, if all have arrived."""
        messages = self._unmatched.pop_all(self._named(entry))
        if not messages:
            return None
        tracked = self.open[entry.request]
        self._stop_awaiting(tracked, entry)
        tracked.arrived += 1
        return tracked, entry, messages

    def _named(self, entry: ScenarioEntry) -> tuple[str, ...]:
        """Return the hashes of an entry's messages."""
        has_witness = self._with_witness and entry.witness
        return (*entry.hashes, entry.witness) if has_witness else entry.hashes

    def add_message(self, data: bytes) -> None:
        """Add a message of `scenarios/info`; a damaged one is ignored."""
        try:
            self.add_info(decode_info(data))
        except InputError:
            return

    def add_info(self, info: Info) -> Match | None:
        """Add an entry or a summary; return an entry with its scenario, if that has arrived."""
        if isinstance(info, RequestSummary):
            self.open.setdefault(info.request, TrackedRequest(info.request)).summary = info
            return None
        tracked = self._request_of(info)
        if info.index in tracked.entries:
            self._unmatched.pop_all(self._named(info))
            return None
        tracked.entries[info.index] = info.sha256
        self._n_entries += 1
        while self._n_entries > _MAX_ENTRY_COUNT and len(self.open) > 1:
            self.forget(next(iter(self.open)))
        entry = info if self._with_witness else info.join_key()
        tracked.awaited[entry.index] = entry
        for sha256 in self._named(entry):
            self._awaiting.setdefault(sha256, []).append(entry)
        return self._match(entry)

    def _request_of(self, entry: ScenarioEntry) -> TrackedRequest:
        """Return the request of an entry; of another sampler, it replaces the earlier one."""
        request = entry.request
        tracked = self.open.setdefault(request, TrackedRequest(request, entry.seed))
        if tracked.seed is None:
            tracked.seed = entry.seed
        is_same_scenario = tracked.entries.get(entry.index, entry.sha256) == entry.sha256
        if entry.seed == tracked.seed and is_same_scenario:
            return tracked
        self.forget(request)  # a restarted sampler counts its requests from 1 again
        self.open[request] = TrackedRequest(request, entry.seed)
        return self.open[request]

    def _stop_awaiting(self, tracked: TrackedRequest, entry: ScenarioEntry) -> None:
        del tracked.awaited[entry.index]
        for sha256 in self._named(entry):
            waiting = self._awaiting[sha256]
            waiting.remove(entry)
            if not waiting:
                del self._awaiting[sha256]

    def forget(self, request: str) -> None:
        """Stop waiting for scenarios of a request."""
        tracked = self.open.pop(request, None)
        if tracked is not None:
            self._n_entries -= len(tracked.entries)
            for entry in list(tracked.awaited.values()):
                self._stop_awaiting(tracked, entry)

    def forget_complete(self) -> None:
        """Forget the complete requests."""
        for request, tracked in list(self.open.items()):
            if tracked.summary is None:
                continue
            key = (tracked.seed, tracked.summary.published)
            if tracked.is_complete or self._complete.get(request) == key:
                self._complete[request] = key
                self.forget(request)
        while len(self._complete) > _MAX_COMPLETE_COUNT:
            self._complete.pop(next(iter(self._complete)))

    def incomplete(self, *, closed: bool) -> Iterator[TrackedRequest]:
        """Yield the requests with missing scenarios; with `closed`, only closed ones."""
        for tracked in self.open.values():
            if tracked.missing and (tracked.summary is not None or not closed):
                yield tracked
