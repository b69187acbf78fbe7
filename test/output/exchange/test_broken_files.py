# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Files that are broken or hostile: refused by name and place, at once."""

import pytest
from support.small_scenarios import case_of, crossing, observed

from scenario_gen.base.errors import InputError
from scenario_gen.logs.kinds import type_called
from scenario_gen.output.exchange.commonroad import write_commonroad
from scenario_gen.output.exchange.openscenario import write_openscenario

BOMB = b"""<?xml version="1.0"?>
<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;"><!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;&b;&b;">]>
<commonRoad>&c;</commonRoad>"""
GOOD = {
    "xml": write_commonroad(*case_of(crossing()))[0],
    "xosc": write_openscenario(*case_of(crossing()), "road.xodr"),
}


@pytest.mark.parametrize(
    ("kind", "old", "new", "said"),
    [
        ("xml", b"", BOMB, "line 2"),
        ("xosc", b"", b"<OpenSCENARIO><Entities></OpenSCENARIO>", "line 1"),
        ("xml", b"", b"", "empty"),
        ("xml", b"", b"<osm/>", "is not in a known log format"),
        ("xml", b'timeStepSize="0.1"', b'timeStepSize="0"', "timeStepSize"),
        ("xosc", b"Polyline", b"Nurbs", "<Shape> has no <Polyline>"),
        ("xosc", b"WorldPosition", b"LanePosition", "<Position> has no <WorldPosition>"),
        ("xosc", b'time="0.5"', b'time="nan"', "<Vertex>, attribute time"),
        ("xosc", b'time="0.5"', b'time="$start"', "'$start'"),
        ("xosc", b"BoundingBox", b"Box", "it is not a road user with a bounding box"),
    ],
)
def test_what_is_broken_is_named_with_its_place(tmp_path, kind, old, new, said):
    path = tmp_path / f"broken.{kind}"
    path.write_bytes(GOOD[kind].replace(old, new) if old else new)
    with pytest.raises(InputError) as error:
        observed(path)
    assert str(error.value).startswith(str(path)) and said in str(error.value)


@pytest.mark.parametrize("name", ["absent.xml", "absent.xosc", "."])
def test_what_is_no_file_is_refused(tmp_path, name):
    with pytest.raises(InputError, match=str(tmp_path)):
        observed(tmp_path / name)


def test_what_a_file_calls_its_road_users_is_kept(tmp_path):
    path = tmp_path / "one.xml"
    for kind, types in ((b"pedestrian", ["pedestrian", "car"]), (b"animal", [None, "car"])):
        path.write_bytes(
            GOOD["xml"].replace(b"<type>car</type>", b"<type>" + kind + b"</type>", 1)
        )
        made = observed(path)
        assert [type_called(seen.kind) for seen in made.vehicles] == types
