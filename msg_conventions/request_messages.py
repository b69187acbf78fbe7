# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The messages of one request for scenarios, in the order of their publication."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from msg_conventions.ego import WITNESS
from msg_conventions.pictures import encode_footprint
from msg_conventions.scenario_info import encode_info, INFO, scenario_entry
from msg_conventions.scenarios import encode_scenario, messages_of
from msg_conventions.topics import vehicle_topic
from scenario_gen.types import BoundaryStates, EgoSlot, Encounter, Scenario, tokens

SCENARIOS = "scenarios"


def footprint_messages(encounter: Encounter) -> Iterator[tuple[str, bytes]]:
    """Yield topic and CDR bytes of the footprint of each vehicle of a template."""
    for vehicle, name in zip(encounter.vehicles, tokens(encounter.ids), strict=True):
        yield (
            vehicle_topic(name, "footprint"),
            encode_footprint(vehicle, encounter.start_ns, f"vehicle_{name}"),
        )


@dataclass(frozen=True, eq=False)
class RequestMessages:
    """Encodes the scenarios of one request.

    Attributes:
        encounter: the template.
        request: the request's id.
        inputs: hashes of `tracks` and `map`.
        names: of the template and the road.
    """

    encounter: Encounter
    request: str
    inputs: Mapping[str, str] = field(default_factory=dict)
    names: tuple[str, str] = ("", "")

    def of_scenario(
        self, scenario: Scenario, requested: BoundaryStates, ego: EgoSlot | None
    ) -> Iterator[tuple[str, bytes]]:
        """Yield topic and CDR bytes of a scenario's messages: its witness, its paths, its entry.

        Args:
            scenario: the scenario.
            requested: start and end states of the vehicles.
            ego: the vehicle that was left out.
        """
        stamp = self.encounter.start_ns
        data = encode_scenario(scenario, stamp)
        if scenario.reference_drive is not None:
            yield WITNESS, encode_scenario(scenario.reference_drive, stamp)
        for message in (data,) if scenario.all_present else messages_of(data):
            yield SCENARIOS, message
        entry = scenario_entry(
            scenario,
            data,
            self.request,
            template=self.encounter.vehicles,
            asked=requested,
            ego=ego,
            inputs=self.inputs,
            names=self.names,
        )
        yield INFO, encode_info(entry)
