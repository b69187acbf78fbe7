# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Several cases at once: the same results as one after the other, refusals in their places."""

import numpy as np
import pytest
from support.source_files import ROOT

from scenario_gen import (
    generate_many,
    InputError,
    PipelineConfig,
    read_log,
    RefusedError,
    SamplingConfig,
)


def test_workers_do_not_change_results():
    (encounter,) = read_log(str(ROOT / "examples" / "my_log.csv")).encounters
    cases = [(encounter, "straight"), (encounter, "four_way")]
    alone, spread = (generate_many(cases, count=1, seed=3, workers=workers) for workers in (1, 2))
    assert [type(answer).__name__ for answer in alone] == ["RefusedError", "GenerationResult"]
    assert isinstance(spread[0], RefusedError) and str(spread[0]) == str(alone[0])
    assert all(
        np.array_equal(a.position, b.position) for a, b in zip(alone[1], spread[1], strict=True)
    )
    assert spread[1].evaluation.to_json() == alone[1].evaluation.to_json()
    assert generate_many([]) == []
    drawn = PipelineConfig(sampling=SamplingConfig(decisions="drawn"))
    outcomes = generate_many([(encounter, "corridor")], drawn, count=4, seed=2, workers=1)
    assert sum(map(len, outcomes)) == 4 and len(outcomes) > 1
    assert all(result.encounter.decision for result in outcomes)
    with pytest.raises(InputError, match="fourway"):
        generate_many([(encounter, "fourway")], count=1)
