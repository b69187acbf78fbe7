# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Who may use which lanes of maps, in all three formats; who drives is placed where its type may, and held to that."""

import numpy as np
import pytest
from support.map_builders import commonroad, lanelet2, write
from support.motions import encounter_of
from test_reported_maps import lane, read, road, section

from scenario_gen.base.errors import RefusedError
from scenario_gen.roads import (
    build_road,
    find_places,
    ground_for,
    lane_graph,
    read_network,
    RoadConfig,
    users_of,
)
from scenario_gen.roads.obstacles import read_obstacles, with_obstacles
from scenario_gen.situation import clean_tracks
from scenario_gen.types import NoteKind, Vehicle, VEHICLE_TYPES

DRIVE = "bicycle,bus,car,motorcycle,truck,van"


def users(network):
    """Return {lane: its users} of all lanes that are not for all that drive."""
    return {one.id: ",".join(sorted(one.users)) for one in network.whole.lanes if one.users}


@pytest.mark.parametrize(
    ("tags", "own"),
    [
        ({"subtype": "bicycle_lane"}, "bicycle"),
        ({"subtype": "bus_lane"}, "bus"),
        ({"subtype": "walkway"}, "pedestrian"),
        ({"subtype": "shared_walkway"}, "bicycle,pedestrian"),
        ({"subtype": "highway"}, "bus,car,motorcycle,truck,van"),
        ({"subtype": "road", "participant:vehicle": "yes"}, ""),
        (
            {"subtype": "road", "participant:vehicle": "yes", "participant:bicycle": "no"},
            "bus,car,motorcycle,truck,van",
        ),
        ({"subtype": "walkway", "participant:bicycle": "yes"}, "bicycle"),
        (
            {"subtype": "road", "participant:vehicle:truck": "no", "participant:vehicle": "yes"},
            "bicycle,bus,car,motorcycle,van",
        ),
    ],
)
def test_lanelet_tags_name_users(tmp_path, tags, own):
    text = "".join(f'<tag k="{key}" v="{value}"/>' for key, value in tags.items())
    network = read_network(
        write(tmp_path, ".osm", lanelet2().replace('<tag k="subtype" v="road"/>', text, 1))
    )
    assert users(network) == ({"2000": own} if own else {})
    assert ("2000" in [one.id for one in network.lanes]) == ("car" in own or not own)


def test_ways_of_people_change_no_roads(tmp_path):
    def known(subtype):
        text = lanelet2().replace(
            '<tag k="subtype" v="road"/>', f'<tag k="subtype" v="{subtype}"/>', 1
        )
        return read_network(write(tmp_path, ".osm", text))

    walk, plain = known("crosswalk"), known("rail")
    assert [(one.id, one.left.tolist(), one.junction) for one in walk.lanes] == [
        (one.id, one.left.tolist(), one.junction) for one in plain.lanes
    ]
    assert walk.others[0].crossing and walk.others[0].junction == ""


@pytest.mark.parametrize(
    ("inner", "own"),
    [
        ("<laneletType>bicycleLane</laneletType>", {"100": "bicycle"}),
        (
            "<laneletType>crosswalk</laneletType><userBidirectional>pedestrian</userBidirectional>",
            {"100": "pedestrian"},
        ),
        ("<laneletType>urban</laneletType><userOneWay>bus</userOneWay>", {"100": "bus"}),
        ("<laneletType>urban</laneletType><userOneWay>car</userOneWay>", {}),
        (
            "<laneletType>urban</laneletType><userOneWay>car</userOneWay><userOneWay>bus</userOneWay>",
            {"100": "bus,car,van"},
        ),
        (
            "<laneletType>interstate</laneletType><userOneWay>vehicle</userOneWay>",
            {"100": "bus,car,motorcycle,truck,van"},
        ),
        (
            "<laneletType>urban</laneletType><userOneWay>vehicle</userOneWay><userBidirectional>bicycle</userBidirectional>",
            {"100r": "bicycle"},
        ),
        ("<laneletType>restricted</laneletType>", {}),
    ],
)
def test_types_and_users_of_commonroad_lanelets(tmp_path, inner, own):
    text = commonroad().replace("<laneletType>urban</laneletType>", inner, 1)
    network = read_network(write(tmp_path, ".xml", text))
    assert users(network) == own
    lanes = {one.id: one for one in network.whole.lanes}
    assert all(np.allclose(lanes[k].centre, lanes["100"].centre[::-1]) for k in own if k == "100r")
    assert any(note.kind is NoteKind.UNUSED_LANES for note in network.notes) == (
        "restricted" in inner
    )


