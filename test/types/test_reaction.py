# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How reactions are put in words and documents."""

from dataclasses import replace
import math

from scenario_gen.types import FOLLOW, Reaction, ReactionGraph, Vehicle, YIELD

SURE = Reaction(YIELD, 1, 0, 1.4, 1.0, 0.6, 0.9, 3.0, 9.0, stands=True, gap=2.4)
DOUBTFUL = Reaction(FOLLOW, 2, 1, 1.2, 0.8, 1.5, 0.4, 0.0, 20.0, (0.9, 1.3, 2.0))
CUT = Reaction(FOLLOW, 0, 2, 0.8, 0.5, 1.0, 0.35, 0.0, 9.0, (1.0, 1.5, 2.0))
GRAPH = ReactionGraph((SURE, DOUBTFUL), (0, 1, 2), (CUT,))
IDS = ("a", "b", "c")
VEHICLES = tuple(map(Vehicle, IDS))


def test_every_edge_has_a_sentence_and_what_is_doubtful_or_cut_says_so():
    assert GRAPH.sentences(VEHICLES) == (
        "vehicle b waits for vehicle a, then passes 2.4 s behind it",
        "vehicle c follows vehicle b, 1.3 s bumper to bumper, and answers its speed after 1.2 s (doubtful)",
        "vehicle a follows vehicle c, 1.5 s bumper to bumper, and answers its speed after 0.8 s (doubtful): left out, "
        "as it closes a cycle of reactions",
    )


def test_who_slows_passes_or_stops_is_said_to():
    early = Reaction(YIELD, 1, 0, -0.3, 1.0, 0.6, 0.9, 3.0, 9.0, gap=-0.2)
    assert early.words(VEHICLES) == "vehicle b slows for vehicle a and passes right behind it"
    assert (
        replace(early, since=9.0, gap=1.2).words(VEHICLES)
        == "vehicle b drives on 1.2 s after vehicle a has cleared its way"
    )
    assert replace(early, gap=math.inf).words(VEHICLES) == "vehicle b slows for vehicle a"
    assert (
        replace(early, gap=math.inf, stands=True).words(VEHICLES)
        == "vehicle b stops for vehicle a"
    )


def test_road_users_are_called_by_their_types():
    users = (
        Vehicle("a", type="bicycle"),
        Vehicle("b", type="pedestrian"),
        Vehicle("c", type="car"),
    )
    assert GRAPH.sentences(users)[0].startswith("pedestrian b waits for bicycle a, then")
    assert GRAPH.sentences(users)[1].startswith("vehicle c follows pedestrian b,")


def test_edges_that_scenarios_do_not_keep_are_said():
    kept, free, cut = GRAPH.sentences(VEHICLES, [SURE])
    assert "held" not in kept and "held" not in cut
    assert free.endswith("(doubtful): not enforced")


def test_the_document_has_lag_strength_own_part_and_confidence():
    document = GRAPH.document(VEHICLES, [DOUBTFUL])
    assert [edge["kept"] for edge in document["edges"]] == [False, True]
    assert document["edges"][1] == {
        "kind": "follow", "who": "c", "whom": "b", "lag": 1.2, "gain": 0.8, "residual": 1.5, "confidence": 0.4,
        "doubtful": True, "words": DOUBTFUL.words(VEHICLES), "kept": True,
    }  # fmt: skip
    assert [edge["who"] for edge in document["cut"]] == ["a"]
    assert document["sentences"] == list(GRAPH.sentences(VEHICLES, [DOUBTFUL]))
