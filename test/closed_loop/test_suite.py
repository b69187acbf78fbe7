# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Suites: several bags and planners in one table, one JUnit file and one page, weighted as the traffic is."""

from dataclasses import replace
import json
from xml.etree import ElementTree

import numpy as np
import pytest
from support.bag_examples import hand_made_run
from support.browser_tab import DESKTOP, PHONE, Tab
from support.driving_scenes import crossing
from typer.testing import CliRunner

from scenario_gen.bags.recordings.write import write_recording
from scenario_gen.cli.commands import app
from scenario_gen.closed_loop.origin import Trial
from scenario_gen.closed_loop.suite import bags_in, category_of, population_weights
from scenario_gen.types import Decision, Facts, Outcome

PLANNERS = [f"scenario_gen.closed_loop.planners:{name}" for name in ("IdmFollower", "NonReactive")]


class Stands:
    def reset(self, task):
        self.task = task

    def act(self, seen):
        return None


@pytest.fixture(scope="module")
def bags(tmp_path_factory):
    root = tmp_path_factory.mktemp("suite")
    for place in ("one/bag", "two/road=r/part-0"):
        write_recording(root / place, hand_made_run())
    (root / "list.txt").write_text("# bags\n\none/bag\ntwo\n")
    return root


@pytest.fixture(scope="module")
def driven(bags, tmp_path_factory):
    out = tmp_path_factory.mktemp("driven") / "out"
    words = ["drive", str(bags / "list.txt"), "--workers", "1", "--count", "2", "--out", str(out)]
    planners = [PLANNERS[0], f"{__name__}:Stands"]
    words += [word for name in planners for word in ("--planner", name)]
    result = CliRunner().invoke(app, [*words, "--no-baseline"])
    assert result.exit_code == 1, result.output
    return result.output, out


def test_bags_are_in_folders_and_lists(bags):
    one, two = bags / "one" / "bag", bags / "two" / "road=r" / "part-0"
    assert bags_in([bags]) == [one, two] == bags_in([bags / "list.txt"])
    assert bags_in([one, bags / "two", one]) == [one, two]
    assert bags_in([bags / "none"]) == [bags / "none"]  # its reader names it


def test_planners_are_compared_in_all_bags(driven):
    output, out = driven
    suite = json.loads((out / "suite.json").read_text())
    assert suite["planners"] == [PLANNERS[0], f"{__name__}:Stands"]
    names = [each["name"] for each in suite["scenarios"]]
    assert names[0].startswith("one/bag ") and names[2].startswith("two/road=r/part-0 ")
    idm, stands = suite["table"][0]["passed"]
    assert (idm["of"], stands["of"], stands["count"]) == (4, 4, 0) and idm["count"] > 0
    assert sum(row["passed"][0]["of"] for row in suite["table"][1:]) == 4
    assert "Stands passes" in output and "Stands: goals: 0.0 %" in output
    root = ElementTree.parse(out / "junit.xml").getroot()
    assert [each.get("failures") for each in root.findall("testsuite")] == [
        str(4 - idm["count"]),
        "4",
    ]
    second = json.loads((out / "drives-2.json").read_text())
    assert second["planner"].endswith("Stands") and len(second["drives"]) == 4


def test_planner_is_compared_with_earlier_version(bags, driven, tmp_path):
    words = ["drive", str(bags), "--workers", "1", "--count", "2", "--out", str(tmp_path / "o")]
    words += ["--no-baseline", "--against", str(driven[1] / "drives-1.json")]
    result = CliRunner().invoke(app, [*words, "--planner", f"{__name__}:Stands"])
    assert result.exit_code == 1 and "now fail:" in result.output
    assert {"drives.json", "drives.html", "suite.html"} <= {
        path.name for path in (tmp_path / "o").iterdir()
    }
    twice = CliRunner().invoke(app, [*words, "--planner", "a:B", "--planner", "c:D"])
    assert "give one --planner" in str(twice.exception)


def test_scenarios_weigh_as_in_the_traffic():
    def trial(encounter, weight=None, outcome=None, probability=1.0):
        decision = outcome and Decision("a", "b", outcome, 1.0, probability)
        facts = Facts(weight=weight, decision=decision)
        return Trial("t", replace(crossing(), facts=facts), 0, None, encounter)

    trials = [
        *(trial("plain") for _ in range(2)),
        trial("targeted", 3.0),
        trial("targeted", 1.0),
        *(trial("decided", None, Outcome.STOPS, 0.25) for _ in range(5)),
        trial("decided", None, Outcome.GOES_FIRST, 0.75),
    ]
    weights = population_weights(trials)
    assert weights.mean() == pytest.approx(1.0)
    expected = np.array([0.5, 0.5, 0.75, 0.25, *[0.05] * 5, 0.75])
    assert weights / weights.sum() == pytest.approx(expected / 3.0)
    assert category_of(trials[0]) == ("crossing", "car")


def test_suite_page_sorts_and_links(browser, driven):
    file = driven[1] / "suite.html"
    for size in (DESKTOP, PHONE):
        tab = Tab(browser, file, size)
        assert tab.page.evaluate("document.documentElement.scrollWidth") <= size["width"]
        assert tab.troubles == [] and tab.asked() == [file.as_uri()]
        if size is DESKTOP:
            tab.page.locator(".suite").get_by_role("button", name="IdmFollower").click()
            values = tab.page.evaluate(
                "[...document.querySelectorAll('.suite tbody tr')].map(r => +r.cells[2].dataset.value)"
            )
            assert values == sorted(values) and len(values) == 4
            row = tab.page.locator(".suite tbody tr").last
            row.locator("a").click()
            assert row.get_attribute("aria-current") == "true"
            title = tab.page.locator("#title").inner_text()
            assert row.locator("a").inner_text() in title and "Stands: did not reach" in title
            row.locator("button").first.click()
            assert "IdmFollower: " in tab.page.locator("#title").inner_text()
            assert row.get_attribute("aria-current") == "true"
        tab.page.close()
