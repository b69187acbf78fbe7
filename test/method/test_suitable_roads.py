# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Which built-in roads take a template: `road="auto"`, and what a refusal names."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.textbook_motions import labelled

from scenario_gen.base.errors import RefusedError
from scenario_gen.logs import read_log
from scenario_gen.method.chain import Generation
from scenario_gen.method.sampling import TargetError
from scenario_gen.method.segmentation import segment
from scenario_gen.method.suitable_roads import (
    suitable_roads,
    with_suitable_roads,
)
from scenario_gen.pipeline import generate, PipelineConfig
from scenario_gen.roads import ROADS
from scenario_gen.situation import Situation
from scenario_gen.types import NoteKind
from scenario_gen.types.request import Request

LOG = Path(__file__).resolve().parents[2] / "examples" / "my_log.csv"


@pytest.fixture(scope="module")
def crossing():
    """The log that the README starts with: a plain crossing of two vehicles."""
    (encounter,) = read_log([LOG]).encounters
    return encounter


def test_auto_takes_the_first_road_that_keeps_the_conflict_and_says_so(crossing):
    result = generate(crossing, "auto", count=2, seed=7)
    assert result.road.name == "four_way" and len(result.generated.scenarios) == 2
    note = result.generated.adaptations[0]
    assert (note.kind, note.values["road"]) == (NoteKind.AUTO_ROAD, "four_way")
    plain = generate(crossing, "four_way", count=2, seed=7)
    assert all(
        (a.position == b.position).all()
        for a, b in zip(plain.generated.scenarios, result.generated.scenarios, strict=True)
    )


def test_where_roads_suit_but_the_target_cannot_be_had_that_is_said(crossing):
    with pytest.raises(
        TargetError, match=r"on road corridor, the last one tried: target gap=50\.\.60"
    ):
        generate(crossing, "auto", count=1, seed=7, request=Request(target="gap=50..60"))


def test_auto_leaves_out_a_road_on_which_vehicles_share_no_area_any_more(crossing, monkeypatch):
    draw = Generation.draw

    def drawn_apart(generation, *arguments):
        made = draw(generation, *arguments)
        off = np.array([[[1000.0, 0.0]], [[0.0, 0.0]]]) if made.road.name in far else 0.0
        (one, other) = made.generated.scenarios
        apart = replace(other, position=other.position + off)
        return replace(made, generated=replace(made.generated, scenarios=(one, apart)))

    monkeypatch.setattr(Generation, "draw", drawn_apart)
    far = {"four_way"}
    result = generate(crossing, "auto", count=2, seed=7)
    assert result.generated.adaptations[0].values["road"] != "four_way"
    far = set(ROADS.built_in)
    with pytest.raises(
        RefusedError,
        match=r"on road corridor, the last one tried: vehicles .* and .* share no area there in scenario",
    ):
        generate(crossing, "auto", {"fitting.shorten": False}, count=2, seed=7)


def test_a_refusal_names_the_roads_that_suit_to_a_command(crossing):
    config = PipelineConfig()
    names = list(
        suitable_roads(Situation.of(crossing), segment(crossing, config.segmentation, 7), config)
    )
    assert "four_way" in names and names[-1] == "corridor" and "t_intersection" not in names
    with pytest.raises(
        RefusedError,
        match=r"choose another road\. Shortened .* vehicle 2 goes straight on within 27 m$",
    ) as caught:
        generate(crossing, "t_intersection", count=2, seed=7)
    answer = with_suitable_roads(caught.value, crossing, "t_intersection", config, 7)
    assert str(answer).endswith(f"It fits these roads: {', '.join(names)}")


def test_who_drives_about_a_ring_is_taken_to_a_roundabout_first():
    encounter, config = labelled("roundabout entry", 1).encounter, PipelineConfig()
    names = list(
        suitable_roads(Situation.of(encounter), segment(encounter, config.segmentation, 7), config)
    )
    assert names[0] == "roundabout" and names[-1] == "corridor"
