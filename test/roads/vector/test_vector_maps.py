# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Vector maps: the same crossroads in three formats is the same network, drawn as the same grid; parts of it; what is refused."""

from dataclasses import replace
import math

import numpy as np
import pytest
from support.map_builders import ARM, at, FORMATS, lanelet2, lanes, LIMIT, opendrive, write

from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.base.xml_reader import parse_xml
from scenario_gen.logs import geodesy, read_log
from scenario_gen.logs.synthetic import bundled
from scenario_gen.roads import build_road, RoadConfig
from scenario_gen.roads.vector.ground import along_lanes
from scenario_gen.roads.vector.network import crossing_lanes
from scenario_gen.roads.vector.plan_view import reference_line
from scenario_gen.roads.vector.read import read_network
from scenario_gen.types import Lane, LaneNetwork, NoteKind


def middles(network):
    """Return {begin and end of a lane, rounded: the lane}."""
    return {
        tuple(np.round(lane.centre[[0, -1]], 3).ravel().tolist()): lane for lane in network.lanes
    }


def wanted():
    found = {}
    for name, (left, right, after) in lanes().items():
        centre = (np.array(left) + np.array(right))[[0, -1]] / 2.0
        found[tuple((np.round(centre, 3) + 0.0).ravel().tolist())] = (name, after)
    return found


@pytest.mark.parametrize("suffix", FORMATS)
def test_crossroads_has_lanes_links_and_limits(tmp_path, suffix):
    network = read_network(write(tmp_path, suffix))
    assert len(network.lanes) == 20 and len(network.entries) == len(network.exits) == 4
    known, key_of = middles(network), {}
    for key, (name, _) in wanted().items():
        matches = [k for k in known if np.allclose(k, key, atol=2e-3)]
        assert len(matches) == 1, name
        key_of[name] = matches[0]
    for name, after in wanted().values():
        lane = known[key_of[name]]
        assert {id(network.lanes[k]) for k in lane.successors} == {
            id(known[key_of[other]]) for other in after
        }, name
        assert lane.speed_limit == pytest.approx(LIMIT / 3.6)
        assert bool(lane.junction) == (not name.endswith(("_in", "_out"))), name


@pytest.mark.parametrize("origin", [(48.5, 9.25), (-17.0, 180.0)])
def test_degrees_are_in_the_local_frame(tmp_path, origin):
    def place(x, y):
        latitude, longitude = geodesy.geodetic(np.array([x, y]), origin)
        return f'lat="{float(latitude)!r}" lon="{float(longitude)!r}">'

    network = read_network(write(tmp_path, ".osm", lanelet2(place)))
    assert np.allclose(network.box, [[-ARM, -ARM], [ARM, ARM]], atol=0.02)
    assert f"{origin[0]:.7f}, " in str(network.notes[0])


def test_lanelet_for_both_directions_is_two(tmp_path):
    both = lanelet2(tags="").replace('<tag k="one_way" v="yes"/>', '<tag k="one_way" v="no"/>', 1)
    assert len(read_network(write(tmp_path, ".osm", both)).lanes) == 21
    bus = lanelet2(tags='<tag k="participant:vehicle:bus" v="yes"/>')
    with pytest.raises(InputError, match="none of its 20 lanelets is for cars"):
        read_network(write(tmp_path, ".osm", bus))


def test_pose_in_a_lane_is_along(tmp_path):
    road = build_road(str(write(tmp_path, ".xodr")))
    x, y = at("w", -30.0, 1.75)
    poses = np.array(
        [[x, y, 0.0], [x, y, 0.9], [x, y, math.pi / 2.0], [x, y, math.pi], [x, 3.6, math.pi]]
    )
    assert along_lanes(road, poses).tolist() == [True, True, False, False, False]
    assert along_lanes(replace(road, lanes=None), poses).all()


