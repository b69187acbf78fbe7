# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Vehicle-steps per CPU second of highway-env, where it is installed: one step of the simulation for each of ours."""

from time import process_time

from benchmarks._size import sized
from benchmarks.row import Row

STEPS = sized(300, quick=5)


def highway_env(vehicles: int) -> list[Row]:
    """Measure `highway-v0` with as many vehicles as ours, at 10 Hz, nothing drawn, the ego going on."""
    try:
        import gymnasium
        import highway_env
    except ImportError:
        return []
    gymnasium.register_envs(highway_env)
    config = {"vehicles_count": vehicles - 1, "simulation_frequency": 10, "policy_frequency": 10, "duration": 10_000}
    env = gymnasium.make("highway-v0", config=config)
    best = 0.0
    for seed in range(3):
        env.reset(seed=seed)
        began = process_time()
        done = 0
        for _ in range(STEPS):
            _, _, ended, cut, _ = env.step(1)  # idle
            done += len(env.unwrapped.road.vehicles)
            if ended or cut:
                env.reset()
        best = max(best, done / (process_time() - began))
    env.close()
    return [Row(f"highway-env, {vehicles} vehicles", best, "vehicle-steps/s", "higher", None, "highway-v0, kinematics observed")]
