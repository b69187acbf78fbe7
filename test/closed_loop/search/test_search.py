# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The failure search from end to end: a bag and a planner in; a rate, findings and a bag of failures out."""

from dataclasses import replace
import json
import math
import re
from xml.etree import ElementTree

import pytest
from support.textbook_motions import labelled
from typer.testing import CliRunner

from scenario_gen.bags.recordings.read import read_recording
from scenario_gen.bags.recordings.write import write_recording
from scenario_gen.base.errors import InputError
from scenario_gen.cli.commands import app
from scenario_gen.closed_loop.ego import Command
from scenario_gen.closed_loop.planners import IdmFollower, NonReactive
from scenario_gen.closed_loop.search.command import JOURNAL, search_failures, SearchRequest
from scenario_gen.closed_loop.search.objective import Objective
from scenario_gen.closed_loop.trials import read_trials, run_trials
from scenario_gen.logs import read_log
from scenario_gen.logs.synthetic import bundled
from scenario_gen.method.decisions import decided, decisions_of
from scenario_gen.method.evaluation import EvaluationConfig
from scenario_gen.output.results import provenance_of
from scenario_gen.output.review.evaluation import evaluate_bag
from scenario_gen.output.review.replan import replanned
from scenario_gen.pipeline import generate, PipelineConfig
from scenario_gen.types import Outcome

LOG, ROAD = bundled("b"), "t_intersection"
BUDGET = 60


class Blind(NonReactive):
    """Keeps no distance to anybody, but drives slowly: it fails now and then."""


class Leaves(IdmFollower):
    def act(self, observation):
        raise RuntimeError("no idea")


class Stands(IdmFollower):
    def act(self, observation):
        return Command(-9.0, 0.0)


class Strays(IdmFollower):
    """Drives in a circle."""

    def act(self, observation):
        return Command(super().act(observation).acceleration, 0.1)


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    """A bag of one request."""
    (encounter,) = read_log([LOG]).encounters
    config = PipelineConfig(evaluation=EvaluationConfig(resamples=10))
    case = generate(encounter, ROAD, config, count=2, seed=7)
    case = replace(case, provenance=provenance_of([LOG], 7, 2, [ROAD], config))
    return write_recording(tmp_path_factory.mktemp("search") / "bag", case)


def request_of(bag, planner, **further):
    source = replanned(bag)
    known = {"ego": "2", "objective": Objective("collision"), "budget": BUDGET} | further
    return SearchRequest(
        source.planned,
        source.request,
        source.sampling,
        source.limits,
        f"{__name__}:{planner}",
        **known,
    )


@pytest.fixture(scope="module")
def found(bag, tmp_path_factory):
    out = tmp_path_factory.mktemp("found") / "out"
    return search_failures(request_of(bag, "Blind"), out, workers=1), out


def test_findings_are_certified_with_passing_witness(found):
    result, out = found
    assert result.findings
    assert all(one.passed and not one.outcome.verdict.passed for one in result.findings)
    (validation,) = evaluate_bag(out / "bag")
    assert len(validation.verdicts) == len(result.findings) == validation.valid


def test_the_bag_of_failures_fails_again(found):
    result, out = found
    outcomes = run_trials(read_trials(out / "bag", "2"), f"{__name__}:Blind")
    assert all(one.verdict.collision is not None for one in outcomes)
    own = {one.trial.scenario.index: one.outcome.verdict.document() for one in result.findings}
    assert {one.verdict.index: one.verdict.document() for one in outcomes} == own


def test_files_say_what_was_found(found):
    result, out = found
    document = json.loads((out / "search.json").read_text())
    rate, rates = document["rate"], document["rates"]  # of both, whatever is searched for
    assert document["drives"] == BUDGET
    assert rate["low"] <= rate["value"] <= rate["high"]
    assert rates["collision"] == rate
    assert 0.0 < rates["at_fault"]["value"] <= rate["value"]
    assert document["bound"] >= rate["high"]
    assert len(document["findings"]) == len(result.findings) and document["kinds"]
    suite = ElementTree.parse(out / "junit.xml").getroot()
    assert int(suite.get("failures")) == len(result.findings)
    page = (out / "search.html").read_text()
    assert "Kinds of failure" in page and result.sentences()[0] in page


