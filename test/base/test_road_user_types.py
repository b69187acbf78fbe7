# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The table of types: who is of which, what the limits are, and how a joint name says it."""

from dataclasses import fields

import pytest

from msg_conventions.trajectory import joint_names, vehicle_of
from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import assigned
from scenario_gen.logs.kinds import type_called
from scenario_gen.method.config import PipelineConfig
from scenario_gen.types import Dynamics, TypeLimits, Vehicle, VEHICLE_TYPES


@pytest.mark.parametrize(
    ("word", "name"),
    [
        ("Car", "car"),
        ("vehicle.bus.rigid", "bus"),
        ("human.pedestrian.adult", "pedestrian"),
        ("pedestrian/bicycle", "pedestrian"),
        ("truck_bus", "truck"),
        ("Motorcyclist", "motorcycle"),
        ("DEFAULT_BIKETYPE", "bicycle"),
        ("delivery van", "van"),
        ("heavy truck", "truck"),
        ("Pedestrians", "pedestrian"),
        ("e_scooter", "e_scooter"),
        ("vehicle.e-scooter.rider", "e_scooter"),
        ("Standup-Scooter", "e_scooter"),
        ("scooter", "motorcycle"),
        ("mobility scooter", "pedestrian"),
        ("vehicle", ""),
        ("hovercraft", None),
    ],
)
def test_what_logs_call_types(word, name):
    assert type_called(word) == name


def test_joint_names_carry_types():
    bicycle, car = Vehicle("b", 1.8, 0.65, "bicycle"), Vehicle("c", 4.8, 1.9)
    assert joint_names((bicycle, car)) == (
        "b:1.8x0.65:bicycle",
        "c:4.8x1.9",
    )  # cars as in older bags
    assert [vehicle_of(name) for name in joint_names((bicycle, car))] == [bicycle, car]
    assert (vehicle_of("t:12.0x2.5").type, vehicle_of("x").type) == ("truck", "car")
    with pytest.raises(
        InputError,
        match=r"vehicle s is of type 'hoverboard'; known are car, van, .*install the package",
    ):
        vehicle_of("s:1.0x0.5:hoverboard")


def test_each_type_has_its_limits():
    assert [entry.name for entry in fields(TypeLimits)] == [*VEHICLE_TYPES.built_in, "plugins"]
    config = assigned(PipelineConfig(), "limits.bus.max_speed=20")
    assert config.limits.of("bus").max_speed == 20.0 and config.limits.of("car") == Dynamics()
    assert Dynamics().planned == Dynamics(40.0, 4.5, 8.0, 5.0, 0.225)
    with pytest.raises(InputError, match=r"limits\.bus.*max_acceleration is -1"):
        assigned(PipelineConfig(), "limits.bus.max_acceleration=-1")
