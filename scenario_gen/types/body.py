# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Height and rear axle of a vehicle, estimated from its type and footprint for exports."""

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
    """Metres from the footprint's centre back to the rear axle's middle, as a share of the length.

    Who walks is placed by the middle.
    """
    return 0.0 if vehicle.kind.walks else REAR_AXLE * vehicle.length


def shifted(position: Floats, heading: Floats, ahead: float) -> Floats:
    """Return positions (..., 2) [m] shifted by `ahead` [m] along headings (...) [rad]."""
    return np.asarray(position + ahead * unit(heading))
