# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The command `drive`: a bag and a planner in, verdicts and an exit code out."""

from contextlib import suppress
import json
import os
import re
import subprocess
import sys
import time
from xml.etree import ElementTree

import pytest
from support.bag_examples import hand_made_run
from typer.testing import CliRunner

from scenario_gen.bags.recordings.write import write_recording
from scenario_gen.base.errors import InputError
from scenario_gen.cli.commands import app
from scenario_gen.closed_loop.command import drive, drive_bags, DriveRequest
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.ego import Command
from scenario_gen.closed_loop.planners import IdmFollower
from scenario_gen.closed_loop.results import as_junit, Drives
from scenario_gen.closed_loop.trials import read_trials

PLANNER = "scenario_gen.closed_loop.planners:IdmFollower"


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    return write_recording(tmp_path_factory.mktemp("driven") / "bag", hand_made_run())


def test_bars_decide_the_exit_code(bag, tmp_path):
    words = f"drive {bag} --planner {PLANNER} --workers 1 --count 2 --out {tmp_path}/out".split()
    words += [
        "--set",
        "overtime=1.0",
        "--set",
        "bars.collisions=1.0",
        "--set",
        "bars.at_fault=1.0",
    ]
    for bar in (0.0, 1.0):
        sets = ["--set", "bars.off_road=1.0", "--set", f"bars.goals={bar}"]
        told = CliRunner().invoke(app, [*words, *sets])
        assert "the non-reactive baseline passes" in told.output
        said = json.loads((tmp_path / "out" / "drives.json").read_text())
        reached = said["summary"]["goals"]["share"] >= bar
        assert told.exit_code == (0 if reached else 1), told.output
        assert ("bars not kept: goals" in told.output) != reached
        assert len(said["drives"]) == 2 and said["parameters"]["overtime"] == 1.0
        files = {path.name for path in (tmp_path / "out").iterdir()}
        assert {"junit.xml", "drives.html"} <= files


def test_library_drives_as_the_command(bag):
    made = hand_made_run()
    by_bag, by_result = drive(bag, PLANNER, "1"), drive(made, IdmFollower, "1")
    assert repr(by_bag) == repr(by_result) and len(by_bag.outcomes) == len(made)
    changed = by_bag.to_dataframe().compare(by_result.to_dataframe())
    assert set(changed.columns.get_level_values(0)) <= {"scenario", "encounter"}
    with pytest.raises(InputError, match="pass the class IdmFollower"):
        drive(made, IdmFollower(), "1")


def test_scenarios_on_one_road_share_it(bag):
    roads = {id(trial.road) for trial in read_trials(bag)}
    assert len(read_trials(bag)) > len(roads) == 1


class Still:
    """A planner that does nothing; the others of this file fail in their own ways."""

    def reset(self, task):
        self.task = task

    def act(self, seen):
        return None


class Wrong(Still):
    def act(self, seen):
        return (0.0, 0.0)


class Leaves(Still):
    def act(self, seen):
        sys.exit(0)


class LeavesAtOnce(Still):
    def act(self, seen):
        os._exit(0)


class NeverMade(Still):
    def __init__(self):
        raise RuntimeError("no model here")


class Forward(Still):
    def act(self, seen):
        return Command(1.0, 0.0)


class Hangs(Still):
    """Stands in the first scenario, and never answers in the second; it catches what it can."""

    drives = 0

    def reset(self, task):
        Hangs.drives += 1

    def act(self, seen):
        while Hangs.drives > 1:
            with suppress(Exception):
                time.sleep(0.01)


class HangsInCompiledCode(Still):
    def act(self, seen):
        sum(range(10**15))


class Slow(Still):
    def act(self, seen):
        if seen.time == 0.0:
            time.sleep(0.05)


class FailsInTheSecond(Still):
    """Prints, and fails in the second scenario."""

    drives = 0

    def reset(self, task):
        FailsInTheSecond.drives += 1
        print("a planner prints")

    def act(self, seen):
        if FailsInTheSecond.drives == 2 and seen.time > 0.45:
            raise ValueError("no\nway")
        return Command(0.1 * FailsInTheSecond.drives, 0.0)


def driven(bag, out, planner, count=2, workers=1, sets=()):
    """Return the results of one planner, and the test cases in JUnit's file."""
    assignments, planners = ["overtime=1", *sets], [f"{__name__}:{planner}"]
    request = DriveRequest([bag], planners, count=count, assignments=assignments, workers=workers)
    result = drive_bags(request, out)
    return result, list(ElementTree.parse(out / "junit.xml").getroot().iter("testcase"))