@pytest.mark.parametrize("suffix", FORMATS)
def test_part_is_cut_at_its_box(tmp_path, suffix):
    path = write(tmp_path, suffix)
    road = build_road(f"{path}#box=-30,-20,0,20")
    assert road.drivable.shape == (200, 150)
    assert road.origin.tolist() == pytest.approx([-30.0, -20.0])
    assert len(road.entries) == 5
    assert {tuple(np.round(e, 1)) for e in road.entries} >= {(-30.0, -1.8, 0.0)}
    network = read_network(path)
    junction = next(lane.junction for lane in network.lanes if lane.junction)
    assert (
        build_road(f"{path}#junction={junction}").drivable.sum()
        == build_road(f"{path}#box=-48,-48,48,48").drivable.sum()
    )
    assert build_road(f"{path}#lanelet={network.lanes[0].id}").lanes.lanes


@pytest.mark.parametrize(
    ("part", "said"),
    [
        ("lanelet=nowhere", "has no lanelet 'nowhere'"),
        ("junction=77", "has no junction '77'"),
        ("box=1,2,3", "box=x0,y0,x1,y1 in metres is needed"),
        ("box=1,2,a,4", "is not a number"),
        ("box=1,2,nan,4", "is not a number"),
        ("box=500,500,600,600", "no lane in the box"),
        ("box=5,5,5,6", "less than 1 m wide"),
        ("lane=3", "choose one of #lanelet=…, #junction=…, #box=…"),
    ],
)
def test_missing_part_is_refused(tmp_path, part, said):
    with pytest.raises(InputError, match=said):
        build_road(f"{write(tmp_path, '.xml')}#{part}")


@pytest.mark.parametrize(
    "name", ["t_intersection#box=0,0,9,9", "depot.yaml#junction=1", "a.osm#box=0,0,9,9#lanelet=1"]
)
def test_part_of_other_roads_is_refused(name):
    with pytest.raises(InputError, match="only a vector map has parts, one behind one #"):
        build_road(name)


def test_map_too_large_to_draw_refused(tmp_path):
    with pytest.raises(RefusedError, match=r"road\.max_cells"):
        build_road(str(write(tmp_path, ".xodr")), None, RoadConfig(max_cells=1000))


BROKEN = [  # suffix, text
    (".osm", ""),
    (".osm", "<osm/>"),
    (".osm", "<OpenDRIVE/>"),
    (".xodr", "<osm/>"),
    (".xml", "<osm/>"),
    (".xml", "<commonRoad/>"),
    (".xodr", "<OpenDRIVE><header/></OpenDRIVE>"),
    (".osm", lanelet2(lambda x, y: ">")),
    (".osm", lanelet2(lambda x, y: f'lat="{91 + x}" lon="{y}">')),
    (".osm", lanelet2(lambda x, y: f'lat="{x / 10}" lon="{y / 10}">')),
    (".osm", lanelet2(lambda x, y: 'lat="1" lon="2">')),
]


ODD = [  # one odd element: suffix, what is written, what replaces it
    (".osm", '<tag k="local_x"', '<tag k="local_z"'),
    (".osm", '<nd ref="1"/>', '<nd ref="77777"/>'),
    (".osm", 'role="left"', 'role="middle"'),
    (".osm", 'v="60.0"', 'v="nan"'),
    (".osm", '<node id="2"', '<node id="1"'),
    (".xodr", 'curvature="0.125"', 'curvature="1e9"'),
    (".xodr", "<line/>", "<helix/>"),
    (".xodr", 'a="3.5"', 'a="inf"'),
    (".xodr", 'incomingRoad="0"', 'incomingRoad="99"'),
    (".xodr", '<lane id="1"', '<lane id="one"'),
    (".xodr", 'id="1" junction', 'id="0" junction'),
    (".xml", '<successor ref="102"/>', '<successor ref="9999"/>'),
    (".xml", "<x>-60.0</x>", "<x>west</x>"),
    (".xml", "leftBound", "left"),
    (".xml", "8.333333333333334", "fast"),
]


