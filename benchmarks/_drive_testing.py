# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Sets that discriminate: of natural scenarios those that need a reaction, as `generate --for-testing` keeps them."""

from collections.abc import Callable, Sequence
from typing import Literal

from benchmarks.row import Row
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.ego import Command
from scenario_gen.closed_loop.origin import Trial
from scenario_gen.closed_loop.planners import (
    ConstantSpeed,
    IdmFollower,
    NonReactive,
    ReferenceFollower,
)
from scenario_gen.closed_loop.reacting import needs_reaction
from scenario_gen.closed_loop.simulation import ClosedLoop, Observation, Planner
from scenario_gen.closed_loop.verdict import judge


class FullThrottle(ConstantSpeed):
    """Accelerates as long as it may."""

    def act(self, observation: Observation) -> Command:
        """Steer as constant speed does."""
        return Command(3.0, super().act(observation).curvature)


def discriminating(trials: Sequence[Trial]) -> list[Row]:
    """Measure on those of the trials that need a reaction; the speeds are not those that chose them."""
    loops = [
        ClosedLoop(trial.scenario, trial.ego, trial.road, ClosedLoopConfig()) for trial in trials
    ]
    kept = [loop for loop in loops if needs_reaction(loop)]
    planners: dict[
        str, tuple[Callable[[ClosedLoop], Planner], float, Literal["higher", "lower"]]
    ] = {
        "non-reactive baseline": (lambda _: NonReactive(), 0.9, "higher"),
        "7 m/s, looks at nobody": (lambda _: ConstantSpeed(speed=7.0), 0.6, "higher"),
        "full throttle, looks at nobody": (lambda _: FullThrottle(), 0.6, "higher"),
        "IDM follower": (lambda _: IdmFollower(), 0.1, "lower"),
        "reference drive": (ReferenceFollower, 0.0, "lower"),
    }
    rows = []
    for name, (planner, asked, better) in planners.items():
        failed = len([loop for loop in kept if not judge(loop, loop.drive(planner(loop))).passed])
        said = f"{failed} of {len(kept)} scenarios that need a reaction, of {len(trials)} natural ones"
        rows.append(
            Row(
                f"for testing, {name}: share failed",
                failed / max(len(kept), 1),
                "",
                better,
                asked,
                said,
            )
        )
    return rows
