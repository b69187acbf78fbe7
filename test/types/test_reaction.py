# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How reactions are put in words and documents."""

from scenario_gen.types import FOLLOW, Reaction, ReactionGraph, Vehicle, YIELD

SURE = Reaction(YIELD, 1, 0, 1.4, 1.0, 0.6, 0.9, 3.0, 9.0, stands=True, gap=2.4)
DOUBTFUL = Reaction(FOLLOW, 2, 1, 1.2, 0.8, 1.5, 0.4, 0.0, 20.0, (0.9, 1.3, 2.0))
CUT = Reaction(FOLLOW, 0, 2, 0.8, 0.5, 1.0, 0.35, 0.0, 9.0, (1.0, 1.5, 2.0))
GRAPH = ReactionGraph((SURE, DOUBTFUL), (0, 1, 2), (CUT,))
IDS = ("a", "b", "c")
VEHICLES = tuple(map(Vehicle, IDS))


def test_unenforced_edges_are_named():
    kept, free, cut = GRAPH.sentences(VEHICLES, [SURE])
    assert "held" not in kept and "held" not in cut
    assert free.endswith("(doubtful): not enforced")


def test_document_has_lag_and_confidence():
    document = GRAPH.document(VEHICLES, [DOUBTFUL])
    assert [edge["kept"] for edge in document["edges"]] == [False, True]
    assert document["edges"][1] == {
        "kind": "follow", "who": "c", "whom": "b", "lag": 1.2, "gain": 0.8, "residual": 1.5, "confidence": 0.4,
        "doubtful": True, "words": DOUBTFUL.words(VEHICLES), "kept": True,
    }  # fmt: skip
    assert [edge["who"] for edge in document["cut"]] == ["a"]
    assert document["sentences"] == list(GRAPH.sentences(VEHICLES, [DOUBTFUL]))
