# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Lanes: those of a built-in road cover its drivable cells and no more."""

from dataclasses import replace

import numpy as np
import pytest
from shapely import box, coverage_union_all, make_valid, Polygon, union_all
from support.small_scenarios import case_of, moving

from scenario_gen.output.exchange.commonroad import write_commonroad
from scenario_gen.output.exchange.config import ExportConfig
from scenario_gen.output.exchange.lanes import LaneMap
from scenario_gen.output.exchange.opendrive import write_opendrive
from scenario_gen.output.exchange.scenarionet import description
from scenario_gen.roads import read_network, RoadConfig
from scenario_gen.roads.build import build_road
from scenario_gen.types.lanes import DRIVERS, LaneNetwork
from scenario_gen.types.lanes import Lane as VectorLane


def area_of(lanes):
    return union_all([make_valid(Polygon(lane.outline)) for lane in lanes])


def lanes_on(name, config, run_out=1.0):
    road = build_road(name, None, config)
    lane_map = LaneMap.of(road, run_out)
    assert lane_map.side == config.traffic_side
    return road, lane_map


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("name", ["straight", "t_intersection", "four_way", "merge", "roundabout"])
def test_true_lanes_fill_the_road(name, side):
    road, lane_map = lanes_on(name, RoadConfig(lanes=2, traffic_side=side), 0.0)
    lanes = lane_map.network.lanes
    rows, columns = np.nonzero(road.drivable)
    low = road.origin + road.resolution * np.column_stack((columns, rows))
    cells = coverage_union_all(box(*low.T, *(low + road.resolution).T))
    area = area_of(lanes)
    assert area.difference(cells.buffer(2.0 * road.resolution)).area < 0.1  # m²
    arms = area_of([lane for lane in lanes if not lane.junction])
    assert arms.area > (0.4 if name == "roundabout" else 0.7) * cells.area
    assert (
        cells.difference(area_of(lanes)).area
        < (0.1 if name == "roundabout" else 0.04) * cells.area
    )  # a wider ring


@pytest.mark.parametrize("name", ["t_intersection", "four_way", "merge", "roundabout"])
@pytest.mark.parametrize("side", ["right", "left"])
def test_lanes_lead_from_entries_to_exits(name, side):
    road, lane_map = lanes_on(name, RoadConfig(lanes=2, traffic_side=side))
    lanes = lane_map.network.lanes
    starts, ends = (
        [lanes[k] for k in which] for which in (lane_map.network.entries, lane_map.network.exits)
    )
    for poses, which, at in ((road.entries, starts, 0), (road.exits, ends, -1)):
        assert len(which) == len(poses)
        for x, y, yaw in poses:
            ahead = np.array([np.cos(yaw), np.sin(yaw)])
            place = np.array([x, y]) + (1.0 if at else -1.0) * ahead  # arms go on by a metre
            lane = min(which, key=lambda one: np.hypot(*(one.centre[at] - place)))
            assert np.hypot(*(lane.centre[at] - place)) < road.resolution
            step = lane.centre[at + 1 if at == 0 else at] - lane.centre[at if at == 0 else at - 1]
            assert step @ ahead > 0.99 * np.hypot(*step)
    lanes_each = 1 if name == "roundabout" else 2
    arms = len(road.exits) // lanes_each
    more = {"merge": 1, "roundabout": arms}.get(
        name, 0
    )  # the ramp leads to the outermost lane; one may turn back
    ways = lanes_each * arms * (arms - 1) + more
    assert sum(bool(lane_map.turn(k)) for k in range(len(lanes))) == ways
    for k, lane in enumerate(lanes):
        for other in lane.successors:
            assert np.allclose(lane.left[-1], lanes[other].left[0], atol=1e-4)
            assert np.allclose(lane.right[-1], lanes[other].right[0], atol=1e-4)
        if "left" in lane_map.neighbours(k):
            other, same = lane_map.neighbours(k)["left"]
            assert np.array_equal(
                lane.left, lanes[other].right if same else lanes[other].left[::-1]
            )
        (ax, ay), (bx, by) = lane.right[0] - lane.left[0], lane.centre[1] - lane.centre[0]
        assert ax * by - ay * bx > 0.0  # left is left


def test_vector_map_lanes_are_written():
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
    made = LaneMap.of(road, 5.0)
    assert made.origin == "the lanes of map town" and made.network.lanes == own
    assert made.neighbours(0) == {"left": (1, True)} and made.neighbours(1) == {"right": (0, True)}


STANDING = moving([[5.0, 5.0, 0.0, 0.0, 0.0, 0.0], [15.0, 5.0, 0.0, 0.0, 0.0, 0.0]])


def written(tmp_path, lane_map, ending):
    """Return the lanes of what is written of a lane map, as they are read again."""
    path = tmp_path / f"again.{ending}"
    case = case_of(STANDING, lane_map=lane_map)
    path.write_bytes(
        write_opendrive(lane_map, "t", 0) if ending == "xodr" else write_commonroad(*case)[0]
    )
    return read_network(path)


@pytest.mark.parametrize("ending", ["xodr", "xml"])
@pytest.mark.parametrize(("name", "side"), [("straight", "left"), ("four_way", "right")])
def test_cycle_lanes_and_crossings_are_reread(tmp_path, name, side, ending):
    config = RoadConfig(cycle_lane=1.8, crossing="zebra", traffic_side=side)
    road, lane_map = lanes_on(name, config)
    again = written(tmp_path, lane_map, ending)
    for users, crossing in (({"bicycle"}, False), ({"pedestrian"}, True)):
        own, read = (
            [x for x in y if x.users == users and x.crossing == crossing]
            for y in (lane_map.network.lanes, again.others)
        )
        assert (
            len(own) == len(read) > 0
            and area_of(own).symmetric_difference(area_of(read)).area < 0.02
        )
        assert sum(len(lane.successors) for lane in own) == sum(
            len(lane.successors) for lane in read
        )
    assert len(again.lanes) == len(road.lanes.lanes) and again.traffic_side == side


def test_scenarionet_names_cycle_lanes_and_crossings():
    _, lane_map = lanes_on("four_way", RoadConfig(cycle_lane=1.8, crossing="zebra"))
    features = description(*case_of(STANDING, lane_map=lane_map), ExportConfig())[
        "map_features"
    ].values()
    kinds = [feature["type"] for feature in features]
    assert {kind: kinds.count(kind) for kind in kinds} == {
        "LANE_SURFACE_STREET": 20,
        "LANE_BIKE_LANE": 20,
        "CROSSWALK": 4,
    }
    assert sum(lane.open_to(DRIVERS) for lane in lane_map.network.lanes) == 40
