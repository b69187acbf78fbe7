# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Vehicles that come and go within a scenario: they were somewhere just before, and are somewhere just after."""

import numpy as np

from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.plane import unit
from scenario_gen.types import Scenario

SAME = 0.5e-9  # s, instants are whole nanoseconds


def driven_on(scenario: Scenario, margin: float) -> tuple[Floats, Floats, Floats, Ints]:
    """Return positions (N, T, 2) [m], headings (N, T) [rad], speeds (N, T) [m/s] and presence (N, 2), widened.

    Before its first and after its last instant a vehicle drives on at the speed and the rate of turn that it has there, along an
    arc: the chord of an angle a is sin(a / 2) / (a / 2) times as long as the arc and lies at a / 2 to its start.

    Args:
        scenario: whose vehicles are there for a part of the time.
        margin: seconds by which each presence is widened at least at either end, up to an instant of the scenario, if it has one.
    """
    time, present = scenario.time, scenario.present.copy()
    position, heading, speed = (
        scenario.position.copy(),
        scenario.heading.copy(),
        scenario.speed.copy(),
    )
    for i, (first, last) in enumerate(scenario.present.tolist()):
        present[i, 0] = max(
            np.searchsorted(time, time[first] - margin + SAME, side="right") - 1, 0
        )
        present[i, 1] = min(np.searchsorted(time, time[last] + margin - SAME), len(time) - 1)
        for end, inner, beyond in (
            (first, first + 1, slice(present[i, 0], first)),
            (last, last - 1, slice(last + 1, present[i, 1] + 1)),
        ):
            rate = (heading[i, inner] - heading[i, end]) / (time[inner] - time[end])
            since = time[beyond] - time[end]
            half = 0.5 * rate * since
            chord = (
                speed[i, end]
                * since
                * np.where(half == 0.0, 1.0, np.sin(half) / np.where(half == 0.0, 1.0, half))
            )
            middle = heading[i, end] + half
            position[i, beyond] = position[i, end] + chord[:, None] * unit(middle)
            heading[i, beyond] = heading[i, end] + rate * since
    return position, heading, speed, present
