# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Own criteria: they fail drives in every file, are objectives of searches, and their mistakes are named."""

import json
from xml.etree import ElementTree

import numpy as np
import pytest
from support.bag_examples import hand_made_run

from scenario_gen.base.errors import InputError
from scenario_gen.closed_loop.bars import Bars, broken_bars
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.criteria import find_criteria
from scenario_gen.closed_loop.results import Drives
from scenario_gen.closed_loop.search.objective import Objective
from scenario_gen.closed_loop.trials import run_trials, trials_of

PLANNER = "scenario_gen.closed_loop.planners:NonReactive"


class Speed:
    """Largest speed of the ego [m/s]."""

    name, threshold, greater_is_better = "speed", 1.0, False

    def __call__(self, drive):
        assert drive.road is not None
        return drive.motion.speed[drive.ego].max()


class Unknown:
    name, threshold = "unknown", 1.0

    def __call__(self, drive):
        return np.nan


class Broken(Unknown):
    name = "broken"

    def __call__(self, drive):
        return "many"


class Nameless:
    threshold = 0.0

    def __call__(self, drive):
        return 0.0


def drives(criteria):
    run, config = hand_made_run(), ClosedLoopConfig(criteria=criteria)
    trials = trials_of(run, run.encounter.vehicles[0].id)[:2]
    return Drives(run_trials(trials, PLANNER, config), PLANNER, config, trials)


def test_missed_criterion_is_in_every_file(tmp_path):
    here = f"{__name__}:"
    result = drives(f"{here}Speed, {here}Unknown")
    result.write(tmp_path)
    document = json.loads((tmp_path / "drives.json").read_text())
    assert document["summary"]["criterion speed"]["count"] == 2
    assert document["summary"]["criterion unknown"]["count"] == 0
    first = document["drives"][0]
    assert not first["passed"] and first["criteria"][0]["value"] > 1.0
    assert first["criteria"][1] == {
        "name": "unknown",
        "value": None,
        "threshold": 1.0,
        "met": True,
    }
    assert "speed" in first["sentence"]
    failure = ElementTree.parse(tmp_path / "junit.xml").getroot().find(".//failure")
    types = {"speed", "collision", "goal"}
    assert failure is not None and failure.get("type") in types
    assert any("criteria: 100.0 %" in line for line in broken_bars(result.outcomes, Bars()))
    assert "criterion speed" in (tmp_path / "drives.html").read_text()

    lenient = drives(f"{here}Speed>100").outcomes
    assert not any(outcome.verdict.missed for outcome in lenient)


def test_criterion_is_an_objective_with_margin():
    text = f"{__name__}:Speed>4"
    objective = Objective.parsed(text)
    config = objective.configured(ClosedLoopConfig())
    assert (str(objective), config.criteria) == (text, text)
    assert objective.configured(config) == config
    (outcome, *_) = drives(text).outcomes
    response = objective.response(outcome)
    top = outcome.drive.motion.speed[outcome.drive.ego].max()
    assert response.margin == pytest.approx(4.0 - top) and response.failed == (top > 4.0)
    assert response.kind == "speed missed" and response.parts == ()
    with pytest.raises(InputError, match="two have the name 'speed'"):
        find_criteria(
            objective.configured(ClosedLoopConfig(criteria=f"{__name__}:Speed")).criteria
        )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("clearence", "'clearence' is not installed; write MODULE:CLASS"),
        (f"{__name__}:Nameless", "no attribute 'name'"),
        (f"{__name__}:Speed<3", "write >, the side"),
    ],
)
def test_criterion_mistake_is_one_line(text, message):
    with pytest.raises(InputError, match=message) as caught:
        drives(text)
    assert "\n" not in str(caught.value)


def test_failing_criterion_is_an_error():
    outcome, _ = drives(f"{__name__}:Broken").outcomes
    assert "criterion 'broken' failed: " in outcome.verdict.error
    assert outcome.verdict.failure == "error" and "Traceback" in outcome.traceback
