# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Several cases at once: the same results as one after the other, refusals in their places."""

import numpy as np
import pytest
from source_files import ROOT

from scenario_gen import generate_many, InputError, read_log, RefusedError


def test_workers_do_not_change_results_and_a_refusal_keeps_its_place():
    (encounter,) = read_log(str(ROOT / "examples" / "my_log.csv")).encounters
    cases = [(encounter, "four_way"), (encounter, "straight"), (encounter, "roundabout")]
    alone, spread = (generate_many(cases, count=2, seed=3, workers=workers) for workers in (1, 2))
    assert [type(answer).__name__ for answer in alone] == ["GenerationResult", "RefusedError", "GenerationResult"]
    assert isinstance(spread[1], RefusedError) and str(spread[1]) == str(alone[1])
    for k in (0, 2):
        assert all(np.array_equal(a.position, b.position) for a, b in zip(alone[k], spread[k], strict=True))
        assert spread[k].evaluation.to_json() == alone[k].evaluation.to_json()
    assert generate_many([]) == []


def test_a_road_that_does_not_exist_ends_it():
    (encounter,) = read_log(str(ROOT / "examples" / "my_log.csv")).encounters
    with pytest.raises(InputError, match="fourway"):
        generate_many([(encounter, "fourway")], count=1)
