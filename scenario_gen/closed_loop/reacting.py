# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The scenarios in which the ego has to react: those in which planners that look at nobody collide, all of them."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.planners import ConstantSpeed, Unlooking, WitnessFollower
from scenario_gen.closed_loop.simulation import ClosedLoop, Planner
from scenario_gen.closed_loop.verdict import judge
from scenario_gen.types import GenerationResult, join_ego, Scenario

TRIED = 20  # valid scenarios that are tried at most for each one that is wanted
LOOK_AT_NOBODY: tuple[Callable[[], Planner], ...] = (
    partial(ConstantSpeed, speed=8.0),
    Unlooking,
    partial(Unlooking, speed=13.0),
    partial(ConstantSpeed, speed=6.0),
)
"""Planners that look at nobody: at 6 to 13 m/s, with and without slowing down in bends."""


def needs_reaction(loop: ClosedLoop) -> bool:
    """Whether every planner of LOOK_AT_NOBODY collides, and the witness passes."""
    unlooking = all(judge(loop, loop.drive(make())).collision is not None for make in LOOK_AT_NOBODY)
    return unlooking and judge(loop, loop.drive(WitnessFollower(loop))).passed


def reacting(sampled: GenerationResult, count: int, config: ClosedLoopConfig = ClosedLoopConfig()) -> GenerationResult:
    """Return a result with the first `count` of its scenarios that need a reaction, and an account of those left out.

    Args:
        sampled: with as many scenarios as may be tried.
        count: how many are wanted.
        config: how the others react.
    """
    drawn = sampled.generated
    ego = drawn.ego.vehicle.id if drawn.ego is not None else sampled.encounter.vehicles[0].id
    kept: list[Scenario] = []
    tried = 0
    for scenario in drawn.scenarios:
        if len(kept) >= count:
            break
        tried += 1
        if needs_reaction(ClosedLoop(join_ego(scenario), ego, sampled.road, config)):
            kept.append(scenario)
    note = (
        f"for testing ego {ego}: {len(kept)} of {tried} valid scenarios are kept; in the other {tried - len(kept)} a planner "
        "that looks at nobody does not collide"
    )
    chosen = replace(
        drawn, requested=count, scenarios=tuple(kept), adaptations=(*drawn.adaptations, note), chosen=tried
    )  # fmt: skip
    return replace(sampled, generated=chosen)
