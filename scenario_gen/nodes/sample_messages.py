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

"""What gp_sampler publishes of a request: footprints, the ego's slot, every scenario with its account, and the account of all."""

from collections.abc import Callable, Mapping

from msg_conventions.diagnostics import asked_values, encode_diagnostics, scenario_status, Status
from msg_conventions.ego import ego_messages, ego_values
from msg_conventions.names import tokens
from msg_conventions.pictures import encode_footprint, scenario_markers
from msg_conventions.scenarios import encode_scenario
from msg_conventions.topics import vehicle_topic
from scenario_gen.encounter import Encounter
from scenario_gen.scenario import BoundaryStates, Scenario, ScenarioSet

Send = Callable[[str, bytes], None]  # of topic and CDR bytes


class SampleMessages:
    """Sends a request's messages in order, each scenario as it comes, so that a set need never be in memory."""

    def __init__(self, encounter: Encounter, request: str, node: str, of_all: Mapping[str, str], send: Send) -> None:
        """Take the template, the request's id, the node's full name, what every account says, and what sends a message."""
        self._encounter, self._request, self._node, self._of_all, self._send = encounter, request, node, of_all, send
        self._begun = False

    def _begin(self, ego: Scenario | None) -> None:
        """Send what stands before the first scenario, once."""
        if self._begun:
            return
        self._begun = True
        stamp, vehicles = self._encounter.start_ns, self._encounter.vehicles
        for vehicle, name in zip(vehicles, tokens(vehicle.id for vehicle in vehicles), strict=True):
            self._send(vehicle_topic(name, "footprint"), encode_footprint(vehicle, stamp, f"vehicle_{name}"))
        for topic, data in () if ego is None else ego_messages(ego, stamp):
            self._send(topic, data)

    def scenario(self, scenario: Scenario, asked: BoundaryStates, ego: Scenario | None) -> None:
        """Send a scenario and its account."""
        self._begin(ego)
        stamp = self._encounter.start_ns
        data = encode_scenario(scenario, stamp)
        self._send("scenarios", data)
        more = {**self._of_all} | ego_values(ego) | asked_values(asked, self._encounter.vehicles, scenario)
        status = scenario_status(scenario, data, self._request, self._node, **more)
        self._send("scenarios/info", encode_diagnostics([status], stamp))

    def close(self, result: ScenarioSet, closing: Status) -> None:
        """Send the picture of the first scenario and the request's account."""
        self._begin(result.ego)
        stamp = self._encounter.start_ns
        if result.scenarios:
            self._send("markers", scenario_markers(result.scenarios[0], stamp))
        self._send("scenarios/info", encode_diagnostics([closing], stamp))
