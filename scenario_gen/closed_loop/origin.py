# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Where the scenarios of a set come from: their encounters, and which are copies of others."""

from collections.abc import Sequence
from dataclasses import dataclass
import hashlib

import numpy as np

from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.plane import ahead_and_left
from scenario_gen.types import Road, Scenario

ALIKE = 0.1  # metres within which all vehicles of two scenarios of one encounter are at the same places, if they are copies
INSTANTS = 9  # at which that is looked at


@dataclass(frozen=True)
class Origin:
    """Where a scenario comes from.

    Attributes:
        encounter: the recorded one that it was made of, "" if that is not known.
        digest: SHA-256 of its motion and of who is the ego, "" if nobody looked.
        copy_of: name of an earlier scenario of the same encounter in which all move likewise; ""
            if there is none.
    """

    encounter: str = ""
    digest: str = ""
    copy_of: str = ""


@dataclass(frozen=True, eq=False)
class Trial:
    """One scenario to be driven.

    Attributes:
        name: for people.
        scenario: the witness of the ego is in it.
        ego: index or id of the witness.
        road: if it is known.
        encounter: names the recorded encounter that it was made of; "" if that is not known.
    """

    name: str
    scenario: Scenario
    ego: int | str
    road: Road | None
    encounter: str = ""


def origins_of(trials: Sequence[Trial]) -> list[Origin]:
    """Return where the scenarios of trials come from; each copy is named after the first of its kind."""
    known: dict[tuple[str, int, int], list[tuple[str, Floats]]] = {}
    result = []
    for trial in trials:
        ids = [vehicle.id for vehicle in trial.scenario.vehicles]
        number = ids.index(trial.ego) if isinstance(trial.ego, str) else trial.ego
        shape = _shape(trial.scenario, number)
        group = known.setdefault((trial.encounter, len(ids), number), [])
        same = next((one for one, other in group if np.abs(other - shape).max() <= ALIKE), "")
        if not same:
            group.append((trial.name, shape))
        result.append(Origin(trial.encounter, digest_of(trial.scenario, number), same))
    return result


def _shape(scenario: Scenario, ego: int) -> Floats:
    """Return where all are, seen from the ego's start, at some instants, and when that is [s]: two roads give one shape."""
    when = np.linspace(0.0, float(scenario.time[-1]), INSTANTS)
    offset = scenario.at(when).position - scenario.position[ego, 0]
    ahead, left = ahead_and_left(offset, float(scenario.heading[ego, 0]))
    return np.concatenate([ahead.ravel(), left.ravel(), when])


def digest_of(scenario: Scenario, ego: int) -> str:
    """Return the SHA-256 of a scenario's vehicles and motion, and of who is the ego."""
    found = hashlib.sha256(
        repr((ego, [(v.id, v.length, v.width) for v in scenario.vehicles])).encode()
    )
    for part in (
        scenario.time,
        scenario.position,
        scenario.heading,
        scenario.speed,
        scenario.present,
    ):
        found.update(np.ascontiguousarray(part).tobytes())
    return found.hexdigest()


def units_of(names: Sequence[str], several: Sequence[Origin]) -> tuple[Ints, int]:
    """Return the number (S,) of what each drive counts with, and of how many encounters they are.

    That is its encounter; where all are of one encounter, those that are no copies of another
    count by themselves.
    """
    encounters, unit = np.unique([one.encounter for one in several], return_inverse=True)
    if len(encounters) > 1:
        return unit, len(encounters)
    place = {name: k for k, name in enumerate(names)}
    return np.array(
        [place.get(one.copy_of, k) for k, one in enumerate(several)], dtype=np.int64
    ), len(encounters)
