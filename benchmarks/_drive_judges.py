# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Drives before CommonRoad's programs, in the environment that `make judges` installs: its collision checker, its planner."""

from collections.abc import Callable, Sequence
from dataclasses import replace
import json
import math
from pathlib import Path
import tempfile

import numpy as np

from benchmarks.bridges import judged
from benchmarks.row import higher, Row
from scenario_gen.base.errors import RefusedError
from scenario_gen.closed_loop.config import ClosedLoopConfig, REPLAY
from scenario_gen.closed_loop.ego import Pose
from scenario_gen.closed_loop.origin import Trial
from scenario_gen.closed_loop.simulation import ClosedLoop, Observation, State, Task
from scenario_gen.closed_loop.trials import Outcome, rates
from scenario_gen.closed_loop.verdict import judge
from scenario_gen.output.exchange.cases import Case, Exported
from scenario_gen.output.exchange.commonroad import write_commonroad
from scenario_gen.output.exchange.config import ExportConfig
from scenario_gen.output.exchange.derived_lanes import lane_map_of
from scenario_gen.roads import RoadConfig
from scenario_gen.types import split_off

STEP = 0.1  # s, of both
GOAL, SLOW = 3.5, 1.0  # metres from a region's border to its middle, and some; m/s


def contacts(outcomes: Sequence[Outcome]) -> list[int | None] | None:
    """Return the first instant of each drive at which the drivability checker has the ego meet another; None: it is not here."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "drives.jsonl"
        file.write_text("".join(f"{_line(outcome)}\n" for outcome in outcomes))
        found = judged("commonroad", "driven.py", str(file))
    return None if found is None else list(found["contacts"])


def _line(outcome: Outcome) -> str:
    """Return a drive as test/judges/driven.py takes it, the ego first."""
    drive = outcome.drive
    motion, count = drive.motion, len(drive.motion.vehicles)
    order = [drive.ego, *(n for n in range(count) if n != drive.ego)]
    poses = np.concatenate([motion.position, motion.heading[..., None]], axis=2)
    vehicles = [
        {
            "size": [motion.vehicles[n].length, motion.vehicles[n].width],
            "poses": [
                pose if here else None
                for pose, here in zip(poses[n].tolist(), drive.here[n].tolist(), strict=True)
            ],
        }
        for n in order
    ]
    return json.dumps(vehicles)


class Recorded:
    """The ego is where a planner of another program had it; then it goes on straight, or stays.

    CommonRoad's goal is a region, at whose border a planner is done; the goal here is a line through its middle.
    """

    def __init__(self, track: Sequence[Sequence[float]], on: float) -> None:
        """Take the track's x, y [m], yaw [rad], speed [m/s] every `STEP`, and how far it goes on [m]."""
        x, y, yaw, speed = track[-1]
        steps = range(1, int(on / max(speed, SLOW) / STEP) + 2 if on else 1)
        ahead = [max(speed, SLOW) * STEP * k for k in steps]
        self.track = [
            *track,
            *(
                (x + way * math.cos(yaw), y + way * math.sin(yaw), yaw, max(speed, SLOW))
                for way in ahead
            ),
        ]

    def ended(self, state: State) -> bool:
        """Whether the track is at its end."""
        return state.step >= max(len(self.track) - 1, 1)

    def reset(self, task: Task) -> None:
        """Begin."""
        self.step = task.step

    def act(self, seen: Observation) -> Pose:
        """Be where it was next."""
        k = min(round((seen.time + self.step) / STEP), len(self.track) - 1)
        return Pose(*self.track[k])


def reactive_planner(trials: Sequence[Trial], bad: Callable[[], Sequence[Outcome]]) -> list[Row]:
    """Let commonroad-reactive-planner solve the trials as planning problems, and judge its tracks among the replayed others.

    Args:
        trials: what it drives.
        bad: returns what constant speed comes to among replayed others; asked only where the planner is.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        names = {f"problem_{k:03d}.xml": trial for k, trial in enumerate(trials)}
        refused = 0
        for problem, trial in names.items():
            try:
                _write_problem(folder / problem, trial)
            except RefusedError:
                refused += 1  # somebody arrives late, for which the schema has no form
        found = judged("commonroad", "commonroad_files.py", "drive", str(folder))
        if found is None:
            return []
        outcomes = []
        for problem, trial in names.items():
            file = (folder / problem).with_suffix(".track.json")
            if file.is_file():
                loop = ClosedLoop(
                    trial.scenario, trial.ego, trial.road, ClosedLoopConfig(policy=REPLAY)
                )
                on = GOAL if found["outcomes"][problem][0] == "reached" else 0.0
                planner = Recorded(json.loads(file.read_text()), on)
                drive = loop.drive(planner, planner.ended)
                outcomes.append(Outcome(trial.name, judge(loop, drive), drive))
    late = sum(how.startswith("TimeoutError") for how, _ in found["outcomes"].values())
    failed = found["problems"] - late - len(outcomes)
    said = (
        f"2025.1, {found['problems']} problems, {refused} refused, {found['reached']} reached by its own word, "
        f"{late} beyond our limit of time, {failed} ended by its own exception"
    )
    good = rates(outcomes)
    rows = [
        Row(
            f"reactive planner: {what}",
            rate.share.value,
            "",
            "lower" if what != "goals" else "higher",
            None,
            f"{rate}; {said}",
        )
        for what, rate in good.items()
    ]
    worst = rates(bad())["collisions"]
    apart = worst.share.low - good["collisions"].share.high
    name = "collisions among replayed others: constant speed's lower bound less the reactive planner's upper"
    return [*rows, higher(name, apart, "", 0.0, f"constant speed: {worst}")]


def _write_problem(path: Path, trial: Trial) -> None:
    """Write a trial as a CommonRoad file with a planning problem, and the ego's length and width [m] beside it.

    Raises:
        RefusedError: the format has no form for it.
    """
    scenario, export = trial.scenario, ExportConfig()
    ids = [vehicle.id for vehicle in scenario.vehicles]
    others, ego = split_off(
        scenario, trial.ego if isinstance(trial.ego, int) else ids.index(trial.ego)
    )
    one = Exported(
        scenario.index,
        scenario.seed,
        "0" * 64,
        replace(others, reference_drive=None),
        ego,
        driven=True,
    )
    lanes = lane_map_of(trial.road, [scenario], RoadConfig.lane_width, export.run_out)
    path.write_bytes(write_commonroad(Case(1, "", "road", 0, (one,), lanes), one, export)[0])
    (vehicle,) = ego.vehicles
    path.with_suffix(".size.json").write_text(json.dumps([vehicle.length, vehicle.width]))
