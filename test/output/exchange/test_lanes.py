# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Lanes: those of a built-in road cover its drivable cells and no more; derived ones hold every footprint."""

from dataclasses import replace

import numpy as np
import pytest
from shapely import box, coverage_union_all, Polygon, union_all
from small_scenarios import crossing, moving

from scenario_gen.output.exchange.derived_lanes import derived_lanes, footprints
from scenario_gen.output.exchange.lanes import lanes_of
from scenario_gen.output.exchange.road_lanes import lane_map_of, true_lanes
from scenario_gen.roads import RoadConfig
from scenario_gen.roads.build import build_road
from scenario_gen.types.lanes import Lane as VectorLane
from scenario_gen.types.lanes import LaneNetwork


def area_of(lanes):
    return union_all([Polygon(np.concatenate([lane.left, lane.right[::-1]])) for lane in lanes])


def lanes_on(name, config, run_out=1.0):
    road = build_road(name, None, config)
    lane_map = true_lanes(road, name, None, config, [], run_out)
    assert lane_map is not None and not lane_map.derived and not lane_map.added and lane_map.side == config.traffic_side
    return road, lanes_of(lane_map)


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("name", ["straight", "t_intersection", "four_way", "merge", "roundabout"])
def test_true_lanes_lie_on_the_road_and_fill_its_arms(name, side):
    road, lanes = lanes_on(name, RoadConfig(lanes=2, traffic_side=side), 0.0)
    rows, columns = np.nonzero(road.drivable)
    low = road.origin + road.resolution * np.column_stack((columns, rows))
    cells = coverage_union_all(box(*low.T, *(low + road.resolution).T))
    area = area_of(lanes)
    assert area.difference(cells.buffer(2.0 * road.resolution)).area < 0.1  # m²
    arms = area_of([lane for lane in lanes if not lane.turn])
    assert arms.area > (0.4 if name == "roundabout" else 0.7) * cells.area
    assert cells.difference(area_of(lanes)).area < (0.1 if name == "roundabout" else 0.04) * cells.area  # a wider ring


@pytest.mark.parametrize("name", ["t_intersection", "four_way", "merge", "roundabout"])
@pytest.mark.parametrize("side", ["right", "left"])
def test_lanes_lead_from_entries_to_exits_in_their_direction(name, side):
    road, lanes = lanes_on(name, RoadConfig(lanes=2, traffic_side=side))
    starts = [lane for lane in lanes if not lane.predecessors]
    ends = [lane for lane in lanes if not lane.successors]
    for poses, which, at in ((road.entries, starts, 0), (road.exits, ends, -1)):
        assert len(which) == len(poses)
        for x, y, yaw in poses:
            ahead = np.array([np.cos(yaw), np.sin(yaw)])
            place = np.array([x, y]) + (1.0 if at else -1.0) * ahead  # arms go on by a metre
            lane = min(which, key=lambda one: np.hypot(*(one.middle[at] - place)))
            assert np.hypot(*(lane.middle[at] - place)) < road.resolution
            step = lane.middle[at + 1 if at == 0 else at] - lane.middle[at if at == 0 else at - 1]
            assert step @ ahead > 0.99 * np.hypot(*step)
    by_id = {lane.id: lane for lane in lanes}
    lanes_each = 1 if name == "roundabout" else 2
    arms = len(road.exits) // lanes_each
    ways = lanes_each * arms * (arms - 1) + (1 if name == "merge" else 0)  # the ramp leads to the outermost lane
    assert sum(bool(lane.turn) for lane in lanes) == ways
    for lane in lanes:
        for other in lane.successors:
            assert np.allclose(lane.left[-1], by_id[other].left[0], atol=1e-4)
            assert np.allclose(lane.right[-1], by_id[other].right[0], atol=1e-4)
            assert lane.id in by_id[other].predecessors
        if lane.left_of is not None:
            other, same = by_id[lane.left_of[0]], lane.left_of[1]
            assert np.array_equal(lane.left, other.right if same else other.left[::-1])
        (ax, ay), (bx, by) = lane.right[0] - lane.left[0], lane.middle[1] - lane.middle[0]
        assert ax * by - ay * bx > 0.0  # left is left


