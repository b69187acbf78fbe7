# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Which built-in roads take a template: `road="auto"`, and what a refusal names."""

from pathlib import Path

import pytest
from support.textbook_motions import labelled

from scenario_gen.base.errors import RefusedError
from scenario_gen.logs import read_log
from scenario_gen.method.chain import suitable_roads, with_suitable_roads
from scenario_gen.method.sampling import TargetError
from scenario_gen.method.segmentation import segment
from scenario_gen.pipeline import generate, PipelineConfig
from scenario_gen.situation import Situation
from scenario_gen.types import NoteKind
from scenario_gen.types.request import Request

LOG = Path(__file__).resolve().parents[2] / "examples" / "my_log.csv"


@pytest.fixture(scope="module")
def crossing():
    """The log that the README starts with: a plain crossing of two vehicles."""
    (encounter,) = read_log([LOG]).encounters
    return encounter


def test_auto_takes_the_first_suitable_road(crossing):
    result = generate(crossing, "auto", count=2, seed=7)
    assert result.road.name == "four_way" and len(result.generated.scenarios) == 2
    note = result.generated.adaptations[0]
    assert (note.kind, note.values["road"]) == (NoteKind.AUTO_ROAD, "four_way")
    plain = generate(crossing, "four_way", count=2, seed=7)
    assert all(
        (a.position == b.position).all()
        for a, b in zip(plain.generated.scenarios, result.generated.scenarios, strict=True)
    )


def test_unreachable_target_is_named(crossing):
    with pytest.raises(
        TargetError, match=r"on road corridor, the last one tried: target gap=50\.\.60"
    ):
        generate(crossing, "auto", count=1, seed=7, request=Request(target="gap=50..60"))


def test_refusal_names_suitable_roads(crossing):
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


def test_ring_drivers_take_a_roundabout():
    encounter, config = labelled("roundabout entry", 1).encounter, PipelineConfig()
    names = list(
        suitable_roads(Situation.of(encounter), segment(encounter, config.segmentation, 7), config)
    )
    assert names[0] == "roundabout" and names[-1] == "corridor"
