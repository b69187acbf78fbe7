# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A type of road users: an e-scooter, which German law (eKFV) limits to 20 km/h; its size is that of a rider who stands on it."""

from scenario_gen.types import Dynamics, VehicleType

E_SCOOTER = VehicleType(
    length=1.2,
    width=0.6,
    height=1.8,
    dynamics=Dynamics(
        max_speed=7.0,
        max_acceleration=3.0,
        max_deceleration=5.0,
        max_lateral_acceleration=4.0,
        max_curvature=1.0,
    ),
    words=("e_scooter", "escooter", "standup scooter"),
    autoware=6,
    openscenario="bicycle",
    osi="STANDUP_SCOOTER",
    scenarionet="CYCLIST",
)
