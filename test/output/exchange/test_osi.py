# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Traces of OSI: the motion of the bag to the micrometre, the road as OpenDRIVE, and back again as a log."""

from dataclasses import replace

import numpy as np
import pytest
from support.small_scenarios import observed

from scenario_gen.base.errors import InputError
from scenario_gen.output.exchange.cases import read_cases
from scenario_gen.output.exchange.config import ExportConfig
from scenario_gen.output.exchange.export import export_bag

betterosi = pytest.importorskip("betterosi")


@pytest.fixture(scope="module")
def exported(small_bag, tmp_path_factory):
    folder = tmp_path_factory.mktemp("osi") / "out"
    assert export_bag(small_bag, folder, "osi").scenarios == 4
    return folder


def messages(path, kind=betterosi.GroundTruth):
    return [message for message in betterosi.read(path) if isinstance(message, kind)]


def scenarios(bag):
    """Return (file name, scenario) of each scenario of a bag."""
    for case in read_cases(bag):
        for one in case.scenarios:
            yield f"case_{case.number}_{one.index}.mcap", one.others


def test_the_motion_is_that_of_the_bag(small_bag, exported):
    for name, scenario in scenarios(small_bag):
        found = messages(exported / name)
        stamps = [message.timestamp.seconds + message.timestamp.nanos * 1e-9 for message in found]
        assert np.allclose(stamps, scenario.time, atol=1e-9) and stamps[0] == 0.0
        for k, message in enumerate(found):
            things = {thing.id.value: thing for thing in message.moving_object}
            assert set(things) == {
                int(scenario.vehicles[n].id) for n in np.flatnonzero(scenario.is_present[:, k])
            }
            for n, vehicle in enumerate(scenario.vehicles):
                if not scenario.is_present[n, k]:
                    continue
                base = things[int(vehicle.id)].base
                assert np.allclose(
                    (base.position.x, base.position.y), scenario.position[n, k], atol=1e-6
                )
                assert (
                    abs(np.hypot(base.velocity.x, base.velocity.y) - scenario.speed[n, k]) < 1e-6
                )
                assert (
                    abs(np.angle(np.exp(1j * (base.orientation.yaw - scenario.heading[n, k]))))
                    < 1e-6
                )
                assert (base.dimension.length, base.dimension.width) == (
                    vehicle.length,
                    vehicle.width,
                )
                assert base.position.z == base.dimension.height / 2.0 > 0.0


def test_the_road_is_in_the_file_and_beside_it(exported):
    for path in exported.glob("*.mcap"):
        (drawn,) = messages(path, betterosi.MapAsamOpenDrive)
        assert drawn.open_drive_xml_content == (exported / drawn.map_reference).read_text()
        assert {message.map_reference for message in messages(path)} == {drawn.map_reference}


def test_the_host_is_the_ego_or_else_the_first_vehicle(small_bag, exported, tmp_path):
    assert {
        message.host_vehicle_id.value
        for path in exported.glob("*.mcap")
        for message in messages(path)
    } == {1}
    export_bag(small_bag, tmp_path / "out", "osi", ExportConfig(ego="2"))
    for path in (tmp_path / "out").glob("*.mcap"):
        assert {message.host_vehicle_id.value for message in messages(path)} == {2}


def test_what_is_exported_is_read_back(small_bag, exported):
    for name, scenario in scenarios(small_bag):
        found = {track.id: track for track in observed(exported / name).vehicles}
        assert set(found) == {vehicle.id for vehicle in scenario.vehicles}
        for n, vehicle in enumerate(scenario.vehicles):
            track = found[vehicle.id]
            assert np.allclose(track.fix, scenario.position[n, scenario.is_present[n]], atol=1e-6)
            assert np.allclose(track.speed, scenario.speed[n, scenario.is_present[n]], atol=1e-6)


def test_ids_that_are_no_numbers_are_counted_and_that_is_said(small_bag, tmp_path):
    from scenario_gen.output.exchange.cases import Exported
    from scenario_gen.output.exchange.osi import object_numbers

    _, scenario = next(scenarios(small_bag))
    vehicles = tuple(
        replace(vehicle, id=name)
        for vehicle, name in zip(scenario.vehicles, ("a", "7"), strict=True)
    )
    one = Exported(0, 0, "ab" * 32, replace(scenario, vehicles=vehicles), None, driven=False)
    assert object_numbers(one) == ((1, 2), ("ids are numbers in OSI: a is 1, 7 is 2",))


@pytest.mark.parametrize("cut", [40, 2000, -100])
def test_a_trace_that_is_cut_off_is_refused_by_name(exported, tmp_path, cut):
    whole = next(exported.glob("*.mcap")).read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[:cut])
    with pytest.raises(InputError, match=r"cut\.mcap"):
        observed(tmp_path / "cut.mcap")
