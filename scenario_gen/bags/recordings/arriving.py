# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Scenarios as they arrive live, in any order of their messages, their entries and the witnesses of their egos."""

from typing import TypeVar

from msg_conventions.ego import WITNESS
from msg_conventions.scenario_info import decode_info, INFO, ScenarioEntry
from msg_conventions.scenarios import digest
from scenario_gen.bags.recordings.requests import Match, RequestTracker
from scenario_gen.bags.recordings.scenarios import decode_with_witness, SCENARIOS
from scenario_gen.types import Scenario

TOPICS = (SCENARIOS, INFO, WITNESS)
MAX_REMEMBERED = 10_000  # witnesses, and scenarios without theirs, that are remembered; beyond, the oldest are forgotten
Kept = TypeVar("Kept")
Arrived = tuple[
    ScenarioEntry, int, Scenario
]  # its entry, the template's stamp [ns], and the scenario with its witness


class ArrivingScenarios:
    """Joins the messages that belong to one scenario."""

    def __init__(self) -> None:
        self._tracker = RequestTracker(MAX_REMEMBERED)
        self._entries: dict[
            str, ScenarioEntry
        ] = {}  # by SHA-256; complete, while the tracker keeps no texts
        self._witnesses: dict[str, bytes] = {}  # by SHA-256
        self._waiting: dict[
            str, tuple[ScenarioEntry, bytes]
        ] = {}  # by SHA-256 of the witness that has not come
        self.unmatched = (
            0  # messages of scenarios that came, and of which no scenario was completed
        )

    def take(self, topic: str, data: bytes) -> list[Arrived]:
        """Take a message; return the scenarios that it completes.

        Args:
            topic: one of `TOPICS`.
            data: its CDR bytes.

        Raises:
            InputError: it is damaged, or a scenario is.
        """
        if topic == WITNESS:
            sha256 = digest(data)
            _remember(self._witnesses, sha256, data)
            waiting = self._waiting.pop(sha256, None)
            return [] if waiting is None else self._complete(*waiting)
        if topic == SCENARIOS:
            self.unmatched += 1
            return self._matched([self._tracker.add_scenario(digest(data), data)])
        infos = decode_info(data)
        for info in infos:
            if isinstance(info, ScenarioEntry):
                _remember(self._entries, info.sha256, info)
        found = self._matched([self._tracker.add_info(info) for info in infos])
        self._tracker.settle()
        return found

    def _matched(self, matches: list[Match | None]) -> list[Arrived]:
        complete = [(match[1], match[2]) for match in matches if match is not None]
        return [
            arrived
            for entry, data in complete
            for arrived in self._with_witness(self._entries.pop(entry.sha256, entry), data)
        ]

    def _with_witness(self, entry: ScenarioEntry, data: bytes) -> list[Arrived]:
        if entry.witness and entry.witness not in self._witnesses:
            _remember(self._waiting, entry.witness, (entry, data))
            return []
        return self._complete(entry, data)

    def _complete(self, entry: ScenarioEntry, data: bytes) -> list[Arrived]:
        self.unmatched -= len(entry.messages)
        return [
            (
                entry,
                *decode_with_witness(
                    data, entry, 0, self._witnesses.pop(entry.witness, None), SCENARIOS, WITNESS
                ),
            )
        ]


def _remember(kept: dict[str, Kept], key: str, value: Kept) -> None:
    kept[key] = value
    while len(kept) > MAX_REMEMBERED:
        kept.pop(next(iter(kept)))
