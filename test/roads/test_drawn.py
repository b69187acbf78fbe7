# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Drawn roads: a grid of their lanes, ends of lanes as entries and exits, and lanes that travel in messages."""

import numpy as np
import pytest
from support.message_examples import lanes_again

from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.logs import read_log
from scenario_gen.logs.synthetic import bundled
from scenario_gen.roads import Arm, build_road, BUILT_IN, draw_plan, ground_for, Plan, RoadConfig
from scenario_gen.types import Vehicle


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("name", BUILT_IN)
def test_road_is_its_lanes_in_messages(name, side):
    road = build_road(name, None, RoadConfig(lanes=2, traffic_side=side))
    network = road.lanes
    for k in (*network.entries, *network.exits):
        assert not network.lanes[k].junction  # traffic comes and goes by arms alone
    for lane in network.lanes:
        assert road.drivable_at(lane.centre[1:-1]).all()
        assert all(np.allclose(network.lanes[k].left[0], lane.left[-1]) for k in lane.successors)
    assert network.traffic_side == side and road.map_lanes is None
    again = lanes_again(network)
    assert again.drawn and again.arms == network.arms


def test_sharp_planned_road_has_all_ways():
    arms = [Arm.towards(np.pi, 80.0, 2), *(Arm.towards(yaw, 80.0, 1) for yaw in (0.87, -0.87))]
    network = draw_plan(Plan(arms, yielding=(1, 2)), "y", RoadConfig()).lanes
    ways = {
        tuple(end.partition(".")[0] for end in lane.id.split(">"))
        for lane in network.lanes
        if lane.junction
    }
    assert ways == {(a, b) for a in "123" for b in "123" if a != b}
    assert (len(network.entries), len(network.exits), len(network.rules)) == (4, 4, 2)


BICYCLE = Vehicle("b", 1.8, 0.65, "bicycle")


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize(
    "name, arms, ways",
    [("straight", 1, 0), ("curve", 1, 0), ("t_intersection", 3, 6), ("four_way", 4, 12)],
)
def test_cycle_lanes_lie_beside_outermost_lanes(name, arms, ways, side):
    config = RoadConfig(lanes=2, cycle_lane=1.8, traffic_side=side)
    road = build_road(name, None, config)
    plain = build_road(name, None, RoadConfig(lanes=2, traffic_side=side))
    assert [lane.id for lane in road.lanes.lanes] == [lane.id for lane in plain.lanes.lanes]
    assert road.drivable.sum() == pytest.approx(
        plain.drivable.sum(), rel=0.01
    )  # cars have no more room than without
    of_all, beside = road.lanes.of_all, [lane for lane in road.lanes.others if not lane.junction]
    assert len(beside) == 2 * arms and len(road.lanes.others) == 2 * arms + ways
    ground = ground_for(road, BICYCLE)
    for lane in beside:
        arm, number = lane.id.split(".")
        (inner,) = (
            other
            for other in road.lanes.lanes
            if other.id == f"{arm}.{int(number) + (1 if number[0] == '-' else -1)}"
        )
        assert np.allclose(
            lane.left if side == "right" else lane.right,
            inner.right if side == "right" else inner.left,
        )
        assert np.hypot(*(lane.left - lane.right).T) == pytest.approx(1.8)
        assert ground.drivable_at(lane.centre[1:-1]).all()
        assert not road.drivable_at(lane.centre[2:-2]).any()
    for lane in road.lanes.others:
        assert lane.users == {"bicycle"} and ground.drivable_at(lane.centre[1:-1]).all()
        for k in lane.successors:
            assert np.allclose(
                (of_all[k].left[0], of_all[k].right[0]), (lane.left[-1], lane.right[-1])
            )
            assert of_all[k].users == {"bicycle"}


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("name", BUILT_IN)
def test_zebra_crossings_precede_stop_lines(name, side):
    config = RoadConfig(crossing="zebra", traffic_side=side, priority="all_way_stop")
    road = build_road(name, None, config)
    walks = road.lanes.others
    arms = len(road.lanes.arms) if road.lanes.arms else 1
    assert len(walks) == (1 if name in ("straight", "curve") else arms)
    assert all(lane.crossing for lane in walks)
    for lane in walks:
        assert road.drivable_at(lane.centre[:1] + 0.05 * (lane.centre[-1] - lane.centre[0])).all()
        beyond = lane.centre[[0, -1]] + np.array([[-0.05], [0.05]]) * (
            lane.centre[-1] - lane.centre[0]
        )
        assert not road.drivable_at(beyond).any()
        assert np.hypot(*(lane.left - lane.right)[0]) == pytest.approx(4.0, rel=0.02)
    for rule in road.lanes.rules:
        lane, line = road.lanes.lanes[rule.lanes[0]], rule.line.mean(axis=0)
        walk = min(walks, key=lambda one: np.hypot(*(one.centre.mean(axis=0) - line)))
        ahead = lane.centre[-1] - lane.centre[-2]
        assert ((walk.outline - line) @ ahead > 0.0).all()  # who stops does so before it


def test_roads_without_cycle_lanes_refuse_them():
    for name in ("merge", "roundabout"):
        with pytest.raises(
            RefusedError, match=f"road {name} has no cycle lanes; unset road.cycle_lane"
        ):
            build_road(name, None, RoadConfig(cycle_lane=1.5))
    with pytest.raises(InputError, match=r"road\.cycle_lane 0\.5 m; choose 0 or at least 1 m"):
        RoadConfig(cycle_lane=0.5)


def test_junction_ends_near_its_corners():
    (encounter,) = read_log(bundled("all_way_stop")).encounters
    network = build_road("four_way", encounter).lanes
    for lane in network.lanes:
        length = np.hypot(*np.diff(lane.centre, axis=0).T).sum()
        assert length < 25.0 if lane.junction else length > 50.0
