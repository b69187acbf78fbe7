# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The arms of a case: what the segmenter's changepoints are measured against, made by the same chain."""

from dataclasses import replace
import json
from pathlib import Path

import numpy as np
import pytest

from scenario_gen.evaluation import EvaluationConfig
from scenario_gen.logs import read_log
from scenario_gen.logs.synthetic import bundled
from scenario_gen.pipeline import generate, PipelineConfig
from scenario_gen.report.page import render, ReportInput
from scenario_gen.types.generation import NARROW, ORACLE, UNIFORM, WITH, WITHOUT

QUICK = EvaluationConfig(resamples=50)


@pytest.fixture(scope="module")
def encounter():
    return read_log(Path(bundled("b"))).encounters[0]


@pytest.fixture(scope="module")
def case(encounter):
    return generate(encounter, "t_intersection", PipelineConfig(evaluation=QUICK), count=4, seed=3)


def test_every_arm_has_its_row_and_its_account(case):
    assert [row.name for row in case.evaluation.rows] == ["template", WITH, WITHOUT, NARROW, UNIFORM, ORACLE]
    assert len(case.references[UNIFORM].scenarios) == 4 and not case.refusals
    accepted = case.evaluation.value(UNIFORM, "acceptance")
    assert accepted == pytest.approx(1.0 - sum(case.references[UNIFORM].refused.values()) / case.references[UNIFORM].candidates)
    same = np.array_equal(case.references[UNIFORM].scenarios[0].speed, case.generated.scenarios[0].speed)
    assert not same, "other changepoints, other scenarios"


def test_the_report_shows_it(case):
    page = render(ReportInput([case]))
    assert "<h3>Uniform changepoints</h3>" in page
    assert f"<th>{UNIFORM}<small" in page
    assert '"uniform":{"states"' in page


def test_it_can_be_left_out_and_changes_nothing_else(encounter, case):
    config = PipelineConfig(evaluation=replace(QUICK, uniform=False))
    plain = generate(encounter, "t_intersection", config, count=4, seed=3)
    assert UNIFORM not in plain.references and plain.evaluation.row(UNIFORM) is None
    rows = [{row["name"]: row for row in json.loads(one.evaluation.to_json())["rows"]} for one in (plain, case)]
    assert set(rows[1]) - set(rows[0]) == {UNIFORM}
    assert all(rows[0][name] == rows[1][name] for name in rows[0])
