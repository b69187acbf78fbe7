# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Facts about a scenario: how near its vehicles come, who yields to whom, how it was drawn."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from scenario_gen.types.decision import Decision
from scenario_gen.types.traffic_light import TrafficLight

FOLLOW, YIELD = "follow", "yield"


@dataclass(frozen=True)
class NamedReaction:
    """Vehicle `who` follows vehicle `whom`, or yields to it; both are ROS names of vehicle ids."""

    kind: str
    who: str
    whom: str

    def __str__(self) -> str:
        return f"{self.who} {'follows' if self.kind == FOLLOW else 'yields to'} {self.whom}"


class OrderChange(StrEnum):
    """How the passing order at a conflict differs from the recording."""

    NONE = "as in the recording"
    SWAPPED = "swapped"
    NO_CONFLICT = "no conflict"


@dataclass(frozen=True)
class PassingOrder:
    """Who passes a conflict first and second in the recording, and the change; ROS names."""

    first: str
    second: str
    change: OrderChange

    def __str__(self) -> str:
        if self.change is OrderChange.SWAPPED:
            return f"{self.second} before {self.first}, {self.change}"
        return f"{self.first} before {self.second}, {self.change}"


@dataclass(frozen=True)
class Failure:
    """How a planner under test failed in a scenario that a search found.

    Attributes:
        kind: of the failure.
        deviation: distance of the scenario from the most likely one, in standard deviations.
        weight: importance weight against natural scenarios; None if the search has none.
    """

    kind: str
    deviation: float
    weight: float | None = None


@dataclass(frozen=True)
class Facts:
    """What is known about a scenario besides its motion. None: not known.

    Attributes:
        closest_approach_m: smallest gap between two footprints.
        pet_s: post-encroachment time of the most critical pair that crosses or merges.
        rarity: how unusual the scenario is among recorded encounters; usual up to 1.
        weight: importance weight against natural scenarios; None if it was drawn as these are.
        targets: value of each target figure, in the figure's unit.
        order: the passing order that was requested.
        passing_order: who goes first at each conflict, unless the recorded order was requested.
        reactions: those that the scenario keeps.
        lost_reactions: pairs (who, whom) to whose reaction the scenario is not held.
        failure: of a planner under test, in scenarios that a search found.
        decision: the outcome that the scenario has, if decisions were drawn.
        lights: traffic lights whose states are known, in the scenario's frame and on its clock.
    """

    closest_approach_m: float | None = None
    pet_s: float | None = None
    rarity: float | None = None
    weight: float | None = None
    targets: Mapping[str, float] = field(default_factory=dict)
    order: str = "keep"
    passing_order: tuple[PassingOrder, ...] = ()
    reactions: tuple[NamedReaction, ...] = ()
    lost_reactions: tuple[tuple[str, str], ...] = ()
    failure: Failure | None = None
    decision: Decision | None = None
    lights: tuple[TrafficLight, ...] = ()
