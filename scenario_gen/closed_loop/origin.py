# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Where the scenarios of a set come from: their encounters, and which are copies of others."""

from collections.abc import Sequence
from dataclasses import dataclass
import hashlib

import numpy as np

from scenario_gen.numerics import Floats, Ints
from scenario_gen.types import Scenario

ALIKE = 0.1  # metres within which all vehicles of two scenarios of one encounter are at the same places, if they are copies
INSTANTS = 9  # at which that is looked at


@dataclass(frozen=True)
class Origin:
    """Where a scenario comes from.

    Attributes:
        encounter: the recorded one that it was made of, "" if that is not known.
        digest: SHA-256 of its motion and of who is the ego, "" if nobody looked.
        copy_of: name of an earlier scenario of the same encounter in which all move likewise; "" if there is none.
    """

    encounter: str = ""
    digest: str = ""
    copy_of: str = ""


def origins(
    names: Sequence[str], scenarios: Sequence[Scenario], egos: Sequence[int | str], encounters: Sequence[str]
) -> list[Origin]:
    """Return the origins of scenarios; each copy is named after the first of its kind."""
    known: dict[tuple[str, int, int], list[tuple[str, Floats]]] = {}
    result = []
    for name, scenario, ego, encounter in zip(names, scenarios, egos, encounters, strict=True):
        number = ego if isinstance(ego, int) else [vehicle.id for vehicle in scenario.vehicles].index(ego)
        shape = _shape(scenario, number)
        group = known.setdefault((encounter, len(scenario.vehicles), number), [])
        same = next((one for one, other in group if np.abs(other - shape).max() <= ALIKE), "")
        if not same:
            group.append((name, shape))
        result.append(Origin(encounter, digest_of(scenario, number), same))
    return result


def _shape(scenario: Scenario, ego: int) -> Floats:
    """Return where all are, seen from the ego's start, at some instants, and when that is [s]: two roads give one shape."""
    when = np.linspace(0.0, float(scenario.time[-1]), INSTANTS)
    start, yaw = scenario.position[ego, 0], float(scenario.heading[ego, 0])
    c, s = float(np.cos(yaw)), float(np.sin(yaw))
    away = np.stack(
        [[np.interp(when, scenario.time, each[:, axis] - start[axis]) for axis in range(2)] for each in scenario.position]
    )
    x, y = away[:, 0] * c + away[:, 1] * s, away[:, 1] * c - away[:, 0] * s
    return np.concatenate([x.ravel(), y.ravel(), when])


def digest_of(scenario: Scenario, ego: int) -> str:
    """Return the SHA-256 of a scenario's vehicles and motion, and of who is the ego."""
    found = hashlib.sha256(repr((ego, [(v.id, v.length, v.width) for v in scenario.vehicles])).encode())
    for part in (scenario.time, scenario.position, scenario.heading, scenario.speed, scenario.present):
        found.update(np.ascontiguousarray(part).tobytes())
    return found.hexdigest()


def units_of(names: Sequence[str], several: Sequence[Origin]) -> tuple[Ints, int]:
    """Return the number (S,) of what each drive counts with, and of how many encounters they are.

    That is its encounter; where all are of one encounter, those that are no copies of another count by themselves.
    """
    encounters = sorted({one.encounter for one in several})
    if len(encounters) > 1:
        place = {name: k for k, name in enumerate(encounters)}
        return np.array([place[one.encounter] for one in several], dtype=np.int64), len(encounters)
    place = {name: k for k, name in enumerate(names)}
    unit = [place.get(one.copy_of, k) for k, one in enumerate(several)]
    return np.array(unit, dtype=np.int64), len(encounters)
