# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The side of the road on which an encounter drives, and its mirror image."""

from dataclasses import replace

import numpy as np

from scenario_gen.numerics import ahead_and_left, wrap_angle
from scenario_gen.types import Encounter

ONCOMING_RAD = np.radians(150.0)  # least difference of headings
MAX_AHEAD_M = 6.0  # of two vehicles that pass each other
MIN_SIDEWAYS_M = 1.5
MAX_SIDEWAYS_M = 8.0
MIN_PASSING_SPEED_MPS = 2.0


def traffic_side(encounter: Encounter) -> str:
    """Return "right" or "left" for the side of traffic; "" if no oncoming vehicles pass.

    In right-hand traffic an oncoming vehicle passes on one's left.
    """
    votes = 0
    moves = encounter.is_present & (encounter.speed > MIN_PASSING_SPEED_MPS)
    for n in range(len(encounter.vehicles)):
        heading = encounter.heading[n]
        ahead, left = ahead_and_left(encounter.position - encounter.position[n], heading)
        passes = (
            moves[n]
            & moves
            & (np.abs(wrap_angle(encounter.heading - heading)) > ONCOMING_RAD)
            & (np.abs(ahead) < MAX_AHEAD_M)
            & (np.abs(left) > MIN_SIDEWAYS_M)
            & (np.abs(left) < MAX_SIDEWAYS_M)
        )
        votes += int(np.sign(left[passes]).sum())
    if votes == 0:
        return ""
    return "right" if votes > 0 else "left"


def mirrored(encounter: Encounter) -> Encounter:
    """Return the encounter with left and right exchanged; it has no place on the globe."""
    flip = np.array([1.0, -1.0])
    lights = (replace(light, line=light.line[::-1] * flip) for light in encounter.lights)
    return replace(
        encounter,
        position=encounter.position * flip,
        heading=-encounter.heading,
        origin=None,
        lights=tuple(lights),
    )
