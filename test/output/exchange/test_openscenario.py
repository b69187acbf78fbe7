# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""OpenSCENARIO and OpenDRIVE: references, reference points and edges, which no schema sees; the road's geometry; and back."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest
from support.small_scenarios import case_of, crossing, one_vehicle

from scenario_gen.output.exchange.config import ExportConfig
from scenario_gen.output.exchange.lanes import LaneMap
from scenario_gen.output.exchange.opendrive import write_opendrive
from scenario_gen.output.exchange.openscenario import write_openscenario
from scenario_gen.roads import read_network, RoadConfig
from scenario_gen.roads.build import build_road
from scenario_gen.types import Lane, LaneNetwork, RuleKind, TrafficRule


def written(scenario, ego=None, export=ExportConfig()):
    data = write_openscenario(*case_of(scenario, ego), "road.xodr", export)
    assert data == write_openscenario(*case_of(scenario, ego), "road.xodr", export)
    return data, ET.fromstring(data)


def test_references_lead_somewhere():
    _, root = written(crossing(present=[[0, 60], [9, 44]]), one_vehicle())
    header = root.find("FileHeader").attrib
    assert (header["revMajor"], header["revMinor"], header["date"]) == (
        "1",
        "2",
        "2026-01-01T00:00:00",
    )
    assert root.find("RoadNetwork/LogicFile").attrib["filepath"] == "road.xodr"
    names = {entity.attrib["name"] for entity in root.iter("ScenarioObject")}
    assert names == {"vehicle_1", "vehicle_2", "Ego"}
    assert {
        element.attrib["entityRef"] for element in root.iter() if "entityRef" in element.attrib
    } == names
    conditions = list(root.iter("Condition"))
    assert conditions and {condition.attrib["conditionEdge"] for condition in conditions} == {
        "none"
    }
    assert {float(condition.attrib["delay"]) for condition in conditions} == {0.0}


@pytest.mark.parametrize("mode", ["position", "follow"])
def test_vertices_are_the_rear_axle(mode):
    scenario = crossing()
    _, root = written(scenario, export=ExportConfig(following=mode))
    for n, follow in enumerate(root.iter("FollowTrajectoryAction")):
        assert follow.find("TrajectoryFollowingMode").attrib["followingMode"] == mode
        assert follow.find("TimeReference/Timing").attrib == {
            "domainAbsoluteRelative": "absolute",
            "scale": "1",
            "offset": "0",
        }
        center = (
            root.findall("Entities/ScenarioObject")[n].find("Vehicle/BoundingBox/Center").attrib
        )
        ahead = float(center["x"])
        assert (
            ahead == pytest.approx(0.3 * scenario.vehicles[n].length) and float(center["y"]) == 0.0
        )
        axles = root.findall("Entities/ScenarioObject")[n].find("Vehicle/Axles")
        assert float(axles.find("RearAxle").attrib["positionX"]) == 0.0
        for k, vertex in enumerate(follow.iter("Vertex")):
            world = {
                key: float(value)
                for key, value in vertex.find("Position/WorldPosition").attrib.items()
            }
            assert float(vertex.attrib["time"]) == pytest.approx(scenario.time[k], abs=1e-9)
            assert world["h"] == pytest.approx(scenario.heading[n, k], abs=1e-9)
            centre = (
                world["x"] + ahead * np.cos(world["h"]),
                world["y"] + ahead * np.sin(world["h"]),
            )
            assert np.allclose(centre, scenario.position[n, k], atol=1e-8)
    places = [
        private.find(".//TeleportAction/Position/WorldPosition").attrib
        for private in root.iter("Private")
    ]
    first = [
        follow.find(".//Vertex/Position/WorldPosition").attrib
        for follow in root.iter("FollowTrajectoryAction")
    ]
    assert places == first  # everybody starts where its trajectory does


def test_arrivals_and_departures_are_written():
    scenario = crossing(present=[[0, 60], [9, 44]])
    _, root = written(scenario)
    assert [private.attrib["entityRef"] for private in root.iter("Private")] == ["vehicle_1"]
    times = {
        condition.attrib["name"]: float(
            condition.find("ByValueCondition/SimulationTimeCondition").attrib["value"]
        )
        for condition in root.iter("Condition")
    }
    assert (
        times["vehicle_2_arrival"] == times["vehicle_2_start"] == 0.9
        and times["vehicle_2_departure"] == 4.4
    )
    assert root.find(".//EntityAction[@entityRef='vehicle_2']/AddEntityAction") is not None
    assert root.find(".//EntityAction[@entityRef='vehicle_2']/DeleteEntityAction") is not None


def test_ego_has_goal_without_trajectory():
    ego = one_vehicle()
    _, root = written(crossing(), ego)
    assert {ref.attrib["entityRef"] for ref in root.iter("EntityRef")} == {
        "vehicle_1",
        "vehicle_2",
    }
    (private,) = [one for one in root.iter("Private") if one.attrib["entityRef"] == "Ego"]
    goal = private.find(".//AcquirePositionAction/Position/WorldPosition").attrib
    back = 0.3 * ego.vehicles[0].length
    end = ego.position[0, -1] - back * np.array(
        [np.cos(ego.heading[0, -1]), np.sin(ego.heading[0, -1])]
    )
    assert np.allclose([float(goal["x"]), float(goal["y"])], end, atol=1e-8)