@pytest.mark.parametrize(("suffix", "old", "new"), ODD)
def test_odd_element_is_omitted_and_named(tmp_path, suffix, old, new):
    """As the formats' own libraries do, which open the rest."""
    text = FORMATS[suffix]()
    assert old in text
    whole = read_network(write(tmp_path, suffix, text))
    count = 2 if old == "leftBound" else 1  # both tags of it
    rest = read_network(write(tmp_path, suffix, text.replace(old, new, count)))
    faults = [
        [note for note in each.notes if note.kind is NoteKind.FAULTY] for each in (whole, rest)
    ]
    assert len(faults[1]) > len(faults[0])
    assert 0.5 * len(whole.lanes) <= len(rest.lanes) <= len(whole.lanes)


@pytest.mark.parametrize("unit", ["kmh", " km/h", "KMH"])
def test_speed_sign_may_have_a_unit(tmp_path, unit):
    """As converters of data sets write them."""
    network = read_network(
        write(tmp_path, ".xml", FORMATS[".xml"]().replace("8.333333333333334", f"50{unit}"))
    )
    assert [lane.speed_limit for lane in network.lanes] == pytest.approx(
        [50.0 / 3.6] * len(network.lanes)
    )


def test_requested_faulty_lanelet_is_refused(tmp_path):
    text = lanelet2().replace(
        "</relation>", '<member type="way" ref="1002" role="left"/></relation>', 1
    )
    path = write(tmp_path, ".osm", text)
    assert build_road(f"{path}#lanelet=2001").lanes is not None
    with pytest.raises(InputError, match=r"no lanelet '2000' .*2 members with role left"):
        build_road(f"{path}#lanelet=2000")


@pytest.mark.parametrize(("suffix", "text"), BROKEN, ids=range(len(BROKEN)))
def test_broken_map_is_refused_by_name(tmp_path, suffix, text):
    path = write(tmp_path, suffix, text)
    with pytest.raises(InputError, match=path.stem):
        build_road(str(path))


STACKED = (  # a ring of one lanelet over and over: each follows all
    '<osm><node id="1" lat="0" lon="0"/><node id="2" lat="0" lon="3e-5"/><node id="3" lat="1e-4" lon="0"/>'
    '<node id="4" lat="1e-4" lon="3e-5"/><way id="8"><nd ref="1"/><nd ref="3"/><nd ref="1"/></way>'
    '<way id="9"><nd ref="2"/><nd ref="4"/><nd ref="2"/></way>'
    + "".join(
        f'<relation id="{k}"><member type="way" role="left" ref="8"/><member type="way" role="right" ref="9"/>'
        '<tag k="type" v="lanelet"/></relation>'
        for k in range(150)
    )
    + "</osm>"
)


def across(count, length):
    """Return lanes of CommonRoad through one place in many directions."""
    text = ""
    for k in range(count):
        x, y = math.cos(k * math.pi / count), math.sin(k * math.pi / count)
        bounds = (
            f"<{tag}>"
            + "".join(
                f"<point><x>{a * x - b * y}</x><y>{a * y + b * x}</y></point>"
                for a in (-length, length)
            )
            + f"</{tag}>"
            for tag, b in (("leftBound", 1.0), ("rightBound", -1.0))
        )
        text += f'<lanelet id="{k}">{"".join(bounds)}</lanelet>'
    return f'<commonRoad commonRoadVersion="2020a">{text}</commonRoad>'


@pytest.mark.parametrize(
    ("suffix", "text", "limit", "most"),
    [
        (".osm", lanelet2(), "drafts.MAX_LANES_COUNT", 10),
        (".xml", FORMATS[".xml"](), "drafts.MAX_LANES_COUNT", 10),
        (".xodr", opendrive(), "drafts.MAX_LANES_COUNT", 10),
        (".xodr", opendrive(), "drafts.MAX_SECTIONS_COUNT", 300),
        (".osm", lanelet2(), "drafts.MAX_SECTIONS_COUNT", 50),
        (".osm", STACKED, "drafts.MAX_LINKS_COUNT", 100),
        (".xml", across(30, 40.0), "network._MAX_COMPARED_COUNT", 100),
    ],
    ids=("lanes", "lanes", "lanes", "points", "points", "links", "crossings"),
)
def test_oversized_maps_are_refused(tmp_path, monkeypatch, suffix, text, limit, most):
    monkeypatch.setattr(f"scenario_gen.roads.vector.{limit}", most)
    with pytest.raises(InputError, match=f" {most} "):
        read_network(write(tmp_path, suffix, text))


