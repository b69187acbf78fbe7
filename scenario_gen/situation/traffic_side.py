# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""On which side of the road a template drives, and its mirror image."""

from dataclasses import replace

import numpy as np

from scenario_gen.numerics import wrap_angle
from scenario_gen.numerics.plane import ahead_and_left
from scenario_gen.types import Encounter

_OPPOSITE = np.radians(150.0)  # between headings, at least
_ABREAST = 6.0  # m ahead or behind
_BESIDE = (1.5, 8.0)  # m sideways
_MOVES = 2.0  # m/s


def traffic_side(encounter: Encounter) -> str:
    """Return "right" or "left", on which oncoming vehicles pass each other; "" where none do.

    In right-hand traffic an oncoming vehicle passes on one's left.
    """
    votes = 0
    for a in range(len(encounter.vehicles)):
        both = (
            encounter.is_present[a]
            & encounter.is_present
            & (encounter.speed[a] > _MOVES)
            & (encounter.speed > _MOVES)
        )
        ahead, left = ahead_and_left(
            encounter.position - encounter.position[a], encounter.heading[a]
        )
        passing = (
            both
            & (np.abs(wrap_angle(encounter.heading - encounter.heading[a])) > _OPPOSITE)
            & (np.abs(ahead) < _ABREAST)
        )
        passing &= (np.abs(left) > _BESIDE[0]) & (np.abs(left) < _BESIDE[1])
        votes += int(np.sign(left[passing]).sum())
    return "right" if votes > 0 else "left" if votes < 0 else ""


def mirrored(encounter: Encounter) -> Encounter:
    """Return the encounter with left and right exchanged; it has no place on the globe."""
    return replace(
        encounter,
        name=f"{encounter.name} mirrored",
        position=encounter.position * np.array([1.0, -1.0]),
        heading=-encounter.heading,
        origin=None,
    )