def along(geometry, s):
    """Return x, y, heading at s from the beginning of an OpenDRIVE geometry element, by the standard."""
    x, y, hdg, length = (float(geometry.attrib[name]) for name in ("x", "y", "hdg", "length"))
    poly = geometry.find("paramPoly3")
    if poly is None:
        u, v, turn = s, 0.0, 0.0
    else:
        c = {name: float(value) for name, value in poly.attrib.items() if name != "pRange"}
        p = s / length
        u, v = (c[f"a{w}"] + c[f"b{w}"] * p + c[f"c{w}"] * p**2 + c[f"d{w}"] * p**3 for w in "UV")
        du, dv = (c[f"b{w}"] + 2 * c[f"c{w}"] * p + 3 * c[f"d{w}"] * p**2 for w in "UV")
        turn = np.arctan2(dv, du)
    return x + u * np.cos(hdg) - v * np.sin(hdg), y + u * np.sin(hdg) + v * np.cos(hdg), hdg + turn


@pytest.mark.parametrize("side", ["right", "left"])
def test_road_network_is_smooth(side):
    config = RoadConfig(lanes=2, traffic_side=side)
    lane_map = LaneMap.of(build_road("t_intersection", None, config), 15.0)
    data = write_opendrive(lane_map, "t", 0)
    assert data == write_opendrive(lane_map, "t", 0)
    root = ET.fromstring(data)
    roads = {road.attrib["id"]: road for road in root.iter("road")}
    assert {road.attrib["rule"] for road in roads.values()} == {
        "RHT" if side == "right" else "LHT"
    }
    edges = {}
    for road in roads.values():
        s, end = 0.0, None
        for geometry in road.iter("geometry"):
            assert float(geometry.attrib["s"]) == pytest.approx(s, abs=1e-6)
            start = along(geometry, 0.0)
            if end is not None:
                assert np.allclose(start[:2], end[:2], atol=1e-6)
                assert abs(np.angle(np.exp(1j * (start[2] - end[2])))) < 1e-6  # no kink
            length = float(geometry.attrib["length"])
            points = np.array([along(geometry, s)[:2] for s in np.linspace(0.0, length, 200)])
            assert np.hypot(*np.diff(points, axis=0).T).sum() == pytest.approx(length, rel=1e-4)
            end = along(geometry, length)
            s += length
        assert float(road.attrib["length"]) == pytest.approx(s, abs=1e-6)
        edges[road.attrib["id"]] = end
        for link in road.findall("link/*"):
            assert (
                link.attrib["elementId"] in roads if link.attrib["elementType"] == "road" else True
            )
    junction = root.find("junction")
    for connection in junction.iter("connection"):
        lanes = {
            lane.attrib["id"] for lane in roads[connection.attrib["connectingRoad"]].iter("lane")
        }
        arms = {
            lane.attrib["id"] for lane in roads[connection.attrib["incomingRoad"]].iter("lane")
        }
        links = connection.findall("laneLink")
        assert len(links) == 1 and all(
            one.attrib["to"] in lanes and one.attrib["from"] in arms for one in links
        )
    driving = [lane for lane in root.iter("lane") if lane.attrib["type"] == "driving"]
    assert len(driving) == len(lane_map.network.lanes)


def test_map_lanes_are_joined_again(tmp_path):
    def lane(name, begin, end, after=(), junction=""):
        borders = [np.linspace(begin, end, 12) + np.array([0.0, aside]) for aside in (1.75, -1.75)]
        return Lane(name, *borders, after, speed_limit=10.0, junction=junction)

    lanes = (
        lane("before", (0, 0), (50, 0), (1, 2)),
        lane("on", (50, 0), (80, 0), (3,), "J"),
        lane("off", (50, 0), (80, -20), (4,), "J"),
        lane("after", (80, 0), (120, 0), (5, 6)),
        lane("aside", (80, -20), (120, -20), (7,)),
        lane("fork left", (120, 0), (160, 4)),
        lane("fork right", (120, 0), (160, -4), (8,)),
        lane("longer", (120, -20), (160, -20)),
        lane("at the end", (160, -4), (200, -4)),
    )
    line = np.array([[48.0, 1.75], [48.0, -1.75]])
    network = LaneNetwork("town", lanes, rules=(TrafficRule("s", RuleKind.STOP, (0,), (), line),))
    path = tmp_path / "town.xodr"
    path.write_bytes(write_opendrive(LaneMap(network, "town"), "town", 0))
    again = read_network(path)
    assert [one.successors for one in again.lanes] == [one.successors for one in lanes]
    assert [bool(one.junction) for one in again.lanes] == [bool(one.junction) for one in lanes]
    assert all(
        np.allclose(a.centre[[0, -1]], b.centre[[0, -1]]) and a.speed_limit == 10.0
        for a, b in zip(again.lanes, lanes, strict=True)
    )
    (stop,) = again.rules
    assert (stop.kind, stop.lanes) == (RuleKind.STOP, (0,)) and np.abs(
        stop.line[:, 0] - 48.0
    ).max() < 0.1