def test_stopped_search_resumes_with_same_bytes(bag, found, tmp_path):
    """A part of the journal first, its last line cut off; another search refuses that journal."""
    journal, kept = tmp_path / f"out{JOURNAL}", found[1].with_name(f"out{JOURNAL}").read_bytes()
    assert kept.count(b"\n") == BUDGET + 1
    journal.write_bytes(b"".join(kept.splitlines(keepends=True)[: BUDGET // 2])[:-7])
    search_failures(request_of(bag, "Blind"), tmp_path / "out", workers=1)
    for name in ("search.json", "search.html", "junit.xml", "bag/bag_0.mcap"):
        assert (tmp_path / "out" / name).read_bytes() == (found[1] / name).read_bytes()
    other = request_of(bag, "Blind", objective=Objective("goal"))
    with pytest.raises(InputError, match=r"another search \(objective"):
        search_failures(other, tmp_path / "out", workers=1)


def test_other_journals_are_refused_and_stay(bag, found, tmp_path):
    journal = tmp_path / f"out{JOURNAL}"
    lines = found[1].with_name(journal.name).read_text().splitlines(keepends=True)
    other = lines[2].replace(lines[2].split(",")[1], " 7.25", 1)
    (tmp_path / "elsewhere").write_text("".join(lines))
    for text, said in (
        ("my notes", "is no journal"),
        ("nothing\n", "is no journal"),
        (lines[0] + lines[1] + other, "line 3: not as a search wrote it"),
        (lines[0] + lines[2], "line 2: not as"),
        (lines[0] + lines[1].replace("[1,", "[NaN,"), "is no journal"),
        (None, "is a link"),
    ):
        journal.unlink(missing_ok=True)
        if text is None:
            journal.symlink_to("elsewhere")
        else:
            journal.write_text(text)
        with pytest.raises(InputError, match=rf"{said}.*; move it away, or give another --out"):
            search_failures(request_of(bag, "Blind"), tmp_path / "out", workers=1)
        assert journal.read_text() == ("".join(lines) if text is None else text)
        assert not (tmp_path / "out").exists()


def test_failing_planner_keeps_its_drives(bag, tmp_path):
    with pytest.raises(InputError, match="the planner failed: RuntimeError: no idea"):
        search_failures(request_of(bag, "Leaves"), tmp_path / "out", workers=1)
    assert (tmp_path / f"out{JOURNAL}").is_file() and not (tmp_path / "out").exists()


def test_standing_planner_misses_every_goal(bag, tmp_path):
    goal = {"objective": Objective("goal"), "budget": 12, "assignments": ["overtime=1.0"]}
    result = search_failures(request_of(bag, "Stands", **goal), tmp_path / "out", workers=1)
    assert result.estimate.first == 1
    assert 0.7 < result.estimate.rate.low < result.estimate.rate.high == 1.0


@pytest.mark.parametrize(
    ("further", "message"),
    [({"ego": "9"}, "--ego 9: .* there are 1, 2"), ({"budget": 0}, "--budget 0")],
)
def test_bad_requests_are_refused(bag, tmp_path, further, message):
    with pytest.raises(InputError, match=message):
        search_failures(request_of(bag, "Blind", **further), tmp_path / "out")


def test_objectives():
    assert Objective.parsed(" pet < 1 ") == Objective("pet", 1.0)
    assert Objective.parsed("goal") == Objective("goal")
    assert str(Objective.parsed("imposed_braking>2.5")) == "imposed_braking>2.5"
    for text in ("speed", "ttc", "ttc<", "ttc>1", "ttc<-1", "pet<1s", "imposed_braking<1", ""):
        with pytest.raises(InputError, match="take at_fault"):
            Objective.parsed(text)


def test_margins_are_negative_in_failures_only(bag):
    outcomes = run_trials(read_trials(bag, "2") + read_trials(bag, "1"), f"{__name__}:Blind")
    texts = ("at_fault", "collision", "off_road", "goal", "ttc<3", "pet<1", "imposed_braking>1")
    for text in texts:
        for outcome in outcomes:
            response, verdict = Objective.parsed(text).response(outcome), outcome.verdict
            failed = {
                "at_fault": verdict.at_fault,
                "collision": verdict.collision is not None,
                "off_road": not math.isnan(verdict.off_road),
                "goal": math.isnan(verdict.goal),
                "ttc": verdict.collision is not None or verdict.min_ttc <= 3.0,
                "pet": not math.isnan(verdict.min_pet) and verdict.min_pet <= 1.0,
                "imposed_braking": verdict.imposed_braking >= 1.0,
            }[re.split("[<>]", text)[0]]
            assert response.failed == failed and bool(response.kind) == failed
            assert len(response.parts) == (1 if text in ("at_fault", "collision") else 0)
    for planner in ("Strays", "Blind"):
        (outcome, *_) = run_trials(read_trials(bag, "2", 1), f"{__name__}:{planner}")
        response = Objective("off_road").response(outcome)
        assert response.margin == outcome.verdict.road_margin + 0.1
        assert response.failed == (planner == "Strays")


def test_command_searches_log_on_a_road(tmp_path):
    words = f"search {LOG} --road {ROAD} --planner {__name__}:Blind --ego 2 --budget 12 --workers 1 --out {tmp_path}/out".split()
    done = CliRunner().invoke(app, [*words, "--max-rate", "0.0", "--objective", "collision"])
    assert done.exit_code == 1, done.output
    for said in ("failure rate may exceed 0", "by the ego's fault:", "natural drives alone"):
        assert said in done.output
    assert json.loads((tmp_path / "out" / "search.json").read_text())["drives"] == 12
    for wrong, said in (("--max-rate 0.1 --worst", "no rate"), ("--encounter none", "'none'")):
        refused = CliRunner().invoke(app, [*words, *wrong.split()])
        assert isinstance(refused.exception, InputError) and said in str(refused.exception)


def test_outcome_search_weights_its_failures(tmp_path):
    encounter = replace(labelled("crossing, stops", 0).encounter, name="crossing")
    possible = decisions_of(encounter).possible
    (drawn,) = (one for one in possible if one.outcome is Outcome.GOES_FIRST)
    case = generate(decided(encounter, drawn), "corridor", count=1, seed=7)
    bag = write_recording(tmp_path / "bag", case)
    request = request_of(bag, "Stands", ego=drawn.whom, objective=Objective("goal"), budget=3)
    found = search_failures(request, tmp_path / "out", workers=1)
    assert found.decision == drawn
    share = f"to {100.0 * drawn.probability * found.estimate.rate.high:.3g} % fail in this way"
    assert any(share in sentence for sentence in found.sentences())
    document = json.loads((tmp_path / "out" / "search.json").read_text())
    assert document["decision"]["probability"] == drawn.probability
    (failures,) = read_recording(tmp_path / "out" / "bag").namespaces.values()
    assert {entry.facts.decision for entry in failures.entries} == {drawn}
