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

from collections.abc import Iterator

from msg_conventions.belonging import MAP_HASH, TEMPLATE_HASH
from msg_conventions.diagnostics import asked_values, encode_diagnostics, scenario_status, Status
from msg_conventions.ego import ego_messages, ego_values
from msg_conventions.names import tokens
from msg_conventions.pictures import encode_footprint, scenario_markers
from msg_conventions.scenarios import encode_scenario
from msg_conventions.topics import vehicle_topic
from scenario_gen.encounter import Encounter
from scenario_gen.scenario import BoundaryStates, ScenarioSet


def sample_messages(
    encounter: Encounter, asked: BoundaryStates, result: ScenarioSet, closing: Status, node: str
) -> Iterator[tuple[str, bytes]]:
    """Yield topic and CDR bytes of every message, in order; `closing` is the request's account, `node` the full name."""
    stamp, vehicles = encounter.start_ns, encounter.vehicles
    for vehicle, name in zip(vehicles, tokens(vehicle.id for vehicle in vehicles), strict=True):
        yield vehicle_topic(name, "footprint"), encode_footprint(vehicle, stamp, f"vehicle_{name}")
    if result.ego is not None:
        yield from ego_messages(result.ego, stamp)
    of_all = {key: closing.values[key] for key in (TEMPLATE_HASH, MAP_HASH)} | ego_values(result.ego)
    for scenario in result.scenarios:
        data = encode_scenario(scenario, stamp)
        yield "scenarios", data
        more = of_all | asked_values(asked, vehicles, scenario)
        status = scenario_status(scenario, data, closing.values["request"], node, **more)
        yield "scenarios/info", encode_diagnostics([status], stamp)
    if result.scenarios:
        yield "markers", scenario_markers(result.scenarios[0], stamp)
    yield "scenarios/info", encode_diagnostics([closing], stamp)
