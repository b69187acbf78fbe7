# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Drawn roads: a grid of their lanes, ends of lanes as entries and exits, and lanes that travel in messages."""

from pathlib import Path

import numpy as np
import pytest
from scipy import ndimage

from msg_conventions.lanes import decode_lanes, encode_lanes
from scenario_gen.roads import Arm, build_road, BUILT_IN, draw_plan, Plan, RoadConfig

FORMER = np.load(Path(__file__).with_name("cells_without_lanes.npz"))  # as roads were drawn before they were drawn from lanes


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("name", [*BUILT_IN, "paper"])
def test_a_road_is_its_lanes_and_they_travel_in_messages(name, side):
    config = RoadConfig(lanes=2, traffic_side=side, paper=name == "paper")
    road = build_road("t_intersection" if name == "paper" else name, None, config)
    network = road.lanes
    for k in (*network.entries, *network.exits):
        assert not network.lanes[k].junction  # traffic comes and goes by arms alone
    for lane in network.lanes:
        assert road.drivable_at(lane.centre[1:-1]).all()
        assert all(np.allclose(network.lanes[k].left[0], lane.left[-1]) for k in lane.successors)
    assert network.traffic_side == side and road.map_lanes is None
    _, again = decode_lanes(encode_lanes(network, "map", 0))
    assert again.drawn and again.arms == network.arms


@pytest.mark.parametrize("lanes, side", [(1, "right"), (2, "left")])
@pytest.mark.parametrize("name", BUILT_IN)
def test_cells_are_those_of_the_road_that_was_drawn_without_lanes_but_for_its_kerbs(name, lanes, side):
    road, key = build_road(name, None, RoadConfig(lanes=lanes, traffic_side=side)), f"{name}_{lanes}_{side}"
    former = np.unpackbits(FORMER[key], axis=1, count=int(FORMER[f"{key}_width"])).astype(bool)
    row, column = np.indices(former.shape)
    middle = (np.stack((column, row), axis=-1) + 0.5) * road.resolution
    differ = road.drivable_at(middle + road.entries[0, :2] - FORMER[f"{key}_entry"]) != former
    around = np.ones((3, 3), dtype=bool)
    kerb = ndimage.binary_dilation(former, around) ^ ndimage.binary_erosion(former, around, border_value=1)
    assert (differ & ~kerb).sum() < 0.01 * former.sum()  # 0.7 % of a roundabout, 0.3 % of the others at most
    assert differ.sum() < 0.07 * former.sum()


def test_a_road_of_ones_own_has_all_ways_also_where_its_arms_meet_at_a_sharp_angle():
    arms = [Arm.towards(np.pi, 80.0, 2), *(Arm.towards(yaw, 80.0, 1) for yaw in (0.87, -0.87))]
    network = draw_plan(Plan(arms, yielding=(1, 2)), "y", RoadConfig()).lanes
    ways = {tuple(end.partition(".")[0] for end in lane.id.split(">")) for lane in network.lanes if lane.junction}
    assert ways == {(a, b) for a in "123" for b in "123" if a != b}
    assert (len(network.entries), len(network.exits), len(network.rules)) == (4, 4, 2)
