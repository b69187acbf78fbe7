# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What was left out of a map because it is faulty is said on the terminal."""

from dataclasses import replace

from support.bag_examples import hand_made_run
from support.map_builders import lanelet2

from scenario_gen.cli.folder import map_faults
from scenario_gen.roads import build_road


def test_faulty_map_elements_are_named(tmp_path):
    extra = '<member type="way" ref="1002" role="left"/></relation>'
    (tmp_path / "town.osm").write_text(lanelet2().replace("</relation>", extra, 1))
    case = replace(hand_made_run(), road=build_road(str(tmp_path / "town.osm")))
    (said,) = map_faults([case, case])
    assert said.startswith("map town: 1 faulty lanelet left out (2000), first: ")
    assert map_faults([hand_made_run()]) == []