def test_a_road_that_is_not_what_its_name_says_has_derived_lanes():
    config = RoadConfig()
    road = build_road("t_intersection", None, config)
    drivable = road.drivable.copy()
    drivable[tuple(np.argwhere(drivable)[0])] = False
    assert true_lanes(replace(road, drivable=drivable), "t_intersection", None, config, [], 0.0) is None
    assert true_lanes(road, "four_way", None, config, [], 0.0) is None
    made = lane_map_of(replace(road, drivable=drivable), "t_intersection", None, {}, [crossing()], 10.0)
    assert made.derived and "derived" in made.origin
    assert not lane_map_of(road, "", None, {}, [], 10.0).derived  # a nameless map of ours is known by its cells


@pytest.mark.parametrize("side", ["right", "left"])
def test_who_leaves_the_true_lanes_gets_a_lane_and_that_is_said(side):
    config = RoadConfig(traffic_side=side)
    road = build_road("straight", None, config)
    y = float(road.entries[0, 1])
    scenario = moving([[10.0, y, 0.0, 8.0, 0.0, 0.0], [10.0, y - 3.0 if side == "right" else y + 3.0, 0.0, 8.0, 0.0, 0.0]])
    lane_map = true_lanes(road, "straight", None, config, [scenario], 5.0)
    assert lane_map.added == 1 and "along the path of vehicle 2, which does not keep to them" in lane_map.origin
    area = area_of(lanes_of(lane_map))
    for n in range(2):
        assert all(area.covers(Polygon(corners)) for corners in footprints(scenario, n))


def test_a_vector_maps_own_lanes_are_written():
    config = RoadConfig()
    road = build_road("straight", None, config)
    y = float(road.entries[0, 1])
    x = np.linspace(-20.0, 200.0, 30)
    border = [np.column_stack((x, np.full(30, y + k * 3.5 - 1.75))) for k in range(3)]
    own = (
        VectorLane("a.1", border[1], border[0], (), (1,)),
        VectorLane("a.2", border[2], border[1], (2,), (0,), 8.0),
        VectorLane("a.3", border[2] + (220.0, 0.0), border[1] + (220.0, 0.0)),
    )
    road = replace(road, lanes=LaneNetwork("town", own))
    scenario = moving([[10.0, y, 0.0, 8.0, 0.0, 0.0], [40.0, y - 3.0, 0.0, 8.0, 0.0, 0.0]])
    made = lane_map_of(road, "town", None, {}, [scenario], 5.0)
    assert made.derived and made.network_origin.startswith(
        "the lanes of map town, and a derived one along the path of vehicle 2,"
    )
    assert [(lane.id, lane.derived, lane.successors, lane.predecessors) for lane in made.network] == [
        (1, False, (), ()),
        (2, False, (3,), ()),
        (3, False, (), (2,)),
        (4, True, (), ()),
    ]
    assert made.network[0].left_of == (2, True) and made.network[1].right_of == (1, True) and made.network[0].right_of is None
    assert np.array_equal(made.network[1].left, own[1].left)


def test_derived_lanes_hold_every_footprint_and_followers_share_one():
    rows = [[0.0, 0.0, 0.3, 8.0, 0.0, 0.05], [-15.0, -4.64, 0.3, 8.0, 0.0, 0.0], [60.0, 40.0, -2.0, 5.0, -1.2, 0.1]]
    scenarios = [moving(rows), moving([[x, y + 0.4, *rest] for x, y, *rest in rows])]
    lanes = lanes_of(derived_lanes(scenarios, None, 3.5, 20.0))
    area = area_of(lanes)
    for scenario in scenarios:
        for n, vehicle in enumerate(scenario.vehicles):
            for (x, y), yaw in zip(scenario.position[n], scenario.heading[n], strict=True):
                turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
                half = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * (vehicle.length / 2.0, vehicle.width / 2.0)
                assert area.covers(Polygon(half @ turn.T + (x, y)))
    assert all(lane.successors == () for lane in lanes)
    platoon = moving([[0.0, 0.0, 0.0, 8.0, 0.0, 0.0], [-12.0, 0.0, 0.0, 8.0, 0.0, 0.0]])
    assert len(lanes_of(derived_lanes([platoon], None, 3.5, 60.0))) == 1
