# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Matches the scenarios of requests with their entries and summaries on `scenarios/info`.

Messages arrive in any order. A message that arrives twice (from a restarted sampler, or after a
reconnection) counts once.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
import heapq

from msg_conventions.diagnostics import Level, Status
from msg_conventions.scenario_info import decode_info, Info, RequestSummary, ScenarioEntry
from msg_conventions.scenarios import digest
from scenario_gen.base.errors import InputError

_MAX_ENTRY_COUNT = 300_000  # of open requests; the oldest requests are dropped
_MAX_COMPLETE_COUNT = 1000  # remembered complete requests
_NO_STATUS = Status("", Level.OK, "")  # entries wait without their long texts


@dataclass
class TrackedRequest:
    """One request: its entries and scenarios so far.

    Attributes:
        request: id.
        seed: None before the first entry.
        entries: SHA-256 of its scenarios by index, in the order of the entries.
        awaited: entries whose scenarios have not arrived, by SHA-256.
        arrived: number of scenarios.
        summary: None before it arrives.
        stored: scenarios for which `store` was called.
    """

    request: str
    seed: int | None = None
    entries: dict[int, str] = field(default_factory=dict)
    awaited: dict[str, ScenarioEntry] = field(default_factory=dict)
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


Match = tuple[TrackedRequest, ScenarioEntry, bytes]
"""A request, one of its entries, and the data of the scenario."""


class RequestTracker:
    """The requests of one namespace; `open` are those that are not complete, by id."""

    def __init__(self, max_unmatched: int = 10_000) -> None:
        self.open: dict[str, TrackedRequest] = {}
        self._max_unmatched = max_unmatched
        self._n_entries = 0  # of all open requests
        self._awaited: dict[str, list[str]] = {}  # requests by SHA-256 of a scenario
        self._unmatched: dict[str, list[bytes]] = {}  # data by SHA-256, before the entry
        self._complete: dict[str, tuple[int | None, int]] = {}  # seed and number of scenarios
        # By SHA-256 of a message: those of all messages of its scenario, then the scenario's.
        self._parts: dict[str, tuple[str, ...]] = {}

    def add_scenario(self, sha256: str, data: bytes = b"") -> Match | None:
        """Add a scenario; return it with its entry, if that has arrived.

        A message of a scenario with several messages waits for the others and the entry.
        """
        if sha256 in self._parts:
            self._unmatched.setdefault(sha256, []).append(data)
            joined = self._join(self._parts[sha256])
            return None if joined is None else self.add_scenario(*joined)
        requests = self._awaited.get(sha256)
        if not requests:
            self._unmatched.setdefault(sha256, []).append(data)
            while len(self._unmatched) > self._max_unmatched:
                self._unmatched.pop(next(iter(self._unmatched)))
            return None
        tracked = self.open[requests[0]]
        self._stop_awaiting(sha256, tracked.request)
        tracked.arrived += 1
        return tracked, tracked.awaited.pop(sha256), data

    def add_message(self, data: bytes) -> None:
        """Add a message of `scenarios/info`; a damaged one is ignored."""
        try:
            for info in decode_info(data):
                self.add_info(info)
        except InputError:
            return

    def add_info(self, info: Info) -> Match | None:
        """Add an entry or a summary; return an entry with its scenario, if that has arrived."""
        if isinstance(info, RequestSummary):
            self.open.setdefault(info.request, TrackedRequest(info.request)).summary = info
            return None
        self._join_parts(info)
        tracked = self._request_of(info)
        is_repeated = info.index in tracked.entries
        if not is_repeated:
            tracked.entries[info.index] = info.sha256
            self._n_entries += 1
            while self._n_entries > _MAX_ENTRY_COUNT and len(self.open) > 1:
                self.forget(next(iter(self.open)))
        data = self._pop_unmatched(info.sha256)
        if is_repeated:
            return None
        if data is None and info.sha256 not in tracked.awaited:
            tracked.awaited[info.sha256] = replace(info, status=_NO_STATUS)
            self._awaited.setdefault(info.sha256, []).append(info.request)
            return None
        tracked.arrived += 1  # a second scenario with the same bytes counts with the first
        return tracked, info, data or b""

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

    def _join_parts(self, entry: ScenarioEntry) -> None:
        """Remember the messages of an entry's scenario, if there are several; join them."""
        if len(entry.messages) == 1:
            return
        parts = (*entry.messages, entry.sha256)
        self._parts.update(dict.fromkeys(entry.messages, parts))
        while len(self._parts) > self._max_unmatched:
            self._parts.pop(next(iter(self._parts)))
        joined = self._join(parts)
        if joined is not None:
            self._unmatched.setdefault(entry.sha256, []).append(joined[1])

    def _join(self, parts: tuple[str, ...]) -> tuple[str, bytes] | None:
        """Return SHA-256 and bytes of a scenario with all its messages; forget these."""
        *messages, sha256 = parts
        if not all(message in self._unmatched for message in messages):
            return None
        data = b"".join(self._pop_unmatched(message) or b"" for message in messages)
        for message in messages:
            self._parts.pop(message, None)
        return sha256, data

    def _pop_unmatched(self, sha256: str) -> bytes | None:
        """Remove and return the data of a scenario without entry; None if there is none."""
        waiting = self._unmatched.get(sha256)
        if not waiting:
            return None
        data = waiting.pop()
        if not waiting:
            del self._unmatched[sha256]
        return data

    def _stop_awaiting(self, sha256: str, request: str) -> None:
        waiting = self._awaited.get(sha256, [])
        if request in waiting:
            waiting.remove(request)
        if not waiting:
            self._awaited.pop(sha256, None)

    def forget(self, request: str) -> None:
        """Stop waiting for scenarios of a request."""
        tracked = self.open.pop(request, None)
        if tracked is not None:
            self._n_entries -= len(tracked.entries)
            for sha256 in tracked.awaited:
                self._stop_awaiting(sha256, request)

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
