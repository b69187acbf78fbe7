# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Decodes scenarios from live messages in any order: scenarios, entries, witnesses."""

from collections.abc import Callable
from typing import TypeVar

from msg_conventions.ego import WITNESS
from msg_conventions.scenario_info import decode_info, INFO, Info, ScenarioEntry
from msg_conventions.scenarios import digest
from scenario_gen.bags.recordings.request_tracker import Match, RequestTracker
from scenario_gen.bags.recordings.scenarios import decode_with_witness, SCENARIOS
from scenario_gen.types import Scenario

TOPICS = (SCENARIOS, INFO, WITNESS)

_MAX_STORED_COUNT = 10_000  # witnesses, and scenarios without theirs; the oldest are dropped
_T = TypeVar("_T")

Decoded = tuple[ScenarioEntry, int, Scenario]
"""The entry, the template's stamp [ns], and the scenario with its witness."""


class ScenarioDecoder:
    """Joins the messages of each scenario.

    Attributes:
        unmatched: number of messages on `scenarios` that did not complete a scenario yet.
    """

    def __init__(self, accepts: Callable[[Info], bool] = lambda _: True) -> None:
        """Ignore the messages on `scenarios/info` for which `accepts` returns False."""
        self.unmatched = 0
        self._accepts = accepts
        self._tracker = RequestTracker(_MAX_STORED_COUNT)
        self._entries: dict[str, ScenarioEntry] = {}  # by SHA-256; the tracker omits their texts
        self._witnesses: dict[str, bytes] = {}  # by SHA-256
        self._awaiting_witness: dict[str, tuple[ScenarioEntry, bytes]] = {}  # by its SHA-256

    def add(self, topic: str, data: bytes) -> list[Decoded]:
        """Add a message; return the scenarios that it completes.

        Args:
            topic: one of `TOPICS`.
            data: CDR bytes.

        Raises:
            InputError: the message, or a scenario, is damaged.
        """
        if topic == WITNESS:
            sha256 = digest(data)
            _store(self._witnesses, sha256, data)
            awaiting = self._awaiting_witness.pop(sha256, None)
            return [] if awaiting is None else [self._decode(*awaiting)]
        if topic == SCENARIOS:
            self.unmatched += 1
            return self._decode_matches([self._tracker.add_scenario(digest(data), data)])
        infos = [info for info in decode_info(data) if self._accepts(info)]
        for info in infos:
            if isinstance(info, ScenarioEntry):
                _store(self._entries, info.sha256, info)
        decoded = self._decode_matches([self._tracker.add_info(info) for info in infos])
        self._tracker.forget_complete()
        return decoded

    def _decode_matches(self, matches: list[Match | None]) -> list[Decoded]:
        """Return the scenarios whose witnesses are known; the others wait for them."""
        decoded = []
        for match in matches:
            if match is None:
                continue
            _, tracked_entry, data = match
            entry = self._entries.pop(tracked_entry.sha256, tracked_entry)
            if entry.witness and entry.witness not in self._witnesses:
                _store(self._awaiting_witness, entry.witness, (entry, data))
            else:
                decoded.append(self._decode(entry, data))
        return decoded

    def _decode(self, entry: ScenarioEntry, data: bytes) -> Decoded:
        self.unmatched -= len(entry.messages)
        witness = self._witnesses.pop(entry.witness, None)
        stamp_ns, scenario = decode_with_witness(data, entry, 0, witness, SCENARIOS, WITNESS)
        return entry, stamp_ns, scenario


def _store(stored: dict[str, _T], key: str, value: _T) -> None:
    """Store a value; beyond the bound, drop the oldest."""
    stored[key] = value
    while len(stored) > _MAX_STORED_COUNT:
        stored.pop(next(iter(stored)))
