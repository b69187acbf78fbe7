# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The library: pairs in canonical order, segments that are shared, agreement as scikit-learn counts it, and the page."""

import json

import numpy as np
import pytest

from scenario_gen.corpus.encounters import encounter_of, tables_of
from scenario_gen.corpus.library import adjusted_rand, build, pair_encounters
from scenario_gen.corpus.tables import rows_of
from scenario_gen.method.segmentation.library import PrimitiveLibrary
from scenario_gen.situation import Situation
from scenario_gen.types import Encounter, Vehicle

pytestmark = pytest.mark.xdist_group("corpus")


def following(order):
    """Vehicle "late" 1.5 s behind vehicle "early"; the order of the rows is `order`."""
    time = np.arange(0.0, 10.0, 0.1)
    ways = {"early": 10.0 * time, "late": 10.0 * time - 15.0}
    position = np.array([np.stack([ways[name], np.zeros(100)], axis=1) for name in order])
    vehicles = tuple(Vehicle(name) for name in order)
    return Encounter.sampled(
        vehicles, 0.1, position, np.zeros((2, 100)), np.full((2, 100), 10.0), "e"
    )


def test_who_is_first_does_not_depend_on_the_order_in_the_log():
    for order in (("early", "late"), ("late", "early")):
        (pair,) = pair_encounters(following(order), 6.0)
        assert [vehicle.id for vehicle in pair.vehicles] == ["early", "late"]


def test_agreement_is_that_of_scikit_learn():
    from sklearn.metrics import adjusted_rand_score

    random = np.random.default_rng(1)
    for _ in range(20):
        one, other = random.integers(0, 4, 60), random.integers(0, 3, 60)
        assert adjusted_rand(one, other) == pytest.approx(
            adjusted_rand_score(one, other), abs=1e-12
        )
    assert adjusted_rand(one, 3 - one) == 1.0


def test_a_library_of_a_corpus(corpus):
    out, mined = corpus
    built = build(out, most=8)
    assert built.fitted == 8 and built.assigned >= mined.encounters and built.primitives >= 2
    library = PrimitiveLibrary.load(out / "library" / "library.json")
    pairs = {
        pair.name: pair
        for row in rows_of(tables_of(out))
        for pair in pair_encounters(encounter_of(row), 6.0)
    }
    rows = list(rows_of(sorted((out / "library" / "segments").glob("*.parquet"))))
    assert {row["pair"] for row in rows} == set(pairs)
    for row in rows:
        assert len(row["primitives"]) == len(row["changepoints"]) + 1 and max(
            row["primitives"]
        ) < len(library.means)
        assert all(0 < point < len(pairs[row["pair"]].time) for point in row["changepoints"])
        assert json.loads(row["reactions"])["edges"] == [
            edge.document(pairs[row["pair"]].vehicles)
            for edge in Situation.of(pairs[row["pair"]]).reactions.edges
        ]
    page = (out / "library" / "library.html").read_text()
    assert "the second follows in" in page and "nobody reacts in" in page
    assert library.descriptions[0] in page and "<svg" in page and "<script" not in page
