# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The Gymnasium environment keeps Gymnasium's promises, is deterministic, and runs many at once."""

import gymnasium
from gymnasium.utils.env_checker import check_env
import numpy as np
import pytest
from support.bag_examples import hand_made_run
from support.driving_scenes import following
from support.motions import road_of

from benchmarks._driving_worlds import draw_scenario
from scenario_gen.base.errors import InputError
from scenario_gen.closed_loop.environment import DriveEnv, ID
from scenario_gen.closed_loop.origin import Trial

TRIALS = [Trial(str(seed), draw_scenario(seed), 0, None) for seed in (1, 2, 5)]


def drive(env, seed):
    """Drive with random actions to the end; return all that was seen, and the verdict."""
    seen, info = env.reset(seed=seed)
    actions = np.random.default_rng(seed)
    rows, over = [seen], False
    while not over:
        action = actions.uniform(-1.0, 1.0, 2).astype(np.float32)
        seen, _, terminated, truncated, info = env.step(action)
        rows.append(seen)
        over = terminated or truncated
    return np.stack(rows), info["verdict"]


@pytest.mark.filterwarnings("error::UserWarning")
def test_gymnasium_finds_nothing_wrong():
    env = gymnasium.make(ID, trials=TRIALS)
    assert env.spec.id == ID
    assert np.isfinite(env.observation_space.low).all()
    assert np.isfinite(env.observation_space.high).all()
    check_env(env.unwrapped)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_infinite_actions_are_refused(bad):
    env = DriveEnv(TRIALS)
    env.reset(seed=1)
    with pytest.raises(InputError, match="must be finite"):
        env.step(np.array((bad, 0.0), dtype=np.float32))


def test_gymnasium_makes_vectors_of_it():
    many = gymnasium.make_vec(ID, 2, "sync", trials=TRIALS)
    first, _ = many.reset(seed=3)
    again, _ = many.reset(seed=3)
    assert first.shape == (2, 73) and (first == again).all()
    assert np.isfinite(many.step(many.action_space.sample())[0]).all()
    many.close()


def test_same_seed_gives_same_drive():
    env = DriveEnv(TRIALS)
    (one, verdict), (other, again) = (drive(env, 3) for _ in range(2))
    assert (one == other).all()
    assert verdict == again
    assert all(env.observation_space.contains(row) for row in one)
    assert env.reset(options={"index": 2})[1]["name"] == "5"
    with pytest.raises(InputError, match="no scenario with index 3"):
        env.reset(options={"index": 3})


def test_it_drives_in_results_and_bags(tmp_path):
    made = hand_made_run()
    by_bag = DriveEnv(made.save(tmp_path / "bag"), ego="1")
    by_result = DriveEnv(made, ego="1")
    (one, _), (other, _) = (drive(env, 3) for env in (by_bag, by_result))
    assert (one == other).all()


@pytest.mark.parametrize("edge", [0.05, 0.5])
def test_off_road_agrees_with_the_verdict(edge):
    """A footprint that is outside by less than counts goes on."""
    scenario = following(8.0, 20.0)  # along y = 0
    corner = np.array((-200.0, edge - 0.5 * scenario.vehicles[0].width))
    road = road_of(np.ones((400, 400), dtype=bool), 1.0, corner)
    env = DriveEnv([Trial("edge", scenario, 0, road)])
    env.reset(seed=1)
    _, reward, terminated, _, info = env.step(np.array((-1.0, 0.0), dtype=np.float32))
    assert terminated == (edge > 0.1) == (reward < -90.0)
    assert not terminated or info["verdict"]["off_road"] is not None