@pytest.mark.parametrize(
    ("planner", "workers", "said"),
    [
        ("Wrong", 1, "returned tuple"),
        ("Leaves", 2, r"SystemExit: 0 \(test_drive_command.py, line \d+\)"),
        ("NeverMade", 1, r"RuntimeError: no model here \(test_drive_command.py, line \d+\)"),
    ],
)
def test_failing_planner_fails_each_scenario(bag, tmp_path, planner, workers, said):
    result, cases = driven(bag, tmp_path / "out", planner, workers=workers)
    assert "2 drives ended with an error" in result.broken[-1]
    assert len(cases) == 2
    for case in cases:
        assert re.search(said, case.find("error").get("message"))
        assert "Traceback" in case.find("error").text


def test_error_does_not_stop_the_rest(bag, tmp_path, capfd):
    FailsInTheSecond.drives = 0
    result, cases = driven(bag, tmp_path / "out", "FailsInTheSecond", count=3)
    (drives,) = result.drives
    failures = [outcome.verdict.failure == "error" for outcome in drives.outcomes]
    assert failures == [False, True, False]
    said = drives.outcomes[1].verdict.sentence()
    assert said.startswith("failed at 0.5 s: ValueError: no way (test_drive_command.py, line ")
    assert [case.find("error") is not None for case in cases] == [False, True, False]
    printed = capfd.readouterr()
    assert "a planner prints" in printed.err and "prints" not in printed.out


def test_repetition_finds_state_between_drives(bag, tmp_path):
    FailsInTheSecond.drives = 5
    result, _ = driven(bag, tmp_path / "out", "FailsInTheSecond", sets=["repeat=2"])
    assert "2 of 2 drives differ when repeated" in result.broken[-1]
    result, _ = driven(bag, tmp_path / "out", "Forward", sets=["repeat=2"])
    assert not any("differ" in sentence for sentence in result.broken)


def test_planner_ending_its_process_ends_command(bag, tmp_path):
    with pytest.raises(InputError, match="ended after 0 of 2 drives"):
        driven(bag, tmp_path / "out", "LeavesAtOnce", workers=2)
    assert list(tmp_path.iterdir()) == []


def test_hanging_planner_is_ended_and_located(bag, tmp_path):
    Hangs.drives = 0
    result, cases = driven(bag, tmp_path / "out", "Hangs", sets=["drive_time=5"])
    assert "not finished in 5 s" in result.drives[0].outcomes[1].verdict.error
    assert "time.sleep" in cases[1].find("error").text and cases[0].find("error") is None


@pytest.mark.long
def test_hanging_compiled_code_ends_its_process(bag, tmp_path):
    with pytest.raises(InputError, match=r"0 of 2 drives: .* hung .* longer than drive_time"):
        driven(bag, tmp_path, "HangsInCompiledCode", workers=2, sets=["drive_time=0.5"])


def test_slow_decisions_are_counted_only(bag, tmp_path):
    known = {}
    for planner in ("Slow", "Still"):
        made, _ = driven(bag, tmp_path / planner, planner, count=1, sets=["step=0.04"])
        (result,) = made.drives
        known[planner] = json.loads((tmp_path / planner / "drives.json").read_text())
        assert "progress: 0.0 %" in " ".join(result.broken)  # who never moves breaks a bar
        if planner == "Slow":
            (outcome,) = result.outcomes
            assert outcome.decisions.slow >= 1 and outcome.decisions.longest >= 0.05
    assert known["Slow"] | {"planner": ""} == known["Still"] | {"planner": ""}


def test_junit_is_xml_for_any_name():
    suite = ElementTree.fromstring(as_junit(Drives([], "no\x01 name\ufffe", ClosedLoopConfig())))
    assert suite.get("name") == r"no\x01 name\ufffe" and suite.get("tests") == "0"


def test_planner_ending_command_process_is_named():
    code = (
        "import os\nfrom scenario_gen.closed_loop.timeouts import end_named\n"
        "with end_named(): pass\n"
        "with end_named(): os._exit(0)"
    )
    ended = subprocess.run(
        [sys.executable, "-c", code], check=False, capture_output=True, text=True, timeout=60
    )
    assert ended.stderr.count("the planner ended the process") == 1
