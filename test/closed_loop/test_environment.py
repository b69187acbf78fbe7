# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The Gymnasium environment keeps Gymnasium's promises, is deterministic, and runs many at once."""

from gymnasium.utils.env_checker import check_env
from gymnasium.vector import SyncVectorEnv
import numpy as np
import pytest

from benchmarks._driving_worlds import draw_scenario
from scenario_gen.base.errors import InputError
from scenario_gen.closed_loop.environment import DriveEnv
from scenario_gen.closed_loop.trials import Trial

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


@pytest.mark.filterwarnings("ignore:.*bound:UserWarning")
def test_gymnasium_finds_nothing_wrong():
    check_env(DriveEnv(TRIALS), skip_render_check=True)


def test_the_same_seed_gives_the_same_drive():
    (one, verdict), (other, again) = (drive(DriveEnv(TRIALS), 3) for _ in range(2))
    assert (one == other).all() and verdict == again and np.isfinite(one).all()


def test_many_at_once_and_by_index():
    many = SyncVectorEnv([lambda: DriveEnv(TRIALS)] * 3)
    seen, _ = many.reset(seed=1)
    assert seen.shape == (3, 73)
    many.step(many.action_space.sample())
    many.close()
    env = DriveEnv(TRIALS)
    assert env.reset(options={"index": 2})[1]["name"] == "5"
    with pytest.raises(InputError, match="no scenario 3; there are 3"):
        env.reset(options={"index": 3})
