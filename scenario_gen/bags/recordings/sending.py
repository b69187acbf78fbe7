# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The messages of a request sent while its scenarios are drawn; `arriving` takes them in."""

from collections.abc import Callable, Iterable
from itertools import chain

from msg_conventions.ego import ego_messages
from msg_conventions.pictures import scenario_markers
from msg_conventions.request_messages import footprint_messages, RequestMessages
from msg_conventions.scenario_info import encode_info, INFO, RequestSummary
from scenario_gen.types import BoundaryStates, EgoSlot, Scenario, ScenarioSet

Send = Callable[[str, bytes], None]  # of topic and CDR bytes


class RequestSender:
    """Sends a request's messages in order, each scenario as it is drawn, so that the whole set is never in memory."""

    def __init__(self, messages: RequestMessages, frame_id: str, send: Send) -> None:
        """Take the encoder of the scenarios, the road's frame, and the function that sends CDR bytes on a topic."""
        self._messages, self._frame_id, self._send = messages, frame_id, send
        self._stamp = messages.encounter.start_ns
        self._begun = False

    def _begin(self, ego: EgoSlot | None) -> None:
        """Send the footprints and the ego's task, before the first scenario."""
        if not self._begun:
            self._begun = True
            task = () if ego is None else ego_messages(ego, self._frame_id, self._stamp)
            self._send_all(chain(footprint_messages(self._messages.encounter), task))

    def _send_all(self, messages: Iterable[tuple[str, bytes]]) -> None:
        for topic, data in messages:
            self._send(topic, data)

    def scenario(self, scenario: Scenario, requested: BoundaryStates, ego: EgoSlot | None) -> None:
        """Send a scenario and its entry."""
        self._begin(ego)
        self._send_all(self._messages.of_scenario(scenario, requested, ego))

    def close(self, result: ScenarioSet, summary: RequestSummary) -> None:
        """Send the picture of the first scenario and the request's summary."""
        self._begin(result.ego)
        if result.scenarios:
            self._send("markers", scenario_markers(result.scenarios[0], self._stamp))
        self._send(INFO, encode_info(summary, self._stamp))
