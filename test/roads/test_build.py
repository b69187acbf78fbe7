# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Built-in roads and the corridor: lanes, entries, exits, sizes."""

import numpy as np
import pytest
from support.lengths import LOGS
from support.motions import encounter_of

from scenario_gen.base.errors import InputError
from scenario_gen.logs import read_log
from scenario_gen.roads import build_road, RoadConfig
from scenario_gen.roads.clearance import footprint_fits
from scenario_gen.situation import Situation
from scenario_gen.situation.separation import smallest_gaps

ARMS = {"straight": 2, "t_intersection": 3, "four_way": 4}


@pytest.mark.parametrize("name", list(ARMS))
@pytest.mark.parametrize("lanes", [1, 2])
@pytest.mark.parametrize("side", ["right", "left"])
def test_one_entry_and_exit_per_lane(name, lanes, side):
    road = build_road(name, None, RoadConfig(lanes=lanes, traffic_side=side))
    assert len(road.entries) == len(road.exits) == ARMS[name] * lanes
    width, height = road.drivable.shape[1] * 0.2, road.drivable.shape[0] * 0.2
    for poses, sign in ((road.entries, 1.0), (road.exits, -1.0)):
        for x, y, yaw in poses:
            inward = np.array([np.cos(yaw), np.sin(yaw)]) * sign
            assert min(x, y, abs(width - x), abs(height - y)) < 2.3
            inside = np.array([x, y]) + inward * 3.0
            assert footprint_fits(road, np.array([[*inside, yaw]]), 4.8, 1.9)[0]
            assert not footprint_fits(road, np.array([[*(inside - inward * 6.0), yaw]]), 4.8, 1.9)[
                0
            ]
    # two vehicles that meet on the same road pass on the agreed side of each other
    entry = road.entries[0]
    leave = next(x for x in road.exits if abs(np.cos(x[2] - road.entries[0][2]) + 1.0) < 1e-6)
    left = -np.sin(entry[2]) * (leave[0] - entry[0]) + np.cos(entry[2]) * (leave[1] - entry[1])
    assert (left > 0.0) == (side == "right")


@pytest.mark.parametrize("name", ["t_intersection", "four_way"])
def test_corners_have_their_stated_radius(name):
    sharp = build_road(name, None, RoadConfig(lanes=1, corner_radius=5.0)).drivable
    round_ = build_road(name, None, RoadConfig(lanes=1, corner_radius=9.0)).drivable
    corners = 2 if name == "t_intersection" else 4
    gained = (round_.sum() - sharp.sum()) * 0.2**2
    assert gained == pytest.approx(corners * (81.0 - 25.0) * (1.0 - np.pi / 4.0), rel=0.05)


def test_resolution_and_arm_length_are_kept():
    road = build_road("straight", None, RoadConfig(arm_length=50.0, lanes=1, resolution=0.1))
    assert road.drivable.any(axis=0).sum() in (
        1000,
        1001,
    )  # kerbs are on cell edges, ends need not be
    assert road.drivable.sum(axis=0).max() == 70  # 2 x 3.5 m in cells


def test_unknown_and_impossible_roads_are_named():
    with pytest.raises(InputError, match="motorway"):
        build_road("motorway", None)
    with pytest.raises(InputError, match="corridor"):
        build_road("corridor", None)


@pytest.mark.parametrize("path", LOGS)
def test_recorded_encounters_fit_their_corridors(path):
    (encounter,) = read_log(path).encounters
    road = build_road("corridor", encounter)
    separation = Situation.of(encounter).separation
    assert smallest_gaps(separation.tracks).min() > 0.49
    assert separation.moved.max() <= 3.0
    for track in separation.tracks:
        size = track.vehicle.length, track.vehicle.width + 1.0
        assert footprint_fits(road, track.poses, *size).all(), track.vehicle.id


def test_corridor_lane_holds_who_shares_it():
    """The last of three has the longest path; the lane goes on to where the first one ends."""
    time = np.arange(0.0, 10.05, 0.1)
    starts, speeds = np.array([0.0, -20.0, -45.0]), np.array([7.0, 7.2, 7.5])
    x = starts[:, None] + speeds[:, None] * time
    encounter = encounter_of(np.stack([x, 0.0 * x], axis=-1), speed=speeds[:, None])
    (lane,) = build_road("corridor", encounter).lanes.lanes
    half = 0.5 * encounter.vehicles[0].length
    assert lane.centre[:, 0].min() < x.min() - half
    assert lane.centre[:, 0].max() > x.max() + half
