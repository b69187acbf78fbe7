# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Scenarios of a few vehicles at one speed, one behind the other or at a crossing."""

import numpy as np

from benchmarks._driving_worlds import as_scenario, PERIOD


class Acts:
    """A planner that answers with what a function gives of what it sees."""

    def __init__(self, act):
        self.act = act

    def reset(self, task):
        """Begin."""


def following(speed, gap, vehicles=2):
    """Vehicles one behind the other on a straight line, at one speed [m/s] and with the same gaps [m]; the last one leads."""
    time = np.arange(150) * PERIOD
    motions, start = [], 0.0
    for k in range(vehicles):
        xy = np.stack([start + speed * time, np.zeros_like(time)], axis=1)
        motions.append((xy, np.zeros_like(time), np.full_like(time, speed)))
        start += gap + (4.25, 4.75, 4.5)[k % 3]  # half of both lengths
    return as_scenario(motions, len(time))


def crossing(first_speed=8.0, second_speed=8.0, second_start=-60.0):
    """Vehicle 0 crosses from the west, then vehicle 1 from the south."""
    time = np.arange(150) * PERIOD
    zero = np.zeros_like(time)
    west = (
        np.stack([-30.0 + first_speed * time, zero], axis=1),
        zero,
        np.full_like(time, first_speed),
    )
    place = np.stack([zero, second_start + second_speed * time], axis=1)
    south = (place, zero + np.pi / 2, zero + second_speed)
    return as_scenario([west, south], len(time))
