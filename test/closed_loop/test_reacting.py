# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Sets for testing: planners that look at nobody fail in them, others than those by which they were chosen, too."""

from driving_scenes import crossing
import numpy as np
import pytest
from test_verdict import straight
from typer.testing import CliRunner

from benchmarks._driving_worlds import as_scenario
from scenario_gen.cli.commands import app
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.ego import Command
from scenario_gen.closed_loop.origin import Trial
from scenario_gen.closed_loop.planners import ConstantSpeed, IdmFollower, RouteFollower, Unlooking, WitnessFollower
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


def generated(out, *words):
    quick = ("--set", "evaluation.resamples=10")
    command = ["generate", str(bundled("b")), "--road", "t_intersection", "--count", "3", "--for-testing", *quick]
    return CliRunner().invoke(app, [*command, *words, "--out", str(out)])


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    out = tmp_path_factory.mktemp("testing") / "out"
    done = generated(out, "--ego", "auto")
    assert done.exit_code == 0 and "3 of 3 scenarios" in done.output, done.output
    said = "synthetic_b on t_intersection: a planner that looks at nobody, in place of 2, passes"
    assert said in " ".join(done.output.split()) and said in (out / "report.html").read_text()
    return out / "bag"


def test_who_looks_at_nobody_fails_and_who_looks_passes(bag):
    trials = read_trials(bag)
    assert len(trials) == 3
    planners = {"baseline": Unlooking, "fast": FullThrottle, "looks": IdmFollower}
    failed = {name: sum(not one.verdict.passed for one in run_trials(trials, make)) for name, make in planners.items()}
    assert failed["baseline"] == 3 and failed["fast"] >= 2 and failed["looks"] == 0
    loops = [ClosedLoop(trial.scenario, trial.ego, trial.road) for trial in trials]
    assert all(judge(loop, loop.drive(WitnessFollower(loop))).passed for loop in loops)


def test_such_a_set_is_checked_and_made_again_as_any(bag):
    (found,) = validate_bag(bag)
    assert (found.scenarios, found.invalid) == (3, 0)
    regenerate_scenario(bag, read_trials(bag)[-1].scenario.index)  # raises if it comes out differently


def test_what_does_not_need_a_reaction_is_left_out_and_said(tmp_path):
    done = generated(tmp_path / "none", "--ego", "1", "--count", "1")
    said = " ".join(str(done.exception or done.output).split())
    assert done.exit_code != 0 and "0 of 20 valid scenarios are kept; in the other 20 a planner that looks at nobody" in said
    assert "has to react as ego: 2 in " in said


def test_without_an_ego_it_is_refused(tmp_path):
    done = generated(tmp_path / "none")
    assert done.exit_code != 0 and "name the vehicle in whose place the planner drives" in str(done.exception)


def test_who_is_committed_does_not_rescue_an_ego_that_looks_at_nobody():
    """A driver with priority brakes for one that crosses out of turn when it looks ahead far enough, and not in time else."""
    witness, other = straight(0.0, -48.0, np.pi / 2, 4.0), straight(-96.0, 0.0, 0.0, 12.0)
    verdicts = {}
    for policy in ("reactive", "committed", "replay"):
        loop = ClosedLoop(as_scenario([witness, other], len(witness[1])), 0, config=ClosedLoopConfig(policy=policy))
        verdicts[policy] = judge(loop, loop.drive(ConstantSpeed(speed=6.2)))
    assert verdicts["reactive"].collision is None and verdicts["committed"].at_fault and verdicts["replay"].at_fault
    assert verdicts["committed"].collision.speed < verdicts["replay"].collision.speed - 0.5  # it brakes, too late


def test_a_set_that_hardly_tests_says_so(tmp_path):
    trials = [Trial(str(k), crossing(), 0, None) for k in range(3)]
    outcomes = run_trials(trials, Unlooking)
    drives = Drives(outcomes, "p:C", ClosedLoopConfig(), unlooking=outcomes)
    drives.write(tmp_path)
    said = "one that looks at nobody passes 3 of 3"
    assert said in drives.easy and said in (tmp_path / "junit.xml").read_text() and drives.easy in drives.notes()
    assert 'name="policy" value="reactive"' in (tmp_path / "junit.xml").read_text()
