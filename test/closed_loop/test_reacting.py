# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Sets for testing: planners that ignore the others fail, also those that did not choose the set."""

from functools import partial

import numpy as np
import pytest
from support.driving_scenes import crossing
from test_verdict import straight
from typer.testing import CliRunner

from benchmarks._driving_worlds import as_scenario
from scenario_gen.cli.commands import app
from scenario_gen.closed_loop.blind import blind_rate, Course, drive_passes, SpeedLaw
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
from scenario_gen.closed_loop.trials import read_trials, run_trials, trials_of
from scenario_gen.closed_loop.verdict import judge
from scenario_gen.logs.synthetic import bundled
from scenario_gen.output.review.evaluation import evaluate_bag
from scenario_gen.pipeline import generate


class Steady(RouteFollower):
    """Drives at a constant speed, perhaps after a stand, and ignores all others."""

    def __init__(self, speed, stand=0.0):
        self.speed = speed
        self.stand = stand

    def act(self, observation):
        ego = observation.ego
        acceleration = -9.0 if observation.time < self.stand - 1e-9 else self.speed - ego.speed
        return Command(acceleration, self.steer(ego)[0])


class FullThrottle(RouteFollower):
    """Speeds up as much as it can."""

    def act(self, observation):
        return Command(4.0, self.steer(observation.ego)[0])


def generated(out, *words):
    quick = ("--set", "evaluation.resamples=10", "--for-testing", "--out", str(out))
    return CliRunner().invoke(app, ["generate", *words, *quick])


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    """Return the bag of a set from a recorded crossing in which vehicle 2 yields."""
    folder = tmp_path_factory.mktemp("testing")
    words = ("examples/my_log.csv", "--road", "four_way", "--ego", "auto", "--count", "4")
    done = generated(folder / "out", *words, "--seed", "7")
    output = " ".join(done.output.split())
    assert done.exit_code == 0, output
    assert "4 of 4 scenarios for testing" in output, output
    sentence = "my_log on four_way, ego 2: the best of 1728 open-loop speed laws"
    assert sentence in output and sentence in (folder / "out" / "report.html").read_text()
    return folder / "out" / "bag"


def test_blind_planners_fail_looking_ones_pass(bag):
    trials = read_trials(bag)
    assert len(trials) == 4
    blind = [NonReactive, FullThrottle, *(partial(Steady, v) for v in (3.0, 5.0, 8.0, 12.0))]
    for make in blind:
        assert sum(outcome.verdict.passed for outcome in run_trials(trials, make)) <= 1
    assert all(outcome.verdict.passed for outcome in run_trials(trials, IdmFollower))
    loops = [ClosedLoop(trial.scenario, trial.ego, trial.road) for trial in trials]
    assert all(judge(loop, loop.drive(ReferenceFollower(loop))).passed for loop in loops)


def test_idm_follower_passes_ordinary_set():
    made = generate("examples/my_log.csv", "four_way", count=12, seed=7)
    assert all(outcome.verdict.passed for outcome in run_trials(trials_of(made, "2"), IdmFollower))


def test_certified_laws_pass_with_reacting_others(bag):
    laws = [SpeedLaw(wait, speed) for wait in (0.0, 3.0, 8.0, 13.0, 18.0) for speed in (4.0, 8.0)]
    agreed = []
    for trial in read_trials(bag):
        loop = ClosedLoop(trial.scenario, trial.ego, trial.road)
        passes = Course.of(loop).passes(laws)
        agreed += [drive_passes(loop, law) == met for law, met in zip(laws, passes, strict=True)]
    assert np.mean(agreed) > 0.9


def test_such_a_set_is_valid(bag):
    sets = evaluate_bag(bag)
    assert sum(len(each.verdicts) for each in sets) == 4 == sum(each.valid for each in sets)


@pytest.mark.parametrize(
    ("ego", "said"),
    [(["--ego", "1"], "vehicle 1 waits for nobody"), ([], "name the vehicle that")],
)
def test_unsuitable_ego_is_refused(tmp_path, ego, said):
    words = (str(bundled("b")), "--road", "t_intersection", "--count", "1", *ego)
    done = generated(tmp_path / "none", *words)
    assert done.exit_code != 0
    assert said in " ".join(str(done.exception or done.output).split())


def test_committed_vehicle_does_not_rescue_ego():
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
    assert verdicts["reactive"].collision is None
    assert verdicts["committed"].at_fault
    assert verdicts["replay"].at_fault
    assert (
        verdicts["committed"].collision.speed < verdicts["replay"].collision.speed - 0.5
    )  # it brakes, too late


def test_best_blind_planner_is_in_results(tmp_path):
    trials = [Trial(str(k), crossing(), 0, None) for k in range(3)]
    rate = blind_rate([ClosedLoop(trial.scenario, trial.ego) for trial in trials])
    outcomes = run_trials(trials, NonReactive)
    drives = Drives(outcomes, "p:C", ClosedLoopConfig(), baseline=outcomes, blind=rate)
    drives.write(tmp_path)
    assert rate.passed == 3 and str(rate).startswith("these scenarios hardly test a planner")
    assert str(rate) in drives.notes() and str(rate) in (tmp_path / "junit.xml").read_text()
    assert drives.document()["best_blind"]["passed"] == 3
    assert 'name="policy" value="reactive"' in (tmp_path / "junit.xml").read_text()
