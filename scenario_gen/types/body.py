# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What is assumed of a vehicle's body from its type and footprint: height, rear axle; for formats that need them."""

import numpy as np

from scenario_gen.numerics import Floats
from scenario_gen.numerics.plane import unit
from scenario_gen.types.vehicle import Vehicle

REAR_AXLE = 0.3  # of the length, from the footprint's centre back: 1.44 m of a car of 4.8 m
WHEELBASE = 0.6  # of the length


def height(vehicle: Vehicle) -> float:
    """Height in metres, by type; logs do not hold it."""
    return vehicle.kind.height


def rear_axle(vehicle: Vehicle) -> float:
    """Metres from the footprint's centre back to the middle of the rear axle; a share of the length, for logs do not hold it.

    Who walks is placed by the middle.
    """
    return 0.0 if vehicle.kind.walks else REAR_AXLE * vehicle.length


def shifted(position: Floats, heading: Floats, ahead: float) -> Floats:
    """Return points (..., 2) [m] that lie `ahead` metres along headings (...) [rad] from positions (..., 2) [m]."""
    return np.asarray(position + ahead * unit(heading))
