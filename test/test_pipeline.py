# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The arms of a case: what the segmenter's changepoints are measured against, made by the same chain."""

from dataclasses import replace
from io import StringIO
import json
from pathlib import Path
import re

from markupsafe import escape
import numpy as np
import pytest
from rich.console import Console
from support.reaction_scenes import answering, lane_encounter, wander

from scenario_gen.logs import read_log
from scenario_gen.logs.synthetic import bundled
from scenario_gen.method.evaluation import evaluate_scenarios, EvaluationConfig
from scenario_gen.method.sampling import SamplingConfig
from scenario_gen.output.report.summary import summary
from scenario_gen.output.results import write_results
from scenario_gen.pipeline import generate, PipelineConfig
from scenario_gen.types import ONE_DRIVER, REPLAY, UNIFORM, WITH, WITHOUT
from scenario_gen.types.request import Request

QUICK = EvaluationConfig(resamples=50, compare=True)
WORDS = {"without": WITHOUT, "uniform": UNIFORM, "one driver": ONE_DRIVER, "replay": REPLAY}


@pytest.fixture(scope="module")
def encounter():
    return read_log(Path(bundled("b"))).encounters[0]


@pytest.fixture(scope="module")
def case(encounter):
    return generate(encounter, "t_intersection", PipelineConfig(evaluation=QUICK), count=4, seed=3)


def printed(case):
    console = Console(width=200, record=True, file=StringIO())
    console.print(summary([case], verbose=True))
    return console.export_text()


def written(case, folder):
    """The page, and the figures of the case."""
    write_results(folder, [case], title="", quality=(), provenance={})
    (figures,) = json.loads((folder / "evaluation.json").read_text())["cases"]
    return (folder / "report.html").read_text(encoding="utf-8"), figures


def test_every_arm_has_its_row_and_its_account(case):
    assert [row.name for row in case.evaluation.rows] == [
        "recording",
        WITH,
        WITHOUT,
        UNIFORM,
        ONE_DRIVER,
        REPLAY,
    ]
    assert len(case.references[UNIFORM].scenarios) == 4 and not case.refusals
    accepted = case.evaluation.value(UNIFORM, "acceptance")
    assert accepted == pytest.approx(
        1.0 - sum(case.references[UNIFORM].refused.values()) / case.references[UNIFORM].candidates
    )
    same = np.array_equal(
        case.references[UNIFORM].scenarios[0].speed, case.generated.scenarios[0].speed
    )
    assert not same, "other changepoints, other scenarios"


def test_by_default_no_further_set_is_drawn_and_nothing_else_changes(encounter, case, tmp_path):
    plain = generate(
        encounter,
        "t_intersection",
        PipelineConfig(evaluation=replace(QUICK, compare=False)),
        count=4,
        seed=3,
    )
    assert (
        not EvaluationConfig().compare
        and not plain.references
        and not plain.refusals
        and plain.compared == (WITH,)
    )
    rows = [
        {row["name"]: row for row in json.loads(one.evaluation.to_json())["rows"]}
        for one in (plain, case)
    ]
    assert set(rows[1]) - set(rows[0]) == {WITHOUT, UNIFORM, ONE_DRIVER}
    assert all(rows[0][name] == rows[1][name] for name in rows[0])
    page, figures = written(plain, tmp_path)
    assert "--compare" in page and not any(
        f">{name}" in page.lower() for name in (WITHOUT, UNIFORM)
    )
    assert set(figures["similarity"]["compared"]) == {WITH} and set(
        figures["similarity"]["beside"]
    ) == {REPLAY}
    text = printed(plain)
    assert "--compare" in text and "uniform" not in text and "|" not in text


def test_what_is_compared_is_drawn_with_the_same_freedom(case):
    for name in (WITHOUT, UNIFORM):
        sizes = {scenario.vehicles[0].length for scenario in case.references[name].scenarios}
        assert len(sizes) > 1, f"{name}: preset wide draws sizes"
    assert (
        len({scenario.vehicles[0].length for scenario in case.references[ONE_DRIVER].scenarios})
        == 1
    )
    assert case.compared == (WITH, WITHOUT, UNIFORM)


