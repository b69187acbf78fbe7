# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Maps with a fault that does not matter, and with static obstacles."""

import numpy as np
import pytest
from support.map_builders import commonroad, opendrive, write
from support.reaction_scenes import lane_encounter

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.fitting import fit_template
from scenario_gen.method.segmentation import segment
from scenario_gen.pipeline import generate
from scenario_gen.roads import build_road
from scenario_gen.types import NoteKind

OBSTACLE = """<staticObstacle id="77"><type>parkedVehicle</type><shape><rectangle>
<length>4.5</length><width>1.8</width></rectangle></shape><initialState><position><point>
<x>-30</x><y>-3.0</y></point></position><orientation><exact>0</exact></orientation>
<time><exact>0</exact></time></initialState></staticObstacle>"""
ARTEFACT = """<geometry s="51.99" x="-8.01" y="0" hdg="0" length="0.01">
<spiral curvStart="0" curvEnd="100"/></geometry></planView>"""


def test_static_obstacles_of_commonroad_block_cells(tmp_path) -> None:
    whole = build_road(str(write(tmp_path, ".xml")))
    road = build_road(str(write(tmp_path, ".xml", commonroad(extra=OBSTACLE))))
    assert road.obstructed is not None
    assert road.obstructed.sum() * road.resolution**2 > 0.9 * 4.5 * 1.4
    assert (whole.drivable == road.drivable | road.obstructed).all()
    assert NoteKind.MAP_OBSTACLES in {note.kind for note in road.lanes.notes}


def test_polygon_blocks_its_bounding_rectangle(tmp_path) -> None:
    corners = [(-1.0, -0.5), (1.0, -0.5), (1.0, 1.5), (-1.0, 1.5)]
    points = "".join(f"<point><x>{x}</x><y>{y}</y></point>" for x, y in corners)
    begin, end = OBSTACLE.index("<rectangle>"), OBSTACLE.index("</shape>")
    polygon = f"{OBSTACLE[:begin]}<polygon>{points}</polygon>{OBSTACLE[end:]}"
    road = build_road(str(write(tmp_path, ".xml", commonroad(extra=polygon))))
    (obstacle,) = road.obstacles
    assert obstacle.outline.min(axis=0) == pytest.approx([-31.0, -3.5])
    assert obstacle.outline.max(axis=0) == pytest.approx([-29.0, -1.5])
    line = polygon.replace("<y>1.5</y>", "<y>-0.5</y>")
    road = build_road(str(write(tmp_path, ".xml", commonroad(extra=line))))
    assert any("its polygon has no area" in str(note) for note in road.lanes.notes)


def test_tiny_spiral_and_missing_header_pass(tmp_path) -> None:
    text = opendrive()
    begin, end = text.index("<header"), text.index("<road")
    wild = text.replace("</planView>", ARTEFACT, 1)
    whole = build_road(str(write(tmp_path, ".xodr")))
    for faulty in (text[:begin] + text[end:], wild):
        road = build_road(str(write(tmp_path, ".xodr", faulty)))
        assert len(road.lanes.lanes) == len(whole.lanes.lanes)
        assert NoteKind.FAULTY not in {note.kind for note in road.lanes.notes}


def test_lane_beyond_missing_costs_only_itself(tmp_path) -> None:
    beyond = '<lane id="-3" type="driving"><width sOffset="0" a="3" b="0" c="0" d="0"/></lane>'
    text = opendrive().replace("</right>", f"{beyond}</right>", 1)
    whole = build_road(str(write(tmp_path, ".xodr")))
    road = build_road(str(write(tmp_path, ".xodr", text)))
    assert len(road.lanes.lanes) == len(whole.lanes.lanes)
    (note,) = [note for note in road.lanes.notes if note.kind is NoteKind.FAULTY]
    assert "0.0.-3 and those beyond it" in str(note)
    text = opendrive().replace("</right>", '<lane id="-2" type="driving"/></right>', 1)
    road = build_road(str(write(tmp_path, ".xodr", text)))
    assert len(road.lanes.lanes) == len(whole.lanes.lanes)
    (note,) = [note for note in road.lanes.notes if note.kind is NoteKind.FAULTY]
    assert "it has neither width nor border" in str(note)


def test_narrow_or_too_few_lanes_named(tmp_path) -> None:
    speed = np.full(60, 8.0)
    narrow = write(tmp_path, ".xodr", opendrive().replace('a="3.5"', 'a="1.2"'))
    with pytest.raises(RefusedError, match=r"lane .* is 1\.2 m wide at .* too narrow for vehicle"):
        generate(lane_encounter(speed, speed), narrow, count=1)
    road = build_road(str(write(tmp_path, ".xodr")))
    passing, beside = (lane_encounter(speed, speed + v, gap=10.0, lane=3.5) for v in (4.0, 0.0))
    with pytest.raises(RefusedError, match="passes 1 on its left in the recording, not on"):
        fit_template(passing, segment(passing), road)
    losses = fit_template(beside, segment(beside), road).losses
    assert {loss.kind for loss in losses} >= {"lanes"}
