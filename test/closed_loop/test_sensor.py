# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Observation as in a car: late, noisy, as far as the sensor reaches, and not through others and walls."""

import json
from xml.etree import ElementTree

import numpy as np
import pytest
from support.bag_examples import hand_made_run
from support.driving_scenes import crossing

from benchmarks._driving_worlds import as_scenario, draw_scenario
from scenario_gen.closed_loop.config import ClosedLoopConfig, ObservationConfig
from scenario_gen.closed_loop.ego import Command
from scenario_gen.closed_loop.environment import DriveEnv
from scenario_gen.closed_loop.origin import Trial
from scenario_gen.closed_loop.results import Drives
from scenario_gen.closed_loop.simulation import ClosedLoop
from scenario_gen.closed_loop.trials import run_trials, trials_of
from scenario_gen.types import Road

KEEP = Command(0.0, 0.0)
IDM = "scenario_gen.closed_loop.planners:IdmFollower"


def loop_of(scenario, road=None, **observation):
    config = ClosedLoopConfig(observation=ObservationConfig(**observation))
    return ClosedLoop(scenario, 0, road, config)


def states_of(loop, count):
    states = [loop.start()]
    for _ in range(count):
        states.append(loop.step(states[-1], KEEP))
    return states


def parked(*places):
    """Vehicles that stand at places [m], all with yaw 0; the first one is the ego."""
    motions = [(np.tile(place, (20, 1)), np.zeros(20), np.zeros(20)) for place in places]
    return as_scenario(motions, 20)


def test_others_are_seen_late():
    loop = loop_of(crossing(), delay=3)
    states = states_of(loop, 8)
    for k, state in enumerate(states):
        seen = loop.observe(state)
        assert (seen.others == states[max(k - 3, 0)].vehicles[1:]).all()
        assert seen.ego == state.ego and seen.time == state.time
        assert len(state.past) == min(k, 3) and not any(past.past for past in state.past)


def test_noise_depends_on_seed_and_step():
    loop = loop_of(crossing(), position_noise=0.5, speed_noise=0.2, seed=3)
    states = states_of(loop, 60)
    errors = np.array([loop.observe(s).others[0] - s.vehicles[1] for s in states])
    assert np.abs(errors[:, 2]).max() == 0.0
    assert errors[:, :2].std() == pytest.approx(0.5, rel=0.25)
    assert errors[:, 3].std() == pytest.approx(0.2, rel=0.35)
    again = loop_of(crossing(), position_noise=0.5, speed_noise=0.2, seed=3)
    assert (again.observe(states[7]).others == loop.observe(states[7]).others).all()
    other = loop_of(crossing(), position_noise=0.5, speed_noise=0.2, seed=4)
    assert (other.observe(states[7]).others != loop.observe(states[7]).others)[:, :2].all()


def test_nothing_is_seen_beyond_the_range():
    loop = loop_of(parked((0.0, 0.0), (20.0, 0.0), (41.0, 0.0)), range=40.0)
    assert loop.observe(loop.start()).ids == ("v1",)


def test_vehicles_and_walls_hide_others():
    places = ((0.0, 0.0), (10.0, 0.0), (20.0, 0.0), (20.0, 6.0))
    loop = loop_of(parked(*places), occlusion=True)
    assert loop.observe(loop.start()).ids == ("v1", "v3")  # 2 stands behind 1

    no = np.zeros((0, 3))
    drivable = np.ones((40, 80), dtype=np.bool_)
    drivable[22:38, 30:32] = False  # a wall from y = 2 m to 18 m, 2 m thick
    road = Road("r", drivable, 1.0, np.array((-20.0, -20.0)), no, no)
    pair = parked((0.0, 10.0), (20.0, 10.0))
    for setback, ids in ((0.0, ()), (2.5, ("v1",))):
        loop = loop_of(pair, road, occlusion=True, setback=setback)
        assert loop.observe(loop.start()).ids == ids


def test_the_environment_shows_the_same_observation():
    trial = Trial("0", draw_scenario(5), 0, None)
    config = ClosedLoopConfig(observation=ObservationConfig(range=0.5))
    env = DriveEnv([trial], config)
    seen, _ = env.reset(seed=1)
    full, _ = DriveEnv([trial]).reset(seed=1)
    assert (seen[17:] == 0.0).all() and full[17] == 1.0 and (seen[:17] == full[:17]).all()


def test_files_state_observation_for_any_workers(tmp_path):
    config = ClosedLoopConfig(observation=ObservationConfig(2, 0.3, 0.5, 7, 60.0, occlusion=True))
    run = hand_made_run()
    trials = trials_of(run, run.encounter.vehicles[0].id)[:2]
    texts = []
    for workers in (1, 2):
        result = Drives(run_trials(trials, IDM, config, workers), IDM, config, trials)
        result.write(tmp_path)
        texts.append((tmp_path / "drives.json").read_text())
    assert texts[0] == texts[1]
    stated = "delay 2 steps, noise 0.3 m and 0.5 m/s (seed 7), range 60 m, occlusion"
    assert json.loads(texts[0])["observation"].startswith(stated)
    suite = ElementTree.parse(tmp_path / "junit.xml").getroot()
    values = [each.get("value") for each in suite.findall("properties/property")]
    assert any(value.startswith(stated) for value in values)
