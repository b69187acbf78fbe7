# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Files that are broken or hostile: refused by name and place, at once."""

import pytest
from small_scenarios import crossing
from test_commonroad import case_of

from scenario_gen.base.errors import InputError
from scenario_gen.output.exchange.commonroad import write_commonroad
from scenario_gen.output.exchange.importing import import_file, read_scenario_file
from scenario_gen.output.exchange.openscenario import write_openscenario

BOMB = b"""<?xml version="1.0"?>
<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;"><!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;&b;&b;">]>
<commonRoad>&c;</commonRoad>"""
GOOD = {
    "xml": write_commonroad(*case_of(crossing()))[0],
    "xosc": write_openscenario(*case_of(crossing()), "road.xodr"),
}


def refused(tmp_path, kind, data):
    path = tmp_path / f"broken.{kind}"
    path.write_bytes(data)
    with pytest.raises(InputError) as error:
        read_scenario_file(path)
    assert str(error.value).startswith(str(path))
    return str(error.value)


@pytest.mark.parametrize(
    ("kind", "old", "new", "said"),
    [
        ("xml", b"", BOMB, "line 2"),
        ("xosc", b"", b"<OpenSCENARIO><Entities></OpenSCENARIO>", "line 1"),
        ("xml", b"", b"", "empty"),
        ("xml", b"", b"<osm/>", "its root is 'osm'"),
        ("xml", b'timeStepSize="0.1"', b'timeStepSize="0"', "timeStepSize"),
        ("xml", b"<length>4.8</length>", b"<length>-1</length>", "both must be positive"),
        ("xml", b"<exact>17</exact>", b"<exact>3</exact>", "times must ascend"),
        ("xosc", b"Polyline", b"Nurbs", "<Shape> has no <Polyline>"),
        ("xosc", b"WorldPosition", b"LanePosition", "<Position> has no <WorldPosition>"),
        ("xosc", b'time="0.5"', b'time="nan"', "<Vertex>, attribute time"),
        ("xosc", b'time="0.5"', b'time="$start"', "'$start'"),
        ("xosc", b"BoundingBox", b"Box", "no road user with a bounding box"),
    ],
)
def test_what_is_broken_is_named_with_its_place(tmp_path, kind, old, new, said):
    path = tmp_path / f"broken.{kind}"
    path.write_bytes(GOOD[kind].replace(old, new) if old else new)
    with pytest.raises(InputError) as error:
        read_scenario_file(path)
    assert str(error.value).startswith(str(path)) and said in str(error.value)


@pytest.mark.parametrize("name", ["absent.xml", "absent.xosc", "."])
def test_what_is_no_file_is_refused(tmp_path, name):
    with pytest.raises(InputError, match=str(tmp_path)):
        read_scenario_file(tmp_path / name)


def test_nothing_is_overwritten(tmp_path):
    path, out = tmp_path / "one.xml", tmp_path / "log.csv"
    path.write_bytes(GOOD["xml"])
    import_file(path, out)
    before = out.read_bytes()
    with pytest.raises(InputError, match="exists already"):
        import_file(path, out)
    assert out.read_bytes() == before


def test_animals_are_counted_and_left_out_and_pedestrians_are_read(tmp_path):
    path = tmp_path / "one.xml"
    for kind, types in ((b"pedestrian", ["pedestrian", "car"]), (b"animal", ["car"])):
        path.write_bytes(GOOD["xml"].replace(b"<type>car</type>", b"<type>" + kind + b"</type>", 1))
        made = read_scenario_file(path)
        assert [track.type for track in made.tracks] == types
    assert "1 × animal" in made.notes[-1]
