# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Sets for testing: planners that look at nobody fail in them, others than those by which they were chosen, too."""

import numpy as np
import pytest
from support.driving_scenes import crossing
from support.recordlike import drive, Phase, Writing
from test_verdict import straight
from typer.testing import CliRunner

from benchmarks._driving_worlds import as_scenario
from scenario_gen.cli.commands import app
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.ego import Command
from scenario_gen.closed_loop.origin import Trial
from scenario_gen.closed_loop.planners import (
    ConstantSpeed,
    IdmFollower,
    NonReactive,
    ReferenceFollower,
    RouteFollower,
)
from scenario_gen.closed_loop.results import Drives
from scenario_gen.closed_loop.simulation import ClosedLoop
from scenario_gen.closed_loop.trials import read_trials, run_trials
from scenario_gen.closed_loop.verdict import judge
from scenario_gen.logs.synthetic import bundled
from scenario_gen.output.review.regenerate import regenerate_scenario
from scenario_gen.output.review.validation import validate_bag


class FullThrottle(RouteFollower):
    """Speeds up as much as it can."""

    def act(self, observation):
        return Command(4.0, self.steer(observation.ego)[0])


def generated(out, log, road, *words):
    quick = ("--set", "evaluation.resamples=10")
    command = ["generate", str(log), "--road", road, "--count", "3", "--for-testing", *quick]
    return CliRunner().invoke(app, [*command, *words, "--out", str(out)])


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    """Of a follower so far behind that few natural scenarios need its reaction: sampling is directed to them."""
    folder = tmp_path_factory.mktemp("testing")
    phases = Phase(3.0, -0.8), Phase(9.0, 0.3)
    drives = [
        drive(name, (x, 0.0, 0.0), 10.0, Phase(wait), *phases)
        for name, x, wait in (("1", 35.0, 3.0), ("2", 5.7, 4.2))
    ]
    Writing(5, 0.0, 14.0).doppler(drives).to_csv(folder / "log.csv", index=False)
    done = generated(folder / "out", folder / "log.csv", "straight", "--ego", "auto")
    assert done.exit_code == 0 and "3 of 3 scenarios" in done.output, done.output
    said = "on straight: the non-reactive baseline, in place of 2, passes 0 of 3"
    assert (
        said in " ".join(done.output.split())
        and said in (folder / "out" / "report.html").read_text()
    )
    return folder / "out" / "bag"


def test_scenarios_that_test_are_rare_and_say_how_rare(bag):
    scenarios = [trial.scenario for trial in read_trials(bag)]
    assert all(0.0 < scenario.facts.weight < 0.5 for scenario in scenarios)
    assert (
        len({float(scenario.speed[1, 0]) for scenario in scenarios}) == 3
    )  # the ego's motion varies, too


def test_who_looks_at_nobody_fails_and_who_looks_passes(bag):
    trials = read_trials(bag)
    assert len(trials) == 3
    drivers = {"baseline": NonReactive, "fast": FullThrottle, "looks": IdmFollower}
    failed = {
        name: sum(not one.verdict.passed for one in run_trials(trials, make))
        for name, make in drivers.items()
    }
    assert failed["baseline"] == 3 and failed["fast"] >= 2 and failed["looks"] == 0
    loops = [ClosedLoop(trial.scenario, trial.ego, trial.road) for trial in trials]
    assert all(judge(loop, loop.drive(ReferenceFollower(loop))).passed for loop in loops)


def test_such_a_set_is_checked_and_made_again_as_any(bag):
    (found,) = validate_bag(bag)
    assert (found.scenarios, found.invalid) == (3, 0)
    regenerate_scenario(
        bag, read_trials(bag)[-1].scenario.index
    )  # raises if it comes out differently


def test_where_the_ego_does_not_have_to_react_who_has_to_is_said(tmp_path):
    done = generated(
        tmp_path / "none", bundled("b"), "t_intersection", "--ego", "1", "--count", "1"
    )
    said = " ".join(str(done.exception or done.output).split())
    assert (
        done.exit_code != 0
        and "for testing ego 1: 0 of 1 scenarios found in which it has to react" in said
    )
    assert "has to react as ego: 2 in 12 of 12" in said


def test_without_an_ego_it_is_refused(tmp_path):
    done = generated(tmp_path / "none", bundled("b"), "t_intersection")
    assert done.exit_code != 0 and "name the vehicle that the planner replaces" in str(
        done.exception
    )


def test_who_is_committed_does_not_rescue_an_ego_that_looks_at_nobody():
    """A driver with priority brakes for one that crosses out of turn when it looks ahead far enough, and not in time else."""
    witness, other = straight(0.0, -48.0, np.pi / 2, 4.0), straight(-96.0, 0.0, 0.0, 12.0)
    verdicts = {}
    for policy in ("reactive", "committed", "replay"):
        loop = ClosedLoop(
            as_scenario([witness, other], len(witness[1])),
            0,
            config=ClosedLoopConfig(policy=policy),
        )
        verdicts[policy] = judge(loop, loop.drive(ConstantSpeed(speed=6.2)))
    assert (
        verdicts["reactive"].collision is None
        and verdicts["committed"].at_fault
        and verdicts["replay"].at_fault
    )
    assert (
        verdicts["committed"].collision.speed < verdicts["replay"].collision.speed - 0.5
    )  # it brakes, too late


def test_a_set_that_hardly_tests_says_so(tmp_path):
    trials = [Trial(str(k), crossing(), 0, None) for k in range(3)]
    outcomes = run_trials(trials, NonReactive)
    drives = Drives(outcomes, "p:C", ClosedLoopConfig(), baseline=outcomes)
    drives.write(tmp_path)
    said = "the non-reactive baseline passes 3 of 3"
    assert said in drives.easy and said in (tmp_path / "junit.xml").read_text()
    assert (
        [drives.easy in note for note in drives.notes()].count(True)
        == 1
        == "".join(drives.notes()).count("baseline passes")
    )
    assert 'name="policy" value="reactive"' in (tmp_path / "junit.xml").read_text()
