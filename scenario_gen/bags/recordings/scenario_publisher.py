# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Publishes the messages of a request while its scenarios are drawn; see `scenario_decoder`."""

from collections.abc import Callable, Iterable

from msg_conventions.ego import ego_messages
from msg_conventions.pictures import scenario_markers
from msg_conventions.request_messages import footprint_messages, RequestMessages
from msg_conventions.scenario_info import encode_info, INFO, RequestSummary
from scenario_gen.types import BoundaryStates, EgoSlot, Scenario, ScenarioSet

Send = Callable[[str, bytes], None]
"""Publishes CDR bytes on a topic."""


class ScenarioPublisher:
    """Publishes each scenario as it is drawn, so that the whole set is never in memory."""

    def __init__(self, messages: RequestMessages, frame_id: str, send: Send) -> None:
        """Use the encoder of the scenarios, the frame of the road, and the function that sends."""
        self._messages = messages
        self._frame_id = frame_id
        self._send = send
        self._stamp_ns = messages.encounter.start_ns
        self._has_begun = False

    def _begin(self, ego: EgoSlot | None) -> None:
        """Send the footprints and the ego's task, before the first scenario."""
        if self._has_begun:
            return
        self._has_begun = True
        self._send_all(footprint_messages(self._messages.encounter))
        if ego is not None:
            self._send_all(ego_messages(ego, self._frame_id, self._stamp_ns))

    def _send_all(self, messages: Iterable[tuple[str, bytes]]) -> None:
        for topic, data in messages:
            self._send(topic, data)

    def scenario(self, scenario: Scenario, requested: BoundaryStates, ego: EgoSlot | None) -> None:
        """Send a scenario and its entry."""
        self._begin(ego)
        self._send_all(self._messages.of_scenario(scenario, requested, ego))

    def close(self, result: ScenarioSet, summary: RequestSummary) -> None:
        """Send the markers of the first scenario and the summary of the request."""
        self._begin(result.ego)
        if result.scenarios:
            self._send("markers", scenario_markers(result.scenarios[0], self._stamp_ns))
        self._send(INFO, encode_info(summary))
