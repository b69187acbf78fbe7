# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The scenarios in which the ego has to react: those in which one that looks at nobody collides, at any usual speed."""

from dataclasses import replace

from scenario_gen.base.errors import InputError
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.planners import ConstantSpeed, Unlooking, WitnessFollower
from scenario_gen.closed_loop.simulation import ClosedLoop
from scenario_gen.closed_loop.verdict import judge
from scenario_gen.types import GenerationResult, join_ego, Scenario

TRIED = 20  # valid scenarios that are tried at most for each one that is wanted
UNLOOKING = 50  # scenarios of a set that are driven to say how many need no reaction
SPEEDS = (8.0, 6.0, 10.0)  # m/s of planners that look at nobody, or those of their starts, if higher


def needs_reaction(loop: ClosedLoop) -> bool:
    """Whether a planner that looks at nobody collides at each of SPEEDS, and the witness passes."""
    drives = (loop.drive(ConstantSpeed(speed=speed)) for speed in SPEEDS)
    return (
        all(judge(loop, drive).collision is not None for drive in drives)
        and judge(loop, loop.drive(WitnessFollower(loop))).passed
    )


def unlooking_pass(case: GenerationResult, config: ClosedLoopConfig = ClosedLoopConfig()) -> str:
    """Say how many scenarios of a set (UNLOOKING at most) one that looks at nobody passes; "" if no vehicle was left out."""
    drawn = case.generated
    if drawn.ego is None or not drawn.scenarios:
        return ""
    ego = drawn.ego.vehicle.id
    loops = [ClosedLoop(join_ego(scenario), ego, case.road, config) for scenario in drawn.scenarios[:UNLOOKING]]
    passed = sum(judge(loop, loop.drive(Unlooking())).passed for loop in loops)
    road = case.road.name if case.road is not None else "its road"
    return f"{case.encounter.name} on {road}: a planner that looks at nobody, in place of {ego}, passes {passed} of {len(loops)}"


def reacting(sampled: GenerationResult, count: int, config: ClosedLoopConfig = ClosedLoopConfig()) -> GenerationResult:
    """Return a result with the first `count` of its scenarios that need a reaction, and an account of those left out.

    Args:
        sampled: with as many scenarios as may be tried.
        count: how many are wanted.
        config: how the others react.

    Raises:
        InputError: no vehicle was left out for a planner.
    """
    drawn = sampled.generated
    if drawn.ego is None:
        ids = ", ".join(vehicle.id for vehicle in sampled.encounter.vehicles)
        raise InputError(f"--for-testing: name the vehicle in whose place the planner drives by --ego; there are {ids}")
    ego = drawn.ego.vehicle.id
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
