# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Mutation score: which single faults of a planner some scenarios catch; and turns that the ego takes."""

import numpy as np
import pytest
from support.driving_scenes import crossing, following

from scenario_gen.bags.recordings.write import write_recording
from scenario_gen.closed_loop.command import drive_bags, DriveRequest
from scenario_gen.closed_loop.ego import Command
from scenario_gen.closed_loop.mutants import COMMANDS, Mutant, MUTANTS, mutation_score
from scenario_gen.closed_loop.origin import Trial
from scenario_gen.closed_loop.planners import ConstantSpeed, IdmFollower, ReferenceFollower
from scenario_gen.closed_loop.simulation import ClosedLoop
from scenario_gen.closed_loop.trials import run_trials
from scenario_gen.closed_loop.verdict import judge
from scenario_gen.logs import read_log
from scenario_gen.method.evaluation import EvaluationConfig
from scenario_gen.pipeline import generate, PipelineConfig


class Records:
    """Keeps what it sees; commands 1 m/s² less than the last step did."""

    def reset(self, task):
        self.seen = []

    def act(self, seen):
        self.seen.append(seen)
        return Command(-float(len(self.seen)), 0.1)


def drive(fault, steps=12):
    """Return what the planner saw, and what the mutant commanded, in a crossing with ego 1."""
    mutant, loop = Mutant(Records, fault), ClosedLoop(crossing(), 1)
    mutant.reset(loop.task())
    states, asked = [loop.start()], []
    for _ in range(steps):
        asked.append(mutant.act(loop.observe(states[-1])))
        states.append(loop.step(states[-1], Command(0.0, 0.0)))
    truth = [loop.observe(state) for state in states]
    return mutant._planner.seen, asked, truth


@pytest.mark.parametrize("fault", MUTANTS)
def test_each_mutant_has_its_fault_only(fault):
    seen, asked, truth = drive(fault)
    late = {"sees others 0.5 s late": 5, "sees others 1 s late": 10}.get(fault, 0)
    sound = [Command(-float(k + 1), 0.1) for k in range(12)]
    if fault in COMMANDS:
        sound = [COMMANDS[fault](command) for command in sound]
    if fault == "acts 0.3 s late":
        sound = [sound[max(k - 3, 0)] for k in range(12)]
    assert asked == sound
    assert [each.ego for each in seen] == [each.ego for each in truth[:12]]
    is_hidden = fault.startswith(("ignores all others", "ignores crossing", "sees 15 m"))
    is_hidden |= fault in ("ignores vehicles on its left", "ignores the nearest vehicle")
    for k, each in enumerate(seen):
        now = truth[max(k - late, 0)]
        assert len(each.ids) == len(each.types) == len(each.others) == (not is_hidden)
        if "m/s" in fault and "km/h" in fault:
            assert each.others[0, 3] in (now.others[0, 3] * 3.6, now.others[0, 3] / 3.6)
        elif late:
            assert np.array_equal(each.others, now.others)


def test_mutants_are_caught_or_survive():
    trials = [
        Trial(name, scenario, 0 if name == "follower" else 1, None)
        for name, scenario in (("follower", following(8.0, 15.0)), ("crossing", crossing()))
    ]
    outcomes = run_trials(trials, lambda: IdmFollower(speed=12.0))
    assert all(outcome.verdict.passed for outcome in outcomes)
    score = mutation_score(trials, lambda: IdmFollower(speed=12.0), outcomes)
    results = {each.fault: each for each in score.results}
    assert list(results) == list(MUTANTS)
    assert score.caught == len(MUTANTS) - sum("survives" in str(each) for each in score.results)
    assert results["ignores all others"].killed_by[0] == "follower"
    assert "never exercise" in str(results["ignores bicycles"])
    assert set(score.smallest_set()) <= {"follower", "crossing"}
    assert score.document()["caught"] == score.caught
    assert any("drives worse" in str(each) for each in score.results)


def test_small_bag_catches_all_mutants(tmp_path):
    """Of two bags; names of the scenarios differ in it, verdicts do not."""
    (encounter,) = read_log("examples/my_log.csv").encounters
    config = PipelineConfig(evaluation=EvaluationConfig(resamples=10))
    made = generate(encounter, "four_way", config, count=4, seed=7)
    for place in ("one", "two"):
        write_recording(tmp_path / place, made)
    planner = "scenario_gen.closed_loop.planners:IdmFollower"
    first, second = (
        drive_bags(DriveRequest(sources, [planner], "2", mutants=True, workers=2), tmp_path / out)
        for sources, out in (
            ([tmp_path / "one", tmp_path / "two"], "out"),
            ([tmp_path / "out" / "mutants"], "again"),
        )
    )
    (all_drives,), (few,) = first.drives, second.drives
    assert few.mutants.caught == all_drives.mutants.caught > 0
    assert len(few.outcomes) == len(all_drives.mutants.smallest_set()) < len(all_drives.outcomes)


def test_taking_anothers_turn_does_not_pass():
    """Vehicle 0 goes first; it brakes for an ego that is early."""
    loop = ClosedLoop(crossing(second_start=-48.0), 1)
    sound = judge(loop, loop.drive(ReferenceFollower(loop)))
    assert sound.passed and sound.imposed_braking == 0.0
    driven = [judge(loop, loop.drive(ConstantSpeed(speed=v))) for v in np.arange(8.0, 30.0, 1.0)]
    assert driven[0].passed
    taken = [verdict for verdict in driven if verdict.failure == "took_turn"]
    assert taken and all("took the turn" in verdict.sentence() for verdict in taken)
    assert all(verdict.imposed_braking >= 4.0 and not verdict.passed for verdict in taken)


@pytest.mark.parametrize(("start", "speed"), [(6.0, 8.0), (9.0, 9.0)])
def test_constant_speed_is_the_stated_one(start, speed):
    """8 m/s, or that at the start if it is higher."""
    loop = ClosedLoop(crossing(second_speed=start, second_start=-48.0), 1)
    drive = loop.drive(ConstantSpeed())
    assert drive.motion.speed[drive.ego, 60] == pytest.approx(speed, abs=0.05)
