# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Certified scenarios of a few vehicles that cross, follow and wait, drawn from a seed; and egos that do anything."""

from collections.abc import Sequence

import numpy as np

from scenario_gen.closed_loop.ego import Command, Pose
from scenario_gen.closed_loop.simulation import Observation, Task
from scenario_gen.method.validity import Checker
from scenario_gen.numerics.arrays import Floats
from scenario_gen.types import Vehicle
from scenario_gen.types.scenario import Scenario

PERIOD = 0.1
Motion = tuple[Floats, Floats, Floats]  # positions (T, 2) [m], yaw (T,) [rad], speed (T,) [m/s]
Lane = tuple[float, float, float]  # yaw [rad], curvature [1/m], first station [m]


def speeds(rng: np.random.Generator, steps: int) -> Floats:
    """Draw a speed profile (steps,): pieces of speeding up and braking, and stands."""
    v, out = float(rng.uniform(0.0, 14.0)), list[float]()
    while len(out) < steps:
        length = int(rng.integers(8, 40))
        a = float(rng.choice([0.0, rng.uniform(-4.0, 3.0), -5.0 if v > 3.0 else 2.0]))
        for _ in range(length):
            out.append(v)
            v = min(max(v + a * PERIOD, 0.0), 16.0)
    return np.array(out[:steps])


def vehicle_motion(rng: np.random.Generator, steps: int, lane: Lane | None) -> Motion:
    """Drive along a straight line or an arc that passes near the middle, or along a lane that others use, too."""
    v = speeds(rng, steps)
    way = np.concatenate([[0.0], np.cumsum(0.5 * PERIOD * (v[1:] + v[:-1]))])
    if lane is not None:
        yaw0, bend, start = lane
        start = start - float(rng.uniform(0.0, 60.0))
    else:
        yaw0, bend = (
            float(rng.uniform(-np.pi, np.pi)),
            float(rng.choice([0.0, rng.uniform(-0.03, 0.03)])),
        )
        start = -float(rng.uniform(0.2, 0.8) * way[-1])
    s = start + way
    yaw = yaw0 + bend * s
    if bend == 0.0:
        xy = np.stack([s * np.cos(yaw0), s * np.sin(yaw0)], axis=1)
    else:
        xy = np.stack(
            [(np.sin(yaw) - np.sin(yaw0)) / bend, (np.cos(yaw0) - np.cos(yaw)) / bend], axis=1
        )
    return xy, yaw, v


def draw_scenario(seed: int, vehicles: int | None = None, tries: int = 400) -> Scenario:
    """Return a scenario in which nobody overlaps, proven by the checker; vehicles that would overlap are drawn again."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 6)) if vehicles is None else vehicles
    steps = int(rng.integers(60, 160))
    checker = Checker(None, None, None, None)
    lane = (float(rng.uniform(-np.pi, np.pi)), float(rng.choice([0.0, 0.01])), -20.0)
    made: list[Motion] = []
    for _ in range(tries):
        trial = [*made, vehicle_motion(rng, steps, lane if rng.random() < 0.5 else None)]
        candidate = as_scenario(trial, steps, seed)
        if not [v for v in checker.check([candidate])[0].violations if v.cause == "overlap"]:
            made = trial
        if len(made) == count:
            break
    return as_scenario(made, steps, seed)


def as_scenario(motions: Sequence[Motion], steps: int, seed: int = 0) -> Scenario:
    """Put motions (xy, yaw, speed) on one clock."""
    xy, yaw, v = (np.stack(each) for each in zip(*motions, strict=True))
    ids = tuple(Vehicle(f"v{k}", 4.0 + 0.5 * (k % 3), 1.8) for k in range(len(motions)))
    return Scenario(
        ids,
        np.arange(steps, dtype=np.float64) * PERIOD,
        xy,
        yaw,
        v,
        np.gradient(v, PERIOD, axis=1),
        seed=seed,
    )


class Witness:
    """The ego does what the witness did."""

    def __init__(self, scenario: Scenario, ego: int) -> None:
        self.scenario, self.ego = scenario, ego

    def reset(self, task: Task) -> None:
        """Begin."""
        self.step = task.step

    def act(self, seen: Observation) -> Pose:
        """Be where the witness is next."""
        s, k = self.scenario, round((seen.time + self.step) / PERIOD)
        k = min(k, len(s.time) - 1)
        x, y = s.position[self.ego, k].tolist()
        return Pose(x, y, float(s.heading[self.ego, k]), float(s.speed[self.ego, k]))


class Anything:
    """The ego drives at random, stops, goes back and forth, jumps onto the others, says nothing or nonsense."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.kind = int(self.rng.integers(6))

    def reset(self, task: Task) -> None:
        """Begin."""
        self.task, self.held = task, Command(0.0, 0.0)

    def act(self, seen: Observation) -> Command | Pose | None:
        """Do something."""
        rng, ego = self.rng, seen.ego
        if rng.random() < 0.1:
            self.held = Command(float(rng.uniform(-9.0, 4.0)), float(rng.uniform(-0.2, 0.2)))
        if self.kind == 0:
            return self.held
        if self.kind == 1:
            return Command(-float(rng.uniform(1.0, 9.0)), 0.0)
        if self.kind == 2:  # the wrong way along its route
            route = self.task.route[::-1]
            k = min(int(seen.time * 10), len(route) - 1)
            x, y, yaw = route[k].tolist()
            return Pose(x, y, yaw, 8.0)
        if self.kind == 3 and len(seen.ids):  # into the way of one of the others
            x, y, yaw, _ = seen.others[int(seen.time) % len(seen.ids)].tolist()
            return Pose(
                x + 7.0 * np.cos(yaw),
                y + 7.0 * np.sin(yaw),
                yaw + float(rng.uniform(-1.0, 1.0)),
                0.0,
            )
        if self.kind == 4:
            k = int(rng.integers(4))
            return (
                None,
                Command(float("nan"), 0.0),
                Pose(ego.x, float("inf"), 0.0, 0.0),
                self.held,
            )[k]
        x, y, yaw = (rng.uniform(-1.0, 1.0, 3) * (40.0, 40.0, 3.0)).tolist()
        return self.held if rng.random() < 0.5 else Pose(x, y, yaw, 5.0)
