# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What is assumed of a vehicle's body from its footprint: kind, height, rear axle; for formats that need them."""

import numpy as np

from scenario_gen.numerics import Floats
from scenario_gen.numerics.plane import unit
from scenario_gen.types.encounter import Vehicle

REAR_AXLE = 0.3  # of the length, from the footprint's centre back: 1.44 m of a car of 4.8 m
WHEELBASE = 0.6  # of the length
TRUCK_LENGTH = 7.0  # metres, from which on a vehicle counts as a truck
CAR_HEIGHT, TRUCK_HEIGHT = 1.5, 3.2  # metres


def is_truck(vehicle: Vehicle) -> bool:
    """Whether it is so long that it counts as a truck; logs do not hold the kind."""
    return vehicle.length >= TRUCK_LENGTH


def height(vehicle: Vehicle) -> float:
    """Height in metres, by kind; logs do not hold it."""
    return TRUCK_HEIGHT if is_truck(vehicle) else CAR_HEIGHT


def rear_axle(vehicle: Vehicle) -> float:
    """Metres from the footprint's centre back to the middle of the rear axle; a share of the length, for logs do not hold it."""
    return REAR_AXLE * vehicle.length


def shifted(position: Floats, heading: Floats, ahead: float) -> Floats:
    """Return points (..., 2) [m] that lie `ahead` metres along headings (...) [rad] from positions (..., 2) [m]."""
    return np.asarray(position + ahead * unit(heading))
