# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The formats' own libraries as judges, on made maps and real ones: the grid against their polygons, lanes against routing."""

import itertools
import re

import numpy as np
import pytest
from shapely import contains_xy
from shapely.geometry import Polygon
from shapely.ops import unary_union
from support import map_builders

from scenario_gen.logs.geodesy import geodetic
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
    inside = contains_xy(area.buffer(-reach), x, y)
    outside = ~contains_xy(area.buffer(reach), x, y)
    assert inside.sum() > 1000 and outside.sum() > 1000
    assert road.drivable[inside].all()
    assert not road.drivable[outside].any()


def recorded(*names):
    """Maps of the recorded data as parameters of `map_file`."""
    return [pytest.param(name, marks=pytest.mark.recorded) for name in names]


@pytest.fixture(scope="module")
def map_file(request, tmp_path_factory):
    """A map: made here, or recorded."""
    if request.param not in MADE:
        return request.getfixturevalue("data") / "maps" / request.param
    path = tmp_path_factory.mktemp("map") / request.param
    path.write_text(MADE[request.param]())
    return path


def in_degrees(x, y):
    """The attributes of a Lanelet2 node."""
    latitude, longitude = geodetic(np.array([x, y]), (48.2, 11.6))
    return f'lat="{float(latitude)!r}" lon="{float(longitude)!r}">'


def two_lanes():
    """A road of two lanes with a dashed line between them that both share, each in two parts."""
    nodes, ways, relations = "", "", ""
    for row, part in itertools.product(range(3), range(3)):
        nodes += f'<node id="{1 + 3 * row + part}" {in_degrees(60.0 * part, 3.5 * row)}</node>'
    for row, part in itertools.product(range(3), range(2)):
        refs = "".join(f'<nd ref="{1 + 3 * row + part + k}"/>' for k in range(2))
        kind = "dashed" if row == 1 else "solid"
        tags = f'<tag k="type" v="line_thin"/><tag k="subtype" v="{kind}"/>'
        ways += f'<way id="{100 + 2 * row + part}">{refs}{tags}</way>'
    facts = {"type": "lanelet", "subtype": "road", "location": "urban", "one_way": "yes"}
    tags = "".join(f'<tag k="{key}" v="{value}"/>' for key, value in facts.items())
    for lane, part in itertools.product(range(2), range(2)):
        members = "".join(
            f'<member type="way" ref="{100 + 2 * row + part}" role="{role}"/>'
            for row, role in ((lane + 1, "left"), (lane, "right"))
        )
        limit = '<tag k="speed_limit" v="50"/>'
        relations += f'<relation id="{200 + 2 * lane + part}">{members}{tags}{limit}</relation>'
    return f'<?xml version="1.0"?><osm version="0.6">{nodes}{ways}{relations}</osm>'


MADE = {
    "crossroads.xml": map_builders.commonroad,
    "crossroads.osm": lambda: map_builders.lanelet2(in_degrees),
    "two_lanes.osm": two_lanes,
    "crossroads.xodr": map_builders.opendrive,
}
LANELET2 = ("kashiwanoha", "mapping_example", "simple_cross_map")
lanelet2_maps = pytest.mark.parametrize(
    "map_file",
    ["crossroads.osm", "two_lanes.osm", *recorded(*(f"lanelet2/{name}.osm" for name in LANELET2))],
    indirect=True,
    scope="module",
)


@pytest.fixture(scope="module")
def lanelet2_map(map_file):
    """Our network; the library's map, its lanelets for cars and its routing graph, in the same frame."""
    path = map_file
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


@lanelet2_maps
def test_lanes_are_those_of_routing_graph(lanelet2_map):
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


@lanelet2_maps
def test_grid_is_that_of_library_polygons(lanelet2_map):
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


OPENDRIVE = (
    "fabriksgatan",
    "multi_lane_3way_intersection",
    "simple_4way_intersection",
    "jolengatan",
)


@pytest.mark.parametrize(
    "map_file",
    ["crossroads.xodr", *recorded(*(f"opendrive/{name}.xodr" for name in OPENDRIVE))],
    indirect=True,
)
def test_grid_is_that_of_pyxodr_lanes(map_file):
    network_module = pytest.importorskip(
        "pyxodr.road_objects.network", reason="pyxodr is not installed"
    )
    network = read_network(map_file)
    polygons, count = [], 0
    for road in network_module.RoadNetwork(str(map_file), resolution=0.5).get_roads():
        for section in road.lane_sections:
            for lane in section.lanes:
                if lane.type == "driving" and lane.id != 0:
                    count += 1
                    outer, inner = lane.boundary_line[:, :2], lane.lane_reference_line[:, :2]
                    polygons.append(Polygon(np.concatenate((outer, inner[::-1]))).buffer(0))
    assert count >= len(network.lanes) > 0
    resolution = 0.5 if map_file.stem == "jolengatan" else 0.2
    grid_agrees(
        road_of(network, None, RoadConfig(resolution=resolution)),
        unary_union(polygons).buffer(0.02),
    )


COMMONROAD = ("USA_Lanker-2_13_T-1", "USA_Peach-4_2_T-1")


@pytest.mark.parametrize(
    "map_file",
    ["crossroads.xml", *recorded(*(f"commonroad/{name}.xml" for name in COMMONROAD))],
    indirect=True,
)
def test_grid_is_that_of_commonroad_lanelets(map_file):
    """Their bounds, read by the standard library's parser."""
    from xml.etree import ElementTree

    root = ElementTree.parse(map_file).getroot()
    lanelets = {one.get("id"): one for one in root.findall("lanelet")}
    polygons = []
    for one in lanelets.values():
        left, right = (
            [(float(p.find("x").text), float(p.find("y").text)) for p in one.find(tag)]
            for tag in ("leftBound", "rightBound")
        )
        polygons.append(Polygon([*left, *right[::-1]]).buffer(0))
    network = read_network(map_file)
    followed = {ref.get("ref") for one in lanelets.values() for ref in one.findall("successor")}
    assert {network.lanes[k].id for k in network.entries} == set(lanelets) - followed
    assert {network.lanes[k].id for k in network.exits} == {
        name for name, one in lanelets.items() if one.find("successor") is None
    }
    grid_agrees(road_of(network, None, RoadConfig()), unary_union(polygons))
