# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A trailer is a part of its vehicle: it hangs on the hitch, needs room, and travels in messages."""

from dataclasses import replace
import xml.etree.ElementTree as ET

import numpy as np
from support.small_scenarios import case_of, moving

from msg_conventions.trajectory import joint_names, vehicle_of
from scenario_gen.method.validity import Checker
from scenario_gen.output.exchange.cases import Exported
from scenario_gen.output.exchange.openscenario import write_openscenario
from scenario_gen.types import Cause, Trailer, Vehicle
from scenario_gen.types.vehicle import shifted

TRUCK = Vehicle("t", 7.0, 2.5, "truck", Trailer("tl", 8.0, 2.4, 3.5, 6.0))
CAR = Vehicle("c")


def test_trailer_hangs_without_side_slip():
    truck = moving([[0.0, 0.0, 0.3, 6.0, -0.2, 0.15]], vehicles=[TRUCK]).with_trailers()
    assert truck.ids == ("t", "tl") and truck.owners == (0, 0) and truck.with_trailers() is truck
    hitch = shifted(truck.position[0], truck.heading[0], -3.5)
    ahead = shifted(truck.position[1], truck.heading[1], 6.0)
    assert np.allclose(ahead, hitch, atol=1e-9)
    driven = np.gradient(truck.position[1], truck.time, axis=0)
    along = np.stack([np.cos(truck.heading[1]), np.sin(truck.heading[1])], axis=-1)
    left = driven[:, 1] * along[:, 0] - driven[:, 0] * along[:, 1]
    assert np.abs((driven * along).sum(axis=1) - truck.speed[1])[1:-1].max() < 0.01
    assert np.abs(left[1:-1]).max() < 0.01
    bend = truck.heading[0, -1] - truck.heading[1, -1]
    assert 0.1 < bend < np.pi / 2.0  # inside of the truck's bend


def test_hit_trailer_is_refused():
    rows = [[0.0, 0.0, 0.0, 5.0, 0.0, 0.0], [0.0, -16.0, np.pi / 2.0, 5.0, 0.0, 0.0]]
    scenario = moving(rows, vehicles=[TRUCK, CAR])
    alone = replace(scenario, vehicles=(replace(TRUCK, trailer=None), CAR))
    (hit,) = Checker(None, None, None, None).check([scenario])
    (free,) = Checker(None, None, None, None).check([alone])
    assert [(fault.cause, fault.vehicles) for fault in hit.violations] == [(Cause.OVERLAP, (0, 1))]
    assert free.valid


def test_trailer_travels_in_joint_names():
    assert vehicle_of(joint_names([TRUCK])[0]) == TRUCK
    rows = [[0.0, 0.0, 0.0, 5.0, 0.0, 0.1], [-40.0, 0.0, 0.0, 5.0, 0.0, 0.0]]
    case, exported = case_of(moving(rows, vehicles=[TRUCK, CAR]))
    others = exported.others.with_trailers()
    exported = Exported(3, 7, "", others, None)
    root = ET.fromstring(write_openscenario(case, exported, "road.xodr"))
    vehicles = [each.get("vehicleCategory") for each in root.iter("Vehicle")]
    assert vehicles == ["truck", "car", "trailer"]
