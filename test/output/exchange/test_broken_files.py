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
from scenario_gen.output.exchange.xml import read_xml

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
        ("xml", b"", BOMB, ":2: declares a document type"),
        ("xml", b"", b"<commonRoad><lanelet></commonRoad>", ":1: no well-formed XML"),
        ("xml", b"", b"", "no well-formed XML"),
        ("xml", b"", b"\xff\xfe\x00nonsense", "no well-formed XML"),
        ("xml", b"", b"<osm/>", "its root is 'osm'"),
        ("xml", b"", b'<commonRoad timeStepSize="0.1"/>', "no vehicle with a trajectory"),
        ("xml", b'timeStepSize="0.1"', b"", "no attribute timeStepSize"),
        ("xml", b'timeStepSize="0.1"', b'timeStepSize="0"', "must be positive"),
        ("xml", b"<velocity>", b"<velocity><x>1</x>", "no finite number"),
        ("xml", b"<length>4.8</length>", b"<length>-1</length>", "both must be positive"),
        ("xml", b"<length>4.8</length>", b"", "[100001]/shape/rectangle: no element length"),
        ("xml", b"<exact>17</exact>", b"<exact>3</exact>", "times must ascend"),
        ("xosc", b'domainAbsoluteRelative="absolute"', b'domainAbsoluteRelative="relative"', "only absolute ones are read"),
        ("xosc", b"WorldPosition", b"LanePosition", "no element Position/WorldPosition"),
        ("xosc", b'time="0.5"', b'time="nan"', "no finite number"),
        ("xosc", b'time="0.5"', b'time="$start"', "time is '$start'"),
        ("xosc", b"BoundingBox", b"Box", "no vehicle with a bounding box"),
    ],
)
def test_what_is_broken_is_named_with_its_place(tmp_path, kind, old, new, said):
    data = GOOD[kind].replace(old, new) if old else new
    assert data != GOOD[kind]
    if said == "no finite number" and kind == "xml":
        data = GOOD[kind].replace(b"<velocity>\n        <exact>", b"<velocity>\n        <exact>x", 1)
    assert said in refused(tmp_path, kind, data)


def test_a_file_that_is_too_large_or_not_there_is_refused(tmp_path):
    path = tmp_path / "large.xml"
    path.write_bytes(GOOD["xml"])
    with pytest.raises(InputError, match="at most 1000 are read"):
        read_xml(path, most_bytes=1000)
    with pytest.raises(InputError, match="absent"):
        read_xml(tmp_path / "absent.xml")
    with pytest.raises(InputError, match="is a folder; name a file"):
        read_scenario_file(tmp_path)


def test_nothing_is_overwritten(tmp_path):
    path, out = tmp_path / "one.xml", tmp_path / "log.csv"
    path.write_bytes(GOOD["xml"])
    import_file(path, out)
    before = out.read_bytes()
    with pytest.raises(InputError, match="exists already"):
        import_file(path, out)
    assert out.read_bytes() == before


def test_pedestrians_and_parked_cars_are_counted_and_left_out(tmp_path):
    path = tmp_path / "one.xml"
    path.write_bytes(GOOD["xml"].replace(b"<type>car</type>", b"<type>pedestrian</type>", 1))
    made = read_scenario_file(path)
    assert len(made.tracks) == 1 and made.notes == ("1 × pedestrian left out",)
