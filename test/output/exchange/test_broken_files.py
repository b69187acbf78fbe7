# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Files that are broken or hostile: refused by name and place, at once."""

import pytest
from support.small_scenarios import case_of, crossing, observed

from scenario_gen.base.errors import InputError
from scenario_gen.logs.kinds import type_called
from scenario_gen.output.exchange.commonroad import write_commonroad

BOMB = b"""<?xml version="1.0"?>
<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;"><!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;&b;&b;">]>
<commonRoad>&c;</commonRoad>"""
GOOD = write_commonroad(*case_of(crossing()))[0]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (b"", BOMB, "line 2"),
        (b"", b"", "empty"),
        (b"", b"<osm/>", "is not in a known log format"),
        (b'timeStepSize="0.1"', b'timeStepSize="0"', "timeStepSize"),
    ],
)
def test_what_is_broken_is_named_with_its_place(tmp_path, old, new, said):
    path = tmp_path / "broken.xml"
    path.write_bytes(GOOD.replace(old, new) if old else new)
    with pytest.raises(InputError) as error:
        observed(path)
    assert str(error.value).startswith(str(path)) and said in str(error.value)


@pytest.mark.parametrize("name", ["absent.xml", "."])
def test_what_is_no_file_is_refused(tmp_path, name):
    with pytest.raises(InputError, match=str(tmp_path)):
        observed(tmp_path / name)


def test_what_a_file_calls_its_road_users_is_kept(tmp_path):
    path = tmp_path / "one.xml"
    for kind, types in ((b"pedestrian", ["pedestrian", "car"]), (b"animal", [None, "car"])):
        path.write_bytes(GOOD.replace(b"<type>car</type>", b"<type>" + kind + b"</type>", 1))
        made = observed(path)
        assert [type_called(seen.kind) for seen in made.vehicles] == types
