# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What is painted: every border once, by what lies on both sides of it; stop lines and arrows."""

from dataclasses import replace

import numpy as np
import pytest

from msg_conventions.cdr import decode
from msg_conventions.layouts import MARKERS
from msg_conventions.pictures import PAINT, road_markers
from scenario_gen.roads import build_road, RoadConfig
from scenario_gen.types import RuleKind, TrafficRule
from scenario_gen.types.markings import Marking, markings


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("drawn", [True, False])
def test_each_border_is_painted_once(side, drawn):
    network = build_road("t_intersection", None, RoadConfig(lanes=2, traffic_side=side)).lanes
    line = np.array([[20.0, 1.0], [20.0, 5.0]])
    rules = (
        TrafficRule("s", RuleKind.STOP, (0,), (), line),
        TrafficRule("p", RuleKind.PRIORITY, (1,), (), line),
    )
    arms = replace(
        network,
        lanes=tuple(replace(n, successors=()) for n in network.lanes if not n.junction),
        drawn=drawn,
    )
    painted = markings(replace(arms, rules=rules))
    counts = {kind: len(lines) for kind, lines in painted.items()}
    assert counts == {
        Marking.EDGE: 6, Marking.LANE: 6, Marking.CENTRE: 3, Marking.STOP: 1, Marking.GIVE_WAY: 0, Marking.ARROW: 12
    }  # fmt: skip
    yaw = [np.arctan2(*(arrow[3] - arrow[0])[::-1]) for arrow in painted[Marking.ARROW]]
    assert np.cos(np.array(yaw) - [lane.yaw[0] for lane in arms.lanes]).min() > 0.99


def test_markers_have_dashes():
    network = build_road("straight").lanes
    first, *paint = decode(MARKERS, road_markers(network, "map", 5), "road/markings").markers
    assert first.action == 3 and [marker.name for marker in paint] == ["edge", "centre", "arrow"]
    (dashes,) = (marker.points for marker in paint if marker.name == "centre")
    _, dash, gap = PAINT[Marking.CENTRE]
    assert np.hypot(*(dashes[1:-1:2] - dashes[:-2:2])[:, :2].T) == pytest.approx(dash, abs=1e-6)
    assert len(dashes) // 2 == int(np.ceil(120.0 / (dash + gap)))
    assert len(decode(MARKERS, road_markers(None, "map", 5), "road/markings").markers) == 1


def test_crossings_and_cycle_lanes_are_painted():
    config = RoadConfig(crossing="zebra", cycle_lane=2.0)
    painted, plain = (
        markings(build_road("straight", None, config).lanes),
        markings(build_road("straight").lanes),
    )
    bars = np.stack(painted[Marking.ZEBRA])
    assert (
        len(bars) == 11 and Marking.ZEBRA not in plain
    )  # a bar a metre, on 7 m of lanes and 4 m of cycle lanes
    assert np.hypot(*(bars[:, 1] - bars[:, 0]).T) == pytest.approx(4.0) and np.ptp(
        bars[:, :, 0], axis=0
    ) == pytest.approx(0.0)
    assert (
        len(painted[Marking.EDGE]) == 4
        and not painted[Marking.LANE]
        and len(painted[Marking.CENTRE]) == 1
    )
    names = [
        marker.name
        for marker in decode(
            MARKERS, road_markers(build_road("straight", None, config).lanes, "map", 5), "m"
        ).markers
    ]
    assert names == ["", "edge", "centre", "arrow", "zebra"]