def test_the_first_figures_that_anybody_sees_are_those_of_the_delivered_set(case, tmp_path):
    page, figures = written(case, tmp_path)
    assert "<h3>Uniform changepoints</h3>" in page and f"<th>{UNIFORM}<small" in page
    assert (
        next(iter(figures)) == "similarity"
        and next(iter(figures["similarity"]["compared"])) == WITH
    )
    delivered = evaluate_scenarios(case.encounter, {WITH: case.generated}, config=QUICK).value(
        WITH, "e_position"
    )
    assert figures["similarity"]["compared"][WITH]["e_position"] == pytest.approx(
        delivered, rel=1e-5
    )
    said = next(line for line in printed(case).splitlines() if "E position" in line)
    words = [
        f"{word} {case.evaluation.value(row, 'e_position'):.3f}" for word, row in WORDS.items()
    ]
    assert (
        said.split()
        == f"E position {delivered:.3f} | {words[0]}, {words[1]} ({words[2]}, {words[3]})".split()
    )
    cell = re.search(r'<td class="(good|bad)">([\d.]+)<small', page)
    assert float(cell[2]) == pytest.approx(delivered, rel=5e-3)
    assert (cell[1] == "good") == (case.best("e_position") == WITH)


def test_a_set_with_a_target_is_not_compared_with_sets_without_it(encounter):
    config = PipelineConfig(evaluation=QUICK)
    made = generate(
        encounter, "t_intersection", config, count=2, seed=3, request=Request(order="free")
    )
    assert made.compared == (WITH,) and "order" in made.not_compared
    assert "nothing is compared" in printed(made)


def test_who_reacts_to_whom_is_said_in_terminal_page_and_figures(case, encounter, tmp_path):
    said = "vehicle 2 slows for vehicle 1 and passes 1.7 s behind it"
    config = PipelineConfig(evaluation=QUICK, sampling=SamplingConfig(reactions="none"))
    free = generate(encounter, "t_intersection", config, count=2, seed=3)
    for made, kept in ((case, True), (free, False)):
        page, figures = written(made, tmp_path)
        sentence = said if kept else f"{said}: not enforced"
        assert sentence in [
            line.strip().removeprefix("reaction  ") for line in printed(made).splitlines()
        ]
        assert (
            said in page
            and ('class="text">enforced' in page) == kept
            and ("not enforced" in page) != kept
        )
        assert figures["reactions"]["sentences"] == [sentence]
        (edge,) = figures["reactions"]["edges"]
        assert (edge["who"], edge["whom"], edge["kept"]) == ("2", "1", kept) and edge[
            "lag"
        ] == pytest.approx(0.4, abs=0.05)


def test_the_figures_of_a_reaction_that_the_road_does_not_keep_are_said(tmp_path):
    """A follower that is asked to start much nearer to its leader than it ever drove."""
    leader = wander(np.random.default_rng(3), 200)
    lane, config = (
        lane_encounter(leader, answering(leader, 1.2, 0.9)),
        PipelineConfig(evaluation=QUICK),
    )
    x, y, yaw, _ = (
        generate(lane, "corridor", config, count=1, seed=3).fit.requested.start[1].tolist()
    )
    asked = Request(starts=f"2: {x + 13.0:.2f} {y:.2f} {yaw:.3f}")
    made = generate(lane, "corridor", config, count=2, seed=3, request=asked)
    (sentence,) = made.lost_reactions
    assert "vehicle 2: comes within " in sentence and made.generated.reactions == ()
    page, figures = written(made, tmp_path)
    text = printed(made)
    assert sentence in text and "and answers its speed after 1.2 s: not enforced" in text
    assert (
        page.count(str(escape(sentence))) > 1 and "not enforced" in page
    )  # beside the reaction, and in accounts
    assert figures["adaptations"] == list(map(str, made.generated.adaptations))
