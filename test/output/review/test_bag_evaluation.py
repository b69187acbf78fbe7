# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A bag evaluated from its messages alone gives the figures of the scenarios that were put into it."""

from collections import Counter
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from support.evaluation_worlds import report_case

from scenario_gen.bags.recordings.read import read_recording
from scenario_gen.bags.recordings.write import write_recording
from scenario_gen.base.errors import InputError
from scenario_gen.base.road_users import Dynamics
from scenario_gen.logs import read_log
from scenario_gen.logs.synthetic import bundled
from scenario_gen.method.evaluation import EvaluationConfig
from scenario_gen.method.validity import Limits
from scenario_gen.output.report.page import render, ReportInput
from scenario_gen.output.review.evaluation import evaluate_bag
from scenario_gen.pipeline import generate, PipelineConfig
from scenario_gen.types.scenario import Cause, ScenarioSet

QUICK = PipelineConfig(evaluation=EvaluationConfig(resamples=50))


def results(bag, config=QUICK):
    """The measured scenarios of each namespace."""
    return [each.result for each in evaluate_bag(bag, config)]


@cache
def real_run():
    """The synthetic merging case on a straight road."""
    (encounter,) = read_log([bundled("c")]).encounters
    return generate(encounter, "straight", QUICK, count=3, seed=7)


def test_the_figures_survive_the_bag(tmp_path):
    cases = [report_case(6), report_case(4, "second")]
    bag = write_recording(tmp_path / "run", {"/case_1": cases[0], "/case_2": cases[1]})
    found = [result.evaluation for result in results(bag)]
    assert [evaluation.encounter for evaluation in found] == ["crossing", "second"]
    for evaluation, case in zip(found, cases, strict=True):
        assert evaluation.changepoints == 2
        for key in ("e_position", "e_speed", "js_speed", "min_distance", "pet", "diversity"):
            expected = case.evaluation.value("with changepoints", key)
            assert evaluation.value("scenarios", key) == pytest.approx(
                expected, rel=1e-6, abs=1e-9
            ), key
        assert 0.0 <= evaluation.value("scenarios", "acceptance") <= 1.0


def test_a_bag_without_scenarios_is_refused(tmp_path):
    case = report_case(2)
    empty = replace(case, generated=ScenarioSet(0, (), 0))
    with pytest.raises(InputError, match="nothing to evaluate"):
        results(write_recording(tmp_path / "run", empty))
    with pytest.raises(InputError, match="does not exist"):
        results(tmp_path / "missing")


def test_bag_page_shows_valid_and_invalid(tmp_path):
    bag = write_recording(tmp_path / "run", report_case(5))
    (case,) = results(bag, replace(QUICK, limits=Limits(car=Dynamics(max_speed=9.0))))
    assert case.valid == 0 and case.published == 0 and len(case.generated.scenarios) == 5
    page = render(ReportInput([case]))
    assert "<b>0</b> of 5 requested scenarios" in page and ">0 / 5</td>" in page


def test_bag_page_shows_the_template(tmp_path):
    """Probabilities and sentences of the segmenter, fit and routes are in the bag, so they are on its page."""
    run = real_run()
    (case,) = results(write_recording(tmp_path / "run", run))
    assert case.fit is not None and [*map(str, case.fit.notes)] == [*map(str, run.fit.notes)]
    for found, known in zip(case.fit.fitted, run.fit.fitted, strict=True):
        assert found.manoeuvre == known.manoeuvre and found.scale == known.scale
        for key in ("anchors", "moved", "stands"):
            assert np.array_equal(getattr(found, key), getattr(known, key)), key
    for found, known in zip(case.routes, run.routes, strict=True):
        assert np.array_equal(found.points, known.points) and np.array_equal(
            found.anchor, known.anchor
        )
    assert case.segmentation.descriptions == run.segmentation.descriptions
    assert np.array_equal(case.segmentation.labels, run.segmentation.labels)
    assert np.allclose(
        case.segmentation.changepoint_probability,
        run.segmentation.changepoint_probability,
        atol=1e-6,
    )
    assert case.road.name == run.road.name
    page = render(ReportInput([case]))
    assert "<h2>Fit and routes</h2>" in page and run.segmentation.descriptions[0] in page


def test_bag_states_how_scenarios_were_made(tmp_path):
    first = replace(real_run(), provenance={"log c": "sha256 12", "sampling.sigma": "1.0"})
    refused = replace(first.generated, candidates=5, refused=Counter({Cause.OVERLAP: 2}))
    second = replace(first, seed=8, generated=refused, provenance={"sampling.sigma": "1.0"})
    bag = write_recording(tmp_path / "run", {"/one": first, "/two": second})
    assert read_recording(bag).provenance == {
        "log c": "sha256 12",
        "sampling.sigma": "1.0",
        "seed": "7 | 8",
    }
    cases = results(bag)
    assert "by its own summary request 1 published 3 of 3 from 3 candidates" in map(
        str, cases[0].generated.adaptations
    )
    told = "by its own summary request 1 published 3 of 3 from 5 candidates, refused: overlap 2"
    assert told in map(str, cases[1].generated.adaptations) and told in render(ReportInput(cases))
