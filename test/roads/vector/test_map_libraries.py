# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The formats' own libraries as judges, on made maps and real ones: the grid against their polygons, lanes against routing."""

import re

import numpy as np
import pytest
from shapely import contains_xy
from shapely.geometry import Polygon
from shapely.ops import unary_union

from scenario_gen.roads import RoadConfig
from scenario_gen.roads.vector.ground import road_of
from scenario_gen.roads.vector.read import read_network

lanelet2 = pytest.importorskip(
    "lanelet2", reason="lanelet2 is not installed: it has wheels for Python 3.11 to 3.13 on Linux"
)


def grid_agrees(road, area):
    """Hold a grid against an area: all free inside, none outside, away from borders by more than one cell."""
    rows, columns = np.indices(road.drivable.shape)
    x, y = (
        road.origin[axis] + (index + 0.5) * road.resolution
        for axis, index in ((0, columns), (1, rows))
    )
    reach = road.resolution * np.sqrt(2.0)
    inside, outside = (
        contains_xy(area.buffer(-reach), x, y),
        ~contains_xy(area.buffer(reach), x, y),
    )
    assert inside.sum() > 1000 and outside.sum() > 1000
    assert road.drivable[inside].all()
    assert not road.drivable[outside].any()


@pytest.fixture(scope="module", params=["kashiwanoha", "mapping_example", "simple_cross_map"])
def lanelet2_map(request, data):
    """Our network; the library's map, its lanelets for cars and its routing graph, in the same frame."""
    path = data / "maps" / "lanelet2" / f"{request.param}.osm"
    network = read_network(path)
    stated = re.search(r"north of (-?[0-9.]+), (-?[0-9.]+)", str(network.notes[0]))
    origin = (
        (float(stated[1]), float(stated[2])) if stated else (0.666, -0.559)
    )  # where simple_cross_map's degrees lie
    projector = lanelet2.projection.LocalCartesianProjector(lanelet2.io.Origin(*origin))
    library, _ = lanelet2.io.loadRobust(str(path), projector)
    rules = lanelet2.traffic_rules.create(
        lanelet2.traffic_rules.Locations.Germany, lanelet2.traffic_rules.Participants.Vehicle
    )
    cars = {str(one.id): one for one in library.laneletLayer if rules.canPass(one)}
    return network, library, cars, lanelet2.routing.RoutingGraph(library, rules), rules


def test_lanes_for_cars_their_order_and_limits_are_those_of_the_routing_graph(lanelet2_map):
    network, _, cars, graph, rules = lanelet2_map
    own = {lane.id: lane for lane in network.lanes if lane.id in cars}
    assert set(own) == set(cars)
    names = [lane.id.removesuffix("r") for lane in network.lanes]
    for name, one in cars.items():
        assert {names[k] for k in own[name].successors} == {
            str(other.id) for other in graph.following(one)
        }, name
        beside = [other for other in (graph.left(one), graph.right(one)) if other]
        assert {names[k] for k in own[name].neighbours} == {str(other.id) for other in beside}, (
            name
        )
        assert own[name].speed_limit * 3.6 == pytest.approx(
            float(str(rules.speedLimit(one).speedLimit).split()[0])
        ), name
    entries = {network.lanes[k].id for k in network.entries} & set(cars)
    exits = {network.lanes[k].id for k in network.exits} & set(cars)
    assert entries == {name for name, one in cars.items() if not graph.previous(one)}
    assert exits == {name for name, one in cars.items() if not graph.following(one)}


def test_the_grid_is_that_of_the_library_s_polygons(lanelet2_map):
    network, _, cars, _, _ = lanelet2_map
    tagged = all("local_x" in point.attributes for one in cars.values() for point in one.leftBound)

    def xy(point):
        return (
            (float(point.attributes["local_x"]), float(point.attributes["local_y"]))
            if tagged
            else (point.x, point.y)
        )

    polygons = [
        Polygon([xy(p) for p in one.leftBound] + [xy(p) for p in one.rightBound][::-1]).buffer(0)
        for one in cars.values()
    ]
    resolution = 1.0 if len(network.lanes) > 200 else 0.2
    grid_agrees(road_of(network, None, RoadConfig(resolution=resolution)), unary_union(polygons))


@pytest.mark.parametrize(
    "name",
    ["fabriksgatan", "multi_lane_3way_intersection", "simple_4way_intersection", "jolengatan"],
)
def test_the_grid_is_that_of_pyxodr_s_lanes(data, name):
    network_module = pytest.importorskip(
        "pyxodr.road_objects.network", reason="pyxodr is not installed"
    )
    path = data / "maps" / "opendrive" / f"{name}.xodr"
    network = read_network(path)
    polygons, count = [], 0
    for road in network_module.RoadNetwork(str(path), resolution=0.5).get_roads():
        for section in road.lane_sections:
            for lane in section.lanes:
                if lane.type == "driving" and lane.id != 0:
                    count += 1
                    outer, inner = lane.boundary_line[:, :2], lane.lane_reference_line[:, :2]
                    polygons.append(Polygon(np.concatenate((outer, inner[::-1]))).buffer(0))
    assert count >= len(network.lanes) > 0
    resolution = 0.5 if name == "jolengatan" else 0.2
    grid_agrees(
        road_of(network, None, RoadConfig(resolution=resolution)),
        unary_union(polygons).buffer(0.02),
    )


@pytest.mark.parametrize("name", ["USA_Lanker-2_13_T-1", "USA_Peach-4_2_T-1"])
def test_the_grid_is_that_of_commonroad_s_lanelets(data, name):
    """Their bounds, read by the standard library's parser."""
    from xml.etree import ElementTree

    path = data / "maps" / "commonroad" / f"{name}.xml"
    root = ElementTree.parse(path).getroot()
    lanelets = {one.get("id"): one for one in root.findall("lanelet")}
    polygons = []
    for one in lanelets.values():
        left, right = (
            [(float(p.find("x").text), float(p.find("y").text)) for p in one.find(tag)]
            for tag in ("leftBound", "rightBound")
        )
        polygons.append(Polygon([*left, *right[::-1]]).buffer(0))
    network = read_network(path)
    followed = {ref.get("ref") for one in lanelets.values() for ref in one.findall("successor")}
    assert {network.lanes[k].id for k in network.entries} == set(lanelets) - followed
    assert {network.lanes[k].id for k in network.exits} == {
        name for name, one in lanelets.items() if one.find("successor") is None
    }
    grid_agrees(road_of(network, None, RoadConfig()), unary_union(polygons))
