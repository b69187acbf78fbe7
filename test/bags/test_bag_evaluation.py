"""A bag evaluated from its messages alone gives the figures of the scenarios that were put into it."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "evaluation"))

from evaluation_worlds import report_case

from scenario_gen.bags import Run, write_run
from scenario_gen.bags.evaluation import evaluate_bag
from scenario_gen.errors import InputError
from scenario_gen.evaluation import EvaluationConfig

QUICK = EvaluationConfig(resamples=50)


def as_run(case, namespace=""):
    return Run(
        case.encounter, case.road, case.segmentation, case.fit, tuple(case.routes), case.with_changepoints, 7, "1", namespace
    )


def test_the_figures_survive_the_bag(tmp_path):
    cases = [report_case(6), report_case(4, "second")]
    bag = write_run(tmp_path / "run", [as_run(cases[0], "/case_1"), as_run(cases[1], "/case_2")])
    found = evaluate_bag(bag, QUICK)
    assert [evaluation.encounter for evaluation in found] == ["run/case_1", "run/case_2"]
    for evaluation, case in zip(found, cases, strict=True):
        assert evaluation.changepoints == 2
        for key in ("e_position", "e_speed", "js_speed", "min_distance", "pet", "diversity"):
            expected = case.evaluation.value("with changepoints", key)
            assert evaluation.value("scenarios", key) == pytest.approx(expected, rel=1e-6, abs=1e-9), key
        assert 0.0 <= evaluation.value("scenarios", "acceptance") <= 1.0


def test_a_bag_without_scenarios_is_refused(tmp_path):
    case = report_case(2)
    empty = Run(
        case.encounter, case.road, case.segmentation, case.fit, tuple(case.routes), type(case.with_changepoints)(0, (), 0), 7
    )
    with pytest.raises(InputError, match="nothing to compare"):
        evaluate_bag(write_run(tmp_path / "run", empty), QUICK)
    with pytest.raises(InputError, match="no such bag"):
        evaluate_bag(tmp_path / "missing", QUICK)
