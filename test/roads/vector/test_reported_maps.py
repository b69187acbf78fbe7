# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What users of other readers of maps reported: each kind of map once, with what it means."""

import math

import numpy as np
import pytest
from support.map_builders import lanelet2, write
from test_crossings import meet
from test_rules import crossing, template

from scenario_gen.base.errors import RefusedError
from scenario_gen.roads import find_places, lane_graph, read_network
from scenario_gen.roads.vector.signs import kind_of_sign
from scenario_gen.situation import clean_tracks
from scenario_gen.types import NoteKind, RuleKind

LINE = '<geometry s="0" x="{}" y="{}" hdg="{}" length="{}"><line/></geometry>'


def lane(
    number,
    kind="driving",
    links="",
    more="",
    width='<width sOffset="0" a="3.5" b="0" c="0" d="0"/>',
    attributes="",
):
    return (
        f'<lane id="{number}" type="{kind}" {attributes}><link>{links}</link>{width}{more}</lane>'
    )


def section(s=0, left="", right="", attributes=""):
    sides = f"<left>{left}</left>" * bool(left), f"<right>{right}</right>" * bool(right)
    return f'<laneSection s="{s}" {attributes}>{sides[0]}<center><lane id="0" type="none"/></center>{sides[1]}</laneSection>'


def road(
    sections,
    number=1,
    at=(0, 0, 0),
    length=100,
    link="",
    offsets="",
    elevation=0,
    plan=LINE,
    more="",
):
    return (
        f'<road length="{length}" id="{number}" junction="-1"><link>{link}</link><planView>{plan.format(*at, length)}</planView>'
        f'<elevationProfile><elevation s="0" a="{elevation}" b="0" c="0" d="0"/></elevationProfile>'
        f"<lanes>{offsets}{sections}</lanes>{more}</road>"
    )


def read(folder, *roads):
    return read_network(
        write(
            folder,
            ".xodr",
            f'<OpenDRIVE><header revMajor="1" revMinor="7"/>{"".join(roads)}</OpenDRIVE>',
        )
    )


def by_id(network):
    return {lane.id: lane for lane in network.lanes}


def after(network):
    return {lane.id: [network.lanes[k].id for k in lane.successors] for lane in network.lanes}


def records(tag, *steps):
    name = "s" if tag == "laneOffset" else "sOffset"
    return "".join(f'<{tag} {name}="{s}" a="{a}" b="0" c="0" d="0"/>' for s, a in steps)


