# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Peers of the closed loop: highway-env's throughput, and CommonRoad's collision checker."""

from collections.abc import Sequence
import json
from pathlib import Path
import sys
import tempfile
from time import process_time
from typing import Any

import numpy as np

from benchmarks._size import sized
from benchmarks.bridges import judged
from benchmarks.row import higher, Row
from scenario_gen.closed_loop.drive import Drive
from scenario_gen.closed_loop.trials import Outcome

STEPS_COUNT = sized(300, quick=5)


def contacts(outcomes: Sequence[Outcome]) -> list[int | None] | None:
    """Return the drivability checker's first contact in each drive; None if it is not installed."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "drives.jsonl"
        lines = (json.dumps(_vehicles(outcome.drive)) for outcome in outcomes)
        file.write_text("".join(f"{line}\n" for line in lines))
        found = judged("commonroad", "driven.py", str(file))
    return None if found is None else list(found["contacts"])


def _vehicles(drive: Drive) -> list[dict[str, Any]]:
    """Return the input of test/judges/driven.py, the ego first."""
    motion = drive.motion
    others = [n for n in range(len(motion.vehicles)) if n != drive.ego]
    poses = np.concatenate([motion.position, motion.heading[..., None]], axis=2).tolist()
    return [
        {
            "size": [motion.vehicles[n].length, motion.vehicles[n].width],
            "poses": [
                p if here else None for p, here in zip(poses[n], drive.present[n], strict=True)
            ],
        }
        for n in (drive.ego, *others)
    ]


def highway_env(vehicles: int) -> list[Row]:
    """Measure `highway-v0` with the same number of vehicles at 10 Hz, nothing drawn."""
    try:
        import gymnasium
        import highway_env
    except ImportError as error:
        print(f"highway-env is not measured: {error}", file=sys.stderr)
        return []
    gymnasium.register_envs(highway_env)
    rates = {"simulation_frequency": 10, "policy_frequency": 10, "duration": 10_000}
    env = gymnasium.make("highway-v0", config=rates | {"vehicles_count": vehicles - 1})
    best = 0.0
    for seed in range(3):
        env.reset(seed=seed)
        began, done = process_time(), 0
        for _ in range(STEPS_COUNT):
            _, _, ended, cut, _ = env.step(1)  # idle
            done += len(env.unwrapped.road.vehicles)
            if ended or cut:
                env.reset()
        best = max(best, done / (process_time() - began))
    env.close()
    return [higher(f"highway-env, {vehicles} vehicles", best, "vehicle-steps/s")]
