# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""On which side a map's traffic drives, and templates that come from the other side."""

import numpy as np
import pytest
from support import map_builders
from support.motions import oncoming

from scenario_gen.roads import build_road, road_and_template
from scenario_gen.situation.traffic_side import mirrored
from scenario_gen.types import Note, NoteKind


@pytest.fixture(params=["right", "left"])
def crossroads(request, tmp_path, monkeypatch):
    """A map, and the side on which its traffic drives."""
    plain = map_builders.lanes()
    if request.param == "left":
        image = {
            k: ([(x, -y) for x, y in right], [(x, -y) for x, y in left], after)
            for k, (left, right, after) in plain.items()
        }
        monkeypatch.setattr(map_builders, "lanes", lambda: image)
    path = tmp_path / "crossroads.osm"
    path.write_text(map_builders.lanelet2())
    return str(path), request.param


def test_template_is_mirrored_on_other_side(crossroads):
    path, side = crossroads
    assert build_road(path).lanes.traffic_side == side
    for own, encounter in (("right", oncoming(1.0, 81)), ("left", oncoming(-1.0, 81))):
        road, driven = road_and_template(path, encounter)
        assert road.lanes.traffic_side == side
        if own == side:
            assert driven is encounter
            assert not any(note.kind is NoteKind.MIRRORED for note in road.lanes.notes)
        else:
            assert road.lanes.notes[0] == Note.of(NoteKind.MIRRORED, road=road.name, side=side)
            assert driven.name == "o"
            assert np.array_equal(driven.position, mirrored(encounter).position)
