# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The origins of scenarios: their encounters, and which scenarios are copies of others."""

from collections.abc import Sequence
from dataclasses import dataclass
import hashlib

import numpy as np

from scenario_gen.closed_loop.coordination_space import ego_index
from scenario_gen.numerics import ahead_and_left, Floats, Ints
from scenario_gen.types import Road, Scenario

COPY_TOLERANCE_M = 0.1  # greatest difference of any vehicle's position in two copies
COMPARED_COUNT = 9  # instants at which positions are compared


@dataclass(frozen=True)
class Origin:
    """The origin of a scenario.

    Attributes:
        encounter: name of the recorded encounter; "" if it is not known.
        digest: SHA-256 of its motion and of the ego's index; "" if not computed.
        copy_of: name of an earlier scenario from the same encounter with the same motion; ""
            without one.
    """

    encounter: str = ""
    digest: str = ""
    copy_of: str = ""


@dataclass(frozen=True, eq=False)
class Trial:
    """One scenario to be driven.

    Attributes:
        name: display name.
        scenario: the scenario, which includes the ego's witness.
        ego: index or id of the witness.
        road: its road, if known.
        encounter: name of the recorded encounter; "" if it is not known.
        request: the request that a live scenario belongs to.
    """

    name: str
    scenario: Scenario
    ego: int | str
    road: Road | None
    encounter: str = ""
    request: str = ""


def origins_of(trials: Sequence[Trial]) -> list[Origin]:
    """Return the origins of the scenarios of trials; copies have the name of the first one."""
    known: dict[tuple[str, int, int], list[tuple[str, Floats]]] = {}
    result = []
    for trial in trials:
        number = ego_index(trial.scenario, trial.ego)
        shape = _shape(trial.scenario, number)
        group = known.setdefault((trial.encounter, len(trial.scenario.vehicles), number), [])
        copies = (name for name, other in group if np.abs(other - shape).max() <= COPY_TOLERANCE_M)
        original = next(copies, "")
        if not original:
            group.append((trial.name, shape))
        result.append(Origin(trial.encounter, digest_of(trial.scenario, number), original))
    return result


def _shape(scenario: Scenario, ego: int) -> Floats:
    """Return the positions at some instants, in the frame of the ego's start, and the times [s].

    They are the same on every road on which the same scenario is placed.
    """
    when = np.linspace(0.0, float(scenario.time[-1]), COMPARED_COUNT)
    offset = scenario.at(when).position - scenario.position[ego, 0]
    ahead, left = ahead_and_left(offset, float(scenario.heading[ego, 0]))
    return np.concatenate([ahead.ravel(), left.ravel(), when])


def digest_of(scenario: Scenario, ego: int) -> str:
    """Return the SHA-256 of a scenario's vehicles, its motion, and the ego's index."""
    vehicles = [(vehicle.id, vehicle.length, vehicle.width) for vehicle in scenario.vehicles]
    digest = hashlib.sha256(repr((ego, vehicles)).encode())
    for name in ("time", "position", "heading", "speed", "present"):
        digest.update(np.ascontiguousarray(getattr(scenario, name)).tobytes())
    return digest.hexdigest()


def units_of(names: Sequence[str], origins: Sequence[Origin]) -> tuple[Ints, int]:
    """Return the sampling unit (S,) of each drive, and the number of encounters.

    The unit is the encounter. If there is only one, each scenario with its copies is a unit.
    """
    encounters, unit = np.unique([origin.encounter for origin in origins], return_inverse=True)
    if len(encounters) == 1:
        numbers = {name: k for k, name in enumerate(names)}
        unit = np.array([numbers.get(origin.copy_of, k) for k, origin in enumerate(origins)])
    return unit, len(encounters)
