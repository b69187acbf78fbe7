# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Every recorded log reads without options, and what comes out is a drive that a car can do."""

import numpy as np
import pandas as pd
import pytest
from support.lengths import LOGS, SHIPPED, VEHICLES

from scenario_gen.logs import LogConfig, read_log


def test_the_list_is_complete(data):
    found = {*data.glob("trajectories/*/encounter_*.csv"), *SHIPPED.glob("*.csv")}
    assert found == set(VEHICLES)


@pytest.fixture(scope="module", params=LOGS)
def one(request):
    return request.param, read_log(request.param)


def assert_drivable(encounter, config):
    """Position, speed and heading agree, nothing runs backwards, and who stands is still."""
    for i, (first, last) in enumerate(encounter.present.tolist()):
        own = slice(first, last + 1)
        assert_driven(
            encounter.position[i : i + 1, own],
            encounter.heading[i : i + 1, own],
            encounter.speed[i : i + 1, own],
            encounter.dt,
            config,
        )


def assert_driven(position, heading, speed, dt, config):
    """The same of one vehicle while it is there."""
    steps = np.linalg.norm(np.diff(position, axis=1), axis=2)
    mean_speed = (speed[:, 1:] + speed[:, :-1]) / 2.0
    np.testing.assert_allclose(steps, mean_speed * dt, atol=0.01)
    acceleration = np.diff(speed, axis=1) / dt
    assert acceleration.max() <= config.acceleration_limit + 1e-3
    assert acceleration.min() >= -config.braking_limit - 1e-3
    turned = np.abs(np.diff(heading, axis=1))
    assert (turned <= 0.5 * steps + 1e-6).all(), (
        "a heading that turns without driving"
    )  # a car's circle is above 2 m
    stands = (speed[:, 1:] == 0.0) & (speed[:, :-1] == 0.0)
    assert (steps[stands] < 1e-6).all()
    moving = steps > 0.2
    direction = np.arctan2(*np.moveaxis(np.diff(position, axis=1), 2, 0)[::-1])
    middle = (heading[:, 1:] + heading[:, :-1]) / 2.0
    off = np.angle(np.exp(1j * (direction - middle)))
    assert np.abs(off[moving]).max(initial=0.0) < 0.05


def test_encounter_file_is_one_whole_encounter(one):
    path, result = one
    (encounter,) = result.encounters
    assert len(encounter.vehicles) == VEHICLES[path]
    assert encounter.dt_ns == 100_000_000
    assert encounter.duration >= 5.0
    assert_drivable(encounter, LogConfig())
    quality = result.quality
    assert quality.rows > 100
    assert all(vehicle.moved < 0.6 for vehicle in quality.vehicles)
    assert quality.lines()[0].startswith(path.stem)


def test_recorded_overlaps_are_reported(data):
    (path,) = data.glob("trajectories/*/*four_vehicles*.csv")
    quality = read_log(path).quality
    (overlap,) = quality.encounters[0].overlaps
    assert (overlap.first, overlap.second) == ("1", "2")
    assert 0.4 < overlap.share < 0.7  # the data folder's README: they overlap for half of it
    assert any("overlap 5" in line for line in quality.lines())


def test_size_and_frame_of_ngsim_stay():
    path = SHIPPED / "ngsim_left_turn.csv"
    encounter = read_log(path).encounters[0]
    first = pd.read_csv(path).query("vehicle_id == 2839").iloc[0]
    assert (encounter.vehicles[0].length, encounter.vehicles[0].width) == (3.81, 1.9812)
    assert encounter.origin is None
    assert np.linalg.norm(encounter.position[0, 0] - first[["x", "y"]].astype(float)) < 0.3


@pytest.mark.parametrize(
    "pattern",
    ["psu_2obu/*_full.csv", "openacc_zalazone/*first150s.csv", "ngsim_commonroad/*Peach*all*.csv"],
)
def test_long_logs_give_sensible_encounters(data, pattern):
    (path,) = data.glob(f"trajectories/{pattern}")
    config = LogConfig(max_vehicles=3, max_duration=40.0)
    result = read_log(path, config)
    assert len(result.encounters) >= 3
    for encounter in result.encounters:
        assert 2 <= len(encounter.vehicles) <= 3
        assert config.min_duration - 0.05 <= encounter.duration <= config.max_duration + 1e-6
        assert_drivable(encounter, config)
        gaps = np.linalg.norm(encounter.position[:, None] - encounter.position[None], axis=3)
        gaps[np.arange(len(gaps)), np.arange(len(gaps))] = np.inf
        assert (gaps.min(axis=1) < config.proximity).mean() > 0.85
        driven = encounter.speed.sum(axis=1).max() * encounter.dt
        assert driven >= config.travel
    assert len({encounter.name for encounter in result.encounters}) == len(result.encounters)


def test_files_on_one_clock_are_joined(data):
    paths = sorted(data.glob("trajectories/cats_av_lane_change/cats_vehicle[24]_full.csv"))
    result = read_log(paths, LogConfig(start=30.0, end=75.0))
    (encounter,) = result.encounters
    assert [vehicle.id for vehicle in encounter.vehicles] == ["2", "4"]
    assert 35_150 * 10**9 < encounter.start_ns < 35_230 * 10**9


def test_window_and_vehicles_can_be_chosen(data):
    (path,) = data.glob("trajectories/openacc_zalazone/*first150s.csv")
    config = LogConfig(vehicles="TESLA_MODELS,BMW_I3", start=40.0, end=60.0)
    (encounter,) = read_log(path, config).encounters
    assert [vehicle.id for vehicle in encounter.vehicles] == ["BMW_I3", "TESLA_MODELS"]
    assert encounter.duration == pytest.approx(20.0, abs=0.11)


def test_reading_twice_gives_the_same_bytes(one):
    path, first = one
    again = read_log(path)
    for a, b in zip(first.encounters, again.encounters, strict=True):
        for field in ("position", "heading", "speed"):
            assert getattr(a, field).tobytes() == getattr(b, field).tobytes()
    assert repr(first.quality) == repr(again.quality)  # some of it is NaN