def test_lane_of_impossible_length_is_refused(tmp_path):
    with pytest.raises(InputError, match="km"):
        read_network(write(tmp_path, ".xodr", opendrive().replace('d="0"', 'd="9e7"')))


def test_crossing_lanes_are_one_junction(tmp_path):
    network = read_network(write(tmp_path, ".xml", across(3, 5000.0)))  # of 10,000 edges each
    assert [lane.junction for lane in network.lanes] == ["1", "1", "1"]


def test_long_crossing_lanes_take_little_memory():
    """As with one wrong coordinate; each pair of their points would be 1 TB."""
    along = np.linspace(-2e5, 2e5, 400_001)

    def lane(name, turned, height):
        left, right = (np.column_stack((along, 0 * along + y)) for y in (1.7, -1.8))
        if turned:
            left, right = left[:, ::-1], right[:, ::-1]
        return Lane(name, left, right, height=height + 0 * along)

    heights = {"bridge": 8.0, "road": 0.0, "unknown": np.nan}
    lanes = [lane(name, name == "road", height) for name, height in heights.items()]
    network = LaneNetwork("m", ()).with_lanes(lanes)
    assert list(crossing_lanes(network)) == [(1, 2)]


def test_map_too_long_for_search_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("scenario_gen.roads.vector.lane_field._MAX_SECTIONS_COUNT", 100)
    (encounter,) = read_log([bundled("b")]).encounters
    with pytest.raises(RefusedError, match=r"choose a part with #box=x0,y0,x1,y1"):
        build_road(str(write(tmp_path, ".osm")), encounter)


SHAPES = {
    "<line/>": lambda s: (s, 0.0 * s),
    '<arc curvature="0.02"/>': lambda s: (
        np.sin(0.02 * s) / 0.02,
        (1.0 - np.cos(0.02 * s)) / 0.02,
    ),
    '<poly3 a="0" b="0" c="0.001" d="0"/>': None,
    '<paramPoly3 aU="0" bU="1" cU="0" dU="0" aV="0" bV="0" cV="0.001" dV="0" pRange="arcLength"/>': lambda s: (
        s,
        0.001 * s**2,
    ),
}


@pytest.mark.parametrize("shape", [*SHAPES, '<spiral curvStart="0" curvEnd="0.05"/>'])
def test_reference_lines(shape):
    """Against closed forms; the clothoid against scipy's Fresnel integrals; y = 0.001 x² against its arc length."""
    from scipy.special import fresnel

    text = f'<road length="50"><planView><geometry s="0" x="0" y="0" hdg="0" length="50">{shape}</geometry></planView></road>'
    s = np.linspace(0.0, 50.0, 101)
    poses = reference_line(parse_xml(text.encode(), "map")).at(s, float(s[-1]))
    if shape.startswith("<spiral"):
        a = math.sqrt(math.pi / (0.05 / 50.0))
        y, x = fresnel(s / a)
        x, y = x * a, y * a
    elif shape.startswith("<poly3"):
        x = poses[:, 0]
        y = 0.001 * x**2
        slope = 0.002 * x
        assert np.allclose(
            s, (slope * np.sqrt(1 + slope**2) + np.arcsinh(slope)) / 0.004, atol=1e-5
        )
    else:
        x, y = SHAPES[shape](s)
    assert np.allclose(poses[:, 0], x, atol=1e-9) and np.allclose(poses[:, 1], y, atol=1e-9)
    assert np.allclose(
        np.diff(poses[:, 1]) / np.diff(poses[:, 0]),
        np.tan((poses[1:, 2] + poses[:-1, 2]) / 2.0),
        atol=1e-3,
    )
