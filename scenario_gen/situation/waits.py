# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Waits: a smoothed speed below 0.5 m/s (on foot 0.2 m/s) for at least 1 s."""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from scenario_gen.numerics import Floats, runs
from scenario_gen.types import CAR, Encounter, VEHICLE_TYPES

WAIT_SPEED_MPS = VEHICLE_TYPES.built_in[CAR].waits_below
MIN_WAIT_S = 1.0
SMOOTHING_S = 0.5  # width of the centred moving mean
STANDSTILL_SPEED_MPS = 0.1  # a vehicle that is faster creeps


@dataclass(frozen=True)
class Wait:
    """A vehicle waits.

    Attributes:
        vehicle: index of the vehicle.
        start: seconds.
        end: seconds.
        moves_slowly: whether the vehicle creeps: it stands for less than 1 s.
    """

    vehicle: int
    start: float
    end: float
    moves_slowly: bool = False


def find_waits(encounter: Encounter) -> tuple[Wait, ...]:
    """Return the waits of all vehicles, ordered by vehicle and time."""
    width = 2 * round(0.5 * SMOOTHING_S / encounter.dt) + 1
    smooth = ndimage.uniform_filter1d(encounter.speed, width, mode="nearest")
    time = encounter.time
    waits = []
    for n, vehicle in enumerate(encounter.vehicles):
        slow = (smooth[n] < vehicle.kind.waits_below) & encounter.is_present[n]
        for begin, end in runs(slow):
            start, stop = float(time[begin]), float(time[end - 1])
            if stop - start >= MIN_WAIT_S - 1e-9:
                creeps = _creeps(encounter.speed[n, begin:end], time[begin:end])
                waits.append(Wait(n, start, stop, creeps))
    return tuple(waits)


def _creeps(speed: Floats, time: Floats) -> bool:
    """Whether less than `MIN_WAIT_S` lies between the first and the last standstill."""
    standstill = time[speed <= STANDSTILL_SPEED_MPS]
    return len(standstill) == 0 or bool(np.ptp(standstill) < MIN_WAIT_S - 1e-9)
