# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A type of road users: a cargo bike with a motor, which European law limits to 25 km/h."""

from scenario_gen.types import Dynamics, VehicleType

CARGO_BIKE = VehicleType(
    length=2.6,
    width=0.9,
    height=1.7,
    dynamics=Dynamics(
        max_speed=7.0,
        max_acceleration=3.0,
        max_deceleration=5.0,
        max_lateral_acceleration=4.0,
        max_curvature=0.4,
    ),
    words=("cargobike", "cargo bicycle"),
    autoware=6,
    openscenario="bicycle",
    scenarionet="CYCLIST",
)