STEPS = {  # sections of a road on which one lane, y = -1.75, goes straight on, however its number and its records step
    "lane offset": (
        [section(right=lane(-1, links='<successor id="-3"/>')),
         section(50, right=lane(-1, "none") + lane(-2, "none") + lane(-3, links='<predecessor id="-1"/>'))],
        records("laneOffset", (0, 0), (50, 7)),
    ),
    "width": (
        [section(right=lane(-1, "none", width=records("width", (0, 0), (50, 9)))
                 + lane(-2, links='<successor id="-1"/>')),
         section(50, right=lane(-1, links='<predecessor id="-2"/>'))],
        "",
    ),
    "border": (
        [section(right=lane(-1, width=records("border", (0, -3.5), (50, -9)),
                            links='<successor id="-1"/>')),
         section(50, right=lane(-1, links='<predecessor id="-1"/>'))],
        "",
    ),
    "section below a millimetre": (
        [section(right=lane(-1, links='<successor id="-1"/>')),
         section(50, right=lane(-1, links='<predecessor id="-1"/><successor id="-2"/>')),
         section(50.00005, right=lane(-1, "none") + lane(-2, links='<predecessor id="-1"/>'))],
        records("laneOffset", (0, 0), (50.00005, 3.5)),
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", STEPS)
def test_record_at_section_end_begins_next(tmp_path, kind):
    sections, offset = STEPS[kind]
    network = read(tmp_path, road("".join(sections), offsets=offset))
    assert all(np.allclose(lane.centre[:, 1], -1.75) for lane in network.lanes)
    assert [len(names) for names in after(network).values()] == [1] * (len(sections) - 1) + [0]
    assert NoteKind.FAULTY not in {note.kind for note in network.notes}


def test_one_sided_section_spares_other_side(tmp_path):
    one = 'singleSide="true"'
    sections = section(left=lane(1), right=lane(-1, links='<successor id="-1"/>')) + section(
        50, right=lane(-1, links='<predecessor id="-1"/>') + lane(-2), attributes=one
    )
    network = read(tmp_path, road(sections))
    assert {
        name: float(np.ptp(lane.centre[:, 0])) for name, lane in by_id(network).items()
    } == pytest.approx({"1.0.1": 100.0, "1.0.-1": 50.0, "1.1.-1": 50.0, "1.1.-2": 50.0})
    assert after(network)["1.0.-1"] == ["1.1.-1"]


def test_road_without_length_joins_neighbours(tmp_path):
    def between(before, next_one):
        ends = (("predecessor", before, "end"), ("successor", next_one, "start"))
        return "".join(
            f'<{tag} elementType="road" elementId="{k}" contactPoint="{at}"/>'
            for tag, k, at in ends
            if k
        )

    both = lane(-1, links='<predecessor id="-1"/><successor id="-1"/>')
    pieces = [(1, 0, 50, between(0, 2)), (2, 50, 0, between(1, 3)), (3, 50, 50, between(2, 0))]
    network = read(
        tmp_path,
        *(road(section(right=both), k, (x, 0, 0), length, link) for k, x, length, link in pieces),
    )
    assert after(network) == {"1.0.-1": ["2.0.-1"], "2.0.-1": ["3.0.-1"], "3.0.-1": []}


def test_lane_directions_are_read(tmp_path):
    lanes = lane(-1, attributes='direction="both"') + lane(-2, attributes='direction="reversed"')
    east = {
        name: float(np.cos(one.yaw[0]))
        for name, one in by_id(read(tmp_path, road(section(right=lanes)))).items()
    }
    assert east == pytest.approx({"1.0.-1": 1.0, "1.0.-1r": -1.0, "1.0.-2": -1.0})


@pytest.mark.parametrize(
    ("mark", "side", "outwards", "inwards"),
    [
        ('type="broken"', "right", True, True),
        ('type="broken" laneChange="increase"', "right", False, True),
        ('type="broken" laneChange="decrease"', "right", True, False),
        ('type="broken" laneChange="increase"', "left", True, False),
        ('type="solid broken"', "right", False, True),
        ('type="broken solid"', "left", True, False),
        ('type="solid"', "right", False, False),
    ],
)
def test_mark_may_be_crossed_one_way(tmp_path, mark, side, outwards, inwards):
    sign = 1 if side == "left" else -1
    lanes = lane(sign, more=f'<roadMark sOffset="0" {mark}/>') + lane(2 * sign)
    found = by_id(read(tmp_path, road(section(**{side: lanes}))))
    assert (bool(found[f"1.0.{sign}"].neighbours), bool(found[f"1.0.{2 * sign}"].neighbours)) == (
        outwards,
        inwards,
    )


@pytest.mark.parametrize(
    ("factor", "more"), [(100.0, ""), (1.0, ""), (100.0, 'pRange="normalized"')]
)
def test_cubic_without_range_has_stated_length(tmp_path, factor, more):
    shape = f'<paramPoly3 aU="0" bU="{factor}" cU="0" dU="0" aV="0" bV="0" cV="{20.0 * (factor / 100.0) ** 2}" dV="0" {more}/>'
    network = read(
        tmp_path, road(section(right=lane(-1)), plan=LINE.replace("<line/>", shape), length=100)
    )
    assert np.allclose(network.lanes[0].left[-1], (100.0, 20.0))


@pytest.mark.parametrize(
    ("sign", "kind"),
    [
        (("R1", "1", "US"), RuleKind.STOP),
        (("R1", "2", "USA"), RuleKind.GIVE_WAY),
        (("R2", "1", "US"), None),
        (("R2", "1", "OpenDRIVE"), None),
        (("R2", "-1", "ES"), RuleKind.STOP),
        (("206", "-1", "OpenDRIVE"), RuleKind.STOP),
        (("usR1-1", "", ""), RuleKind.STOP),
        (("r1", "", ""), RuleKind.GIVE_WAY),
    ],
)
def test_sign_is_read_by_its_country(sign, kind):
    assert kind_of_sign(*sign) == kind


def test_stop_line_may_have_only_name(tmp_path):
    signal = '<signal s="{}" t="-4" id="{}" name="{}" dynamic="no" orientation="+" country="{}" type="{}" subtype="{}"/>'
    signals = signal.format(90, "stop", "", "US", "R1", "1") + signal.format(
        88, "line", "StopLine", "", "-1", "-1"
    )
    signals += signal.format(30, "limit", "", "US", "R2", "1")
    network = read(tmp_path, road(section(right=lane(-1)), more=f"<signals>{signals}</signals>"))
    (rule,) = network.rules
    assert rule.kind == RuleKind.STOP and np.allclose(rule.line[:, 0], 88.0)
    assert NoteKind.UNREAD_SIGNS not in {note.kind for note in network.notes}


def test_autoware_stop_line_is_a_rule(tmp_path):
    text = lanelet2(signs={"s": "205"}).replace(
        'v="traffic_sign"/></relation>', 'v="road_marking"/></relation>'
    )
    text = text.replace('v="traffic_sign"/><tag k="subtype" v="de205"/>', 'v="stop_line"/>')
    (rule,) = read_network(write(tmp_path, ".osm", text)).rules
    assert rule.kind == RuleKind.STOP and np.allclose(rule.line[0], (3.5, -8.0))


def bridge(folder, suffix, height):
    """Two roads of a lane each way that cross, one of them so many metres above the other."""
    if suffix == ".xodr":
        both = section(left=lane(1), right=lane(-1))
        return read(
            folder,
            road(both, 1, (-80, 0, 0), 160),
            road(both, 2, (0, -80, math.pi / 2.0), 160, elevation=height),
        )
    nodes = ways = relations = ""
    for k, (z, yaw) in enumerate(
        zip((0.0, 0.0, height, height), (0.0, 2.0, 1.0, 3.0), strict=True)
    ):
        ahead = np.array([math.cos(yaw * math.pi / 2.0), math.sin(yaw * math.pi / 2.0)])
        number = 4 * k
        for aside in (0.0, -3.5):
            for along in (-80.0, 80.0):
                number += 1
                x, y = along * ahead + aside * np.array([-ahead[1], ahead[0]])
                place = {"local_x": x, "local_y": y, "ele": z}
                tags = "".join(f'<tag k="{key}" v="{value}"/>' for key, value in place.items())
                nodes += f'<node id="{number}" lat="0" lon="0">{tags}</node>'
            ways += f'<way id="{number}"><nd ref="{number - 1}"/><nd ref="{number}"/></way>'
        sides = (("left", number - 2), ("right", number))
        members = "".join(f'<member type="way" role="{r}" ref="{ref}"/>' for r, ref in sides)
        relations += f'<relation id="{k + 1}">{members}<tag k="type" v="lanelet"/></relation>'
    return read_network(write(folder, ".osm", f"<osm>{nodes}{ways}{relations}</osm>"))


@pytest.mark.parametrize("suffix", [".xodr", ".osm"])
def test_bridge_traffic_meets_nobody_below(tmp_path, suffix):
    flat, above = (bridge(tmp_path, suffix, height) for height in (1.0, 8.0))
    assert {lane.junction for lane in flat.lanes} == {"1"}
    assert {lane.junction for lane in above.lanes} == {""}
    tracks = clean_tracks(template(crossing()))
    assert meet(next(find_places(lane_graph(flat), tracks)).separation.tracks)
    with pytest.raises(
        RefusedError, match="vehicles 1 and 2 would be above each other, as on a bridge"
    ):
        next(find_places(lane_graph(above), tracks))


def test_places_beyond_shortlist_are_tried(tmp_path, monkeypatch):
    network, tracks = read_network(write(tmp_path, ".xodr")), clean_tracks(template(crossing()))

    def lanes():
        return {place.match.paths[0].lanes for place in find_places(lane_graph(network), tracks)}

    everywhere = lanes()
    monkeypatch.setattr("scenario_gen.roads.vector.place.MATCHED_COUNT", 1)
    assert lanes() == everywhere and len(everywhere) > 3
