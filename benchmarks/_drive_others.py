# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The others as drivers: how suddenly they brake, and how often they run into an ego that brakes ahead of them."""

from dataclasses import replace

import numpy as np

from benchmarks._driving_worlds import as_scenario, PERIOD
from benchmarks._size import sized
from benchmarks.row import lower, Row
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.drive import Drive
from scenario_gen.closed_loop.ego import Command
from scenario_gen.closed_loop.simulation import ClosedLoop
from scenario_gen.numerics.arrays import Floats
from scenario_gen.types.scenario import Scenario

DRIVES = sized(200, quick=4)  # of each row
GAPS = (0.5, 1.0, 1.5, 2.0)  # seconds between the vehicles
BRAKINGS = (4.0, 9.0)  # of the ego [m/s²]


def braking_jerks(scenario: Scenario, drive: Drive) -> Floats:
    """Jerk [m/s³, positive where braking grows] of the others in each step in which they brake for somebody.

    What the certified motion does by itself at that place is no reaction: of the jerk with and without it the smaller one counts.
    """
    step, found = float(drive.motion.time[1]), []
    for i in range(len(drive.motion.vehicles)):
        if i == drive.ego:
            continue
        speed = drive.motion.speed[i]
        certified = np.interp(drive.clock[i], scenario.time, scenario.speed[i])
        rate = np.divide(speed, certified, out=np.ones_like(speed), where=certified > 0.0)
        acceleration, own = np.diff(speed) / step, rate[:-1] * np.diff(certified) / step
        jerk = np.minimum(-np.diff(acceleration), -np.diff(acceleration - own)) / step
        here = drive.present[i][:-2] & drive.present[i][1:-1] & drive.present[i][2:]
        found.append(
            jerk[here & (acceleration[1:] < -0.1) & (np.abs(acceleration - own)[1:] > 0.1)]
        )
    return np.concatenate([np.empty(0), *found])


def behind(speed: float, gap: float, seed: int) -> Scenario:
    """One vehicle so many metres behind another, both at one speed [m/s]."""
    time = np.arange(150) * PERIOD
    zero, v = np.zeros_like(time), np.full_like(time, speed)
    ways = [start + speed * time for start in (0.0, gap + 4.25)]
    return replace(
        as_scenario([(np.stack([way, zero], axis=1), zero, v) for way in ways], len(time)),
        seed=seed,
    )


def runs_into(scenario: Scenario, braking: float, config: ClosedLoopConfig) -> bool:
    """Whether the follower runs into an ego that brakes to a stand after 1 s."""
    loop = ClosedLoop(scenario, 1, config=config)
    state = loop.start()
    for k in range(120):
        state = loop.step(state, Command(-braking if k >= 10 else 0.0, 0.0))
        if loop.hit(state):
            return True
    return False


def rear_ends() -> list[Row]:
    """Return how often followers hit an ego that brakes, by time gap."""
    rows = []
    for braking in BRAKINGS:
        for gap in GAPS:
            speeds = np.linspace(5.0, 20.0, DRIVES).tolist()
            scenarios = [behind(speed, speed * gap, k) for k, speed in enumerate(speeds)]
            config = ClosedLoopConfig()
            hits = sum(runs_into(scenario, braking, config) for scenario in scenarios)
            name = f"follower {gap:g} s behind an ego that brakes by {braking:g} m/s²: hits it"
            rows.append(lower(name, 100.0 * hits / DRIVES, "%", None, f"{DRIVES} drives"))
    return rows
