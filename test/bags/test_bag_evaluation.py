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

"""A bag evaluated from its messages alone gives the figures of the scenarios that were put into it."""

from evaluation_worlds import report_case
import pytest

from msg_conventions.topics import topic_entry
from scenario_gen.bags import read_messages, Run, write_run
from scenario_gen.bags.evaluation import bag_cases, evaluate_bag
from scenario_gen.bags.metadata import qos_yaml
from scenario_gen.bags.writer import AtomicBag
from scenario_gen.errors import InputError
from scenario_gen.evaluation import EvaluationConfig, render, ReportInput
from scenario_gen.validity import Limits

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


def only(bag, folder, topics):
    """Copy the messages of these topics to another bag, as somebody else might have recorded it."""
    with AtomicBag(folder) as copy:
        for name in topics:
            kind, quality = topic_entry(name)
            copy.add_topic(f"/{name}", kind, qos_yaml(quality))
        for message in read_messages(bag, lambda topic: topic.strip("/") in topics):
            copy.write(message.topic, message.data, message.stamp_ns)
    return folder


def test_a_bag_becomes_a_page_with_all_its_scenarios_valid_or_not(tmp_path):
    bag = write_run(tmp_path / "run", as_run(report_case(5)))
    (case,) = bag_cases(bag, QUICK, Limits(max_speed=9.0))
    assert case.valid == 0 and case.published == 0 and len(case.with_changepoints.scenarios) == 5
    page = render(ReportInput([case]))
    assert "<b>0</b> of 5 scenarios asked for" in page and ">0 / 5</td>" in page
    assert "the bag holds one set of scenarios" in page and "Fitted to the road" not in page
    assert "<h3>Scenarios</h3>" in page


def test_what_a_bag_does_not_hold_is_left_out_and_said(tmp_path):
    bag = only(write_run(tmp_path / "run", as_run(report_case(5))), tmp_path / "bare", ("tracks", "scenarios"))
    (case,) = bag_cases(bag, QUICK)
    assert case.road is None and case.evaluation.changepoints == 0
    page = render(ReportInput([case]))
    assert "whether vehicles leave the road was not checked" in page and "counts as one primitive" in page
    assert '"road":null,' in page
