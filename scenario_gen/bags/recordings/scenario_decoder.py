# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Decodes scenarios from live messages in any order: scenarios, entries, witnesses."""

from collections.abc import Callable

from msg_conventions.ego import WITNESS
from msg_conventions.scenario_info import decode_info, INFO, Info, ScenarioEntry
from msg_conventions.scenarios import digest
from scenario_gen.bags.recordings.request_tracker import RequestTracker
from scenario_gen.bags.recordings.scenarios import decode_with_witness, SCENARIOS
from scenario_gen.types import Scenario

TOPICS = (SCENARIOS, INFO, WITNESS)

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
        self._tracker = RequestTracker(with_witness=True)

    def add(self, topic: str, data: bytes) -> Decoded | None:
        """Add a message; return the scenario that it completes, if it does.

        Args:
            topic: one of `TOPICS`.
            data: CDR bytes.

        Raises:
            InputError: the message, or a scenario, is damaged.
        """
        if topic == INFO:
            info = decode_info(data)
            match = self._tracker.add_info(info) if self._accepts(info) else None
        else:
            self.unmatched += topic == SCENARIOS
            match = self._tracker.add_scenario(digest(data), data)
        self._tracker.forget_complete()
        return self._decode(match[1], match[2]) if match else None

    def _decode(self, entry: ScenarioEntry, messages: list[bytes]) -> Decoded:
        count = len(entry.hashes)
        self.unmatched -= count
        data = b"".join(messages[:count])
        witness = messages[count] if entry.witness else None
        stamp_ns, scenario = decode_with_witness(data, entry, 0, witness, SCENARIOS, WITNESS)
        return entry, stamp_ns, scenario
