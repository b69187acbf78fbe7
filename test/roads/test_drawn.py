# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The lanes of drawn roads: they begin and end at its entries and exits, travel in messages, and hold nobody."""

import numpy as np
import pytest

from msg_conventions.lanes import decode_lanes, encode_lanes
from scenario_gen.roads import build_road, BUILT_IN, RoadConfig
from scenario_gen.roads.vector.network import lane_ends


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("name", BUILT_IN)
def test_lanes_begin_at_entries_and_end_at_exits(name, side):
    road = build_road(name, None, RoadConfig(lanes=2, traffic_side=side))
    for ends, poses in zip(lane_ends(road.lanes), (road.entries, road.exits), strict=True):
        away = np.hypot(*(ends[:, None, :2] - poses[None, :, :2]).transpose(2, 0, 1))
        assert len(ends) == len(poses) and away.min(axis=0).max() < 1e-6
        assert np.cos(ends[:, 2] - poses[away.argmin(axis=1), 2]).min() > 0.9999
    assert road.lanes.traffic_side == side and road.map_lanes is None
    _, again = decode_lanes(encode_lanes(road.lanes, "map", 0))
    assert again.drawn and again.arms == road.lanes.arms and again.turns_back == (name == "roundabout")


def test_the_papers_roads_have_no_lanes_for_their_lengths_are_cells():
    assert build_road("straight", None, RoadConfig(paper=True)).lanes is None