@pytest.mark.parametrize(
    ("kind", "access", "own"),
    [
        ("biking", "", "bicycle"),
        ("bus", "", "bus"),
        ("sidewalk", "", "pedestrian"),
        ("shared", "", "bicycle,pedestrian"),
        ("onRamp", "", "bus,car,motorcycle,truck,van"),
        ("driving", '<access rule="allow" restriction="bus"/>', "bus"),
        (
            "driving",
            '<access rule="deny" restriction="trucks"/>',
            "bicycle,bus,car,motorcycle,van",
        ),
        (
            "driving",
            '<access rule="deny"><restriction type="passengerCar"/></access>',
            "bicycle,bus,motorcycle,truck",
        ),
        ("driving", '<access rule="deny" restriction="none"/>', ""),
        (
            "driving",
            '<access rule="allow" restriction="bus"/><access rule="allow" restriction="passengerCar"/>',
            "bus,car,van",
        ),
        ("driving", '<access rule="allow" restriction="emergency"/>', None),
        ("shoulder", "", None),
    ],
)
def test_types_and_access_of_opendrive_lanes(tmp_path, kind, access, own):
    network = read(tmp_path, road(section(right=lane(-1) + lane(-2, kind, more=access))))
    assert users(network) == ({"1.0.-2": own} if own else {})
    assert any(note.kind is NoteKind.OTHER_LANES for note in network.notes) == bool(
        own and "car" not in own.split(",")
    )
    assert len(network.whole.lanes) == (1 if own is None else 2)


def beside(kind):
    """A car, and another road user that drives beside it on its right."""
    time = np.arange(80) * 0.1
    position = np.stack(
        [
            np.column_stack((x + 5.0 * time, np.full(80, y)))
            for x, y in ((10.0, -1.75), (14.0, -5.25))
        ]
    )
    size = VEHICLE_TYPES[kind]
    vehicles = (Vehicle("a", 4.5, 1.8), Vehicle("b", size.length, size.width, kind))
    return encounter_of(position, 0.0, 5.0, vehicles)


def street(tmp_path, kind, access=""):
    """A lane, one of another kind to its right, and a third as the first one."""
    read(tmp_path, road(section(right=lane(-1) + lane(-2, kind, more=access) + lane(-3))))
    return str(tmp_path / "crossroads.xodr")


@pytest.mark.parametrize(
    ("kind", "lanes", "placed"),
    [
        ("bus", "bus", "-2"),
        ("truck", "bus", "-3"),
        ("car", "bus", "-3"),
        ("bicycle", "biking", "-2"),
        ("car", "biking", "-3"),
    ],
)
def test_drivers_are_placed_on_permitted_lanes(tmp_path, kind, lanes, placed):
    encounter = beside(kind)
    built = build_road(street(tmp_path, lanes) + "#box=0,-12,100,2", encounter)
    tracks = clean_tracks(encounter)
    graph = lane_graph(built.lanes, users_of(tracks))
    match = next(find_places(graph, tracks)).match
    assert [[graph.network.lanes[k].id for k in path.lanes] for path in match.paths] == [
        ["1.0.-1"],
        [f"1.0.{placed}"],
    ]
    ground, there = ground_for(built, encounter.vehicles[1]), np.array([50.0, -5.25])
    assert ground.drivable_at(there) == (placed == "-2") and not built.drivable_at(there)
    assert (ground is built) == (placed == "-3")


def test_obstacle_on_cycle_lane_blocks_bicycles(tmp_path):
    built = build_road(street(tmp_path, "biking"), None, RoadConfig(obstacles="50 -5.25 0 2 1"))
    assert not ground_for(built, Vehicle("b", 1.8, 0.65, "bicycle")).drivable_at(
        np.array([50.0, -5.25])
    )
    plain = build_road(street(tmp_path, "biking"))
    assert with_obstacles(
        plain, read_obstacles("50 -5.25 0 2 1"), plain.cells_in(plain.lanes.others)
    ).obstructed.any()


def test_user_without_lanes_is_refused(tmp_path):
    denied = '<access rule="deny" restriction="bicycle"/>'
    read(tmp_path, road(section(right=lane(-1, more=denied))))
    built = build_road(str(tmp_path / "crossroads.xodr"))
    with pytest.raises(
        RefusedError,
        match="all lanes of road crossroads are closed to a bicycle; choose another road",
    ):
        ground_for(built, Vehicle("b", 1.8, 0.65, "bicycle"))
