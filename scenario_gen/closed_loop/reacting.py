# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The scenarios that test a planner: one that looks at nobody collides in them, and a simple one that looks passes."""

from collections.abc import Sequence
from dataclasses import replace

from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.planners import IdmFollower, Unlooking, WitnessFollower
from scenario_gen.closed_loop.simulation import ClosedLoop
from scenario_gen.closed_loop.verdict import judge
from scenario_gen.types import GenerationResult, join_ego, Scenario

TRIED = 20  # valid scenarios that are tried at most for each one that is wanted
UNLOOKING = 50  # scenarios of a set that are driven to say how many need no reaction
PROBED = 12  # scenarios by which it is told who has to react
EASY = 0.9  # share of a set that the baseline passes, from which on the set hardly tests


def needs_reaction(loop: ClosedLoop) -> bool:
    """Whether the baseline that looks at nobody collides, while the witness and a follower that looks pass."""
    if judge(loop, loop.drive(Unlooking())).collision is None:
        return False
    references = (WitnessFollower(loop), IdmFollower(speed=loop.task().speed))
    return all(judge(loop, loop.drive(reference)).passed for reference in references)


def reactions(case: GenerationResult, scenarios: Sequence[Scenario], config: ClosedLoopConfig) -> dict[str, int]:
    """Return for each vehicle of a case, by id, in how many scenarios it has to react if it is the ego; the most first."""
    whole = [join_ego(scenario) for scenario in scenarios]
    ids = [vehicle.id for vehicle in case.encounter.vehicles]
    loops = {one: [ClosedLoop(scenario, one, case.road, config) for scenario in whole] for one in ids}
    return dict(sorted({one: sum(map(needs_reaction, loops[one])) for one in ids}.items(), key=lambda item: -item[1]))


def who_reacts(case: GenerationResult, config: ClosedLoopConfig = ClosedLoopConfig()) -> str:
    """Return the id of the vehicle that has to react in most scenarios of a case.

    Raises:
        RefusedError: none has to in any.
    """
    found = reactions(case, case.generated.scenarios, config)
    ego = next(iter(found))
    if not found[ego]:
        raise RefusedError(
            f"--ego auto: in none of {len(case.generated.scenarios)} scenarios has a vehicle to react; name one by --ego, or "
            "take another road, or an encounter in which somebody yields or follows"
        )
    return ego


def unlooking_pass(case: GenerationResult, config: ClosedLoopConfig = ClosedLoopConfig()) -> str:
    """Say how many scenarios of a set (UNLOOKING at most) one that looks at nobody passes; "" if no vehicle was left out."""
    drawn = case.generated
    if drawn.ego is None or not drawn.scenarios:
        return ""
    ego = drawn.ego.vehicle.id
    loops = [ClosedLoop(join_ego(scenario), ego, case.road, config) for scenario in drawn.scenarios[:UNLOOKING]]
    passed = sum(judge(loop, loop.drive(Unlooking())).passed for loop in loops)
    road = case.road.name if case.road is not None else "its road"
    said = f"{case.encounter.name} on {road}: a planner that looks at nobody, in place of {ego}, passes {passed} of {len(loops)}"
    return f"{said}: they hardly test one" if passed > EASY * len(loops) else said


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
        raise InputError(f"--for-testing: name the vehicle in whose place the planner drives by --ego, or auto; there are {ids}")
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
        "that looks at nobody does not collide, or a simple one that looks fails"
    )
    if len(kept) < count:
        probed = drawn.scenarios[:PROBED]
        others = {one: found for one, found in reactions(sampled, probed, config).items() if found and one != ego}
        better = ", ".join(f"{one} in {found} of {len(probed)}" for one, found in others.items())
        note += (
            f"; has to react as ego: {better}"
            if better
            else "; nor has another vehicle: take another road or encounter, or `search`, where the ego's own motion varies, too"
        )
    chosen = replace(
        drawn, requested=count, scenarios=tuple(kept), adaptations=(*drawn.adaptations, note), chosen=tried
    )  # fmt: skip
    return replace(sampled, generated=chosen)
