# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A map as a picture: every lane, arrows at its arms, the places where a template fits; and the command `roads`."""

import xml.etree.ElementTree as ET

import pytest
from support.map_builders import lanelet2, opendrive
from support.source_files import ROOT
from typer.testing import CliRunner

from scenario_gen import bundled, generate, read_log
from scenario_gen.base.errors import InputError
from scenario_gen.cli.commands import app
from scenario_gen.output.map_picture import map_picture
from scenario_gen.roads import read_network

SVG = "{http://www.w3.org/2000/svg}"


def run(*words):
    """What the command prints."""
    return CliRunner().invoke(app, list(map(str, words)), catch_exceptions=False).output


@pytest.mark.parametrize(("suffix", "text"), [(".osm", lanelet2()), (".xodr", opendrive())])
def test_every_lane_and_arm_is_drawn(tmp_path, suffix, text):
    path = tmp_path / f"a & <b>{suffix}"
    path.write_text(text)
    network = read_network(path)
    picture, said = map_picture(str(path))
    drawn = [shape.get("class") for shape in ET.fromstring(picture).iter(f"{SVG}polygon")]
    assert drawn.count("lane") + drawn.count("turn") == len(network.lanes)
    assert (drawn.count("in"), drawn.count("out")) == (len(network.entries), len(network.exits))
    assert said[0].startswith(f"a & <b>: {len(network.lanes)} lanes, ")


def test_the_places_that_are_named_take_the_template(tmp_path):
    (encounter,) = read_log(bundled("b")).encounters
    path = tmp_path / "town.osm"
    path.write_text(lanelet2())
    picture, said = map_picture(str(path), encounter)
    places = [line for line in said if line.startswith("place ")]
    boxes = [
        shape
        for shape in ET.fromstring(picture).iter(f"{SVG}polygon")
        if shape.get("class") == "box"
    ]
    assert len(places) == len(boxes) or [line for line in said if line.startswith("no place for ")]
    if places:
        part = places[0].rpartition("--road '")[2].strip("'")
        assert generate(encounter, part, count=1).road is not None


def test_built_in_roads_are_listed_and_those_that_suit(tmp_path):
    log = ROOT / "examples" / "my_log.csv"
    assert (
        run("roads")
        == "roads: straight, curve, t_intersection, four_way, merge, roundabout, corridor\n"
    )
    assert run("roads", "--log", log) == "roads that suit my_log: four_way, corridor\n"
    assert run("roads", "four_way", "--out", tmp_path / "four.svg").startswith("four_way: ")
    assert ET.parse(tmp_path / "four.svg").getroot().tag == f"{SVG}svg"


def test_nothing_of_the_user_is_overwritten(tmp_path):
    (tmp_path / "mine.svg").write_text("<!-- mine -->")
    for name in ("mine.svg", "mine.txt"):
        with pytest.raises(InputError, match="--out "):
            run("roads", "four_way", "--out", tmp_path / name)
    assert (tmp_path / "mine.svg").read_text() == "<!-- mine -->" and not (
        tmp_path / "mine.txt"
    ).exists()
