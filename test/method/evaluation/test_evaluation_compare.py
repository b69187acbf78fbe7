# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Two sets of results side by side."""

from dataclasses import replace
from itertools import combinations
import json

import numpy as np
import pytest
from support.evaluation_worlds import crossing, samples

from scenario_gen.base.errors import InputError
from scenario_gen.method.evaluation import evaluate_scenarios, EvaluationConfig
from scenario_gen.method.evaluation.comparison import compare, comparison_table, read_evaluations
from scenario_gen.types.segmentation import Segmentation


@pytest.fixture(scope="module")
def sets():
    encounter = crossing()
    segmentation = Segmentation(np.zeros(121, int), np.zeros(0, int), np.zeros(121), ("all",))

    def made(pace, seed):
        rows = {"with changepoints": samples(encounter, 50, seed, pace=pace)}
        return evaluate_scenarios(
            encounter,
            rows,
            changepoints=len(segmentation.changepoints),
            road="cross",
            config=EvaluationConfig(resamples=200),
        )

    return made(1.0, 1), made(1.0, 2), made(0.0, 3), made(1.0, 4), made(1.0, 5)


def test_a_worse_set_is_named_and_another_seed_is_not(sets):
    good, again, bad, *more = sets
    found = {entry.metric.id: entry for entry in compare([good], [bad])}
    assert (
        found["e_speed"].better == "first"
        and found["js_speed"].better == "first"
        and found["coverage"].better == "first"
    )
    assert {entry.metric.id: entry for entry in compare([bad], [good])}[
        "e_speed"
    ].better == "second"
    equal = [compare([one], [two]) for one, two in combinations((good, again, *more), 2)]
    assert sum(entry.clear for entries in equal for entry in entries) <= 0.05 * sum(
        len(entries) for entries in equal
    )
    assert (
        found["min_distance"].clear and not found["min_distance"].better
    )  # neither direction is better
    table = comparison_table(compare([good], [bad]), ("seed 1", "slow"))
    assert "## crossing on cross" in table and "| seed 1 |" in table and "| differs |" in table


def test_sets_without_a_common_case_are_refused(sets):
    with pytest.raises(InputError, match="in common"):
        compare([sets[0]], [replace(sets[1], road="elsewhere")])
    with pytest.raises(InputError, match="no row"):
        compare([sets[0]], [sets[1]], "nobody")


def test_figures_are_read_from_a_run(tmp_path, sets):
    document = {
        "provenance": {},
        "cases": [json.loads(evaluation.to_json()) for evaluation in sets[:2]],
    }
    (tmp_path / "evaluation.json").write_text(json.dumps(document))
    assert len(read_evaluations(tmp_path)) == 2
    (tmp_path / "one.json").write_text(sets[0].to_json())
    assert read_evaluations(tmp_path / "one.json")[0].to_json() == sets[0].to_json()
