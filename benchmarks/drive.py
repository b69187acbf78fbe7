# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Closed loop: planners, the witness as ego, random egos, throughput, and lock-step over DDS.

About 8 minutes of CPU time; `--count` is the number of drives of each planner. The checker's rows
need `make judges`, the peer's `make bench`.
"""

from collections.abc import Callable, Sequence
import os
import sys
from time import process_time

import numpy as np

from benchmarks._drive_others import braking_jerks, rear_ends
from benchmarks._drive_peers import contacts, highway_env
from benchmarks._driving_worlds import Anything, draw_scenario, Witness
from benchmarks._sampling_cases import cases, Prepared
from benchmarks._size import sized
from benchmarks.row import higher, lower, Row
from scenario_gen.closed_loop.blind import blind_rate
from scenario_gen.closed_loop.config import ClosedLoopConfig, REACTIVE, REPLAY
from scenario_gen.closed_loop.drive import Drive
from scenario_gen.closed_loop.ego import Command, Pose
from scenario_gen.closed_loop.origin import Trial
from scenario_gen.closed_loop.planners import (
    ConstantSpeed,
    IdmFollower,
    NonReactive,
    ReferenceFollower,
)
from scenario_gen.closed_loop.reacting import Testing
from scenario_gen.closed_loop.simulation import ClosedLoop, Observation, Planner, State
from scenario_gen.closed_loop.trials import Outcome, rates, run_trials
from scenario_gen.closed_loop.verdict import judge
from scenario_gen.logs import read_log
from scenario_gen.method.evaluation.distributions import wilson
from scenario_gen.numerics.arrays import Floats
from scenario_gen.pipeline import PipelineConfig
from scenario_gen.types import join_ego, Request
from scenario_gen.types.generation import GenerationResult
from scenario_gen.types.road import Road

PLANNERS = "scenario_gen.closed_loop.planners"
WITNESSES_COUNT = sized(1000, quick=4)
TESTING_COUNT = sized(50, quick=2)
"""Scenarios for testing."""
RUNS_COUNT = sized(10_000, quick=5)
CHECKED_COUNT = sized(600, quick=5)
"""Drives of random egos whose collisions are checked."""
FAR = Pose(1e4, 1e4, 0.0, 0.0)
MAX_STEPS_COUNT = 3000
"""Steps after which others without an ego count as stuck."""


class FullThrottle(ConstantSpeed):
    """Accelerates as much as it may."""

    def act(self, observation: Observation) -> Command:
        """Steer as constant speed does."""
        return Command(3.0, super().act(observation).curvature)


BLIND: dict[str, tuple[Callable[[ClosedLoop], Planner], float]] = {
    "non-reactive baseline": (lambda _: NonReactive(), 0.9),
    "7 m/s, blind": (lambda _: ConstantSpeed(speed=7.0), 0.9),
    "full throttle, blind": (lambda _: FullThrottle(), 0.9),
}
"""Planners that must fail, with the least share of failures."""
SIGHTED: dict[str, tuple[Callable[[ClosedLoop], Planner], float]] = {
    "IDM follower": (lambda _: IdmFollower(), 0.1),
    "reference drive": (ReferenceFollower, 0.0),
}
"""Planners that must pass, with the largest share of failures."""


def run(count: int = sized(200, quick=2)) -> list[Row]:
    """Measure; `count` drives of each planner."""
    trials, result = recorded(max(WITNESSES_COUNT, count))
    rows, driven = list[Row](), list[Outcome]()
    if trials:
        rows, driven = planners(spread(trials, count))
        rows += for_testing(TESTING_COUNT)
        rows += witnesses(spread(trials, WITNESSES_COUNT))
    found, wild = anything()
    rows += [*found, *rear_ends(), *collisions([*driven, *wild])]
    return [*rows, *speed(), *gymnasium_steps(), *dds(result)]


def recorded(count: int) -> tuple[list[Trial], GenerationResult | None]:
    """Return scenarios of every recorded encounter with each vehicle as ego, and one result."""
    prepared = [case for case in cases() if isinstance(case, Prepared)]
    trials: list[Trial] = []
    result = None
    for case in prepared:
        vehicles = len(case.encounter.vehicles)
        found = case.sample(max(1, -(-count // max(len(prepared) * vehicles, 1))))
        if result is None or vehicles == 4:
            result = GenerationResult(
                case.encounter, case.segmentation, case.road, case.fit, case.routes, found
            )
        for scenario in found.scenarios:
            for ego in range(vehicles):
                name = f"{case.name} on {case.road_name} {scenario.index} {ego}"
                trials.append(Trial(name, scenario, ego, case.road, case.name))
    return trials, result


def after(steps: int) -> Callable[[State], bool]:
    """End a drive after this number of steps."""
    return lambda state: state.step >= steps


def spread(trials: list[Trial], count: int) -> list[Trial]:
    """Return this number of trials, spread over all."""
    chosen = np.unique(np.linspace(0, len(trials) - 1, count).round().astype(int))
    return [trials[k] for k in chosen.tolist()]


def planners(trials: list[Trial]) -> tuple[list[Row], list[Outcome]]:
    """Return the rates of constant speed and of the follower, and their drives."""
    rows, driven = list[Row](), list[Outcome]()
    for name in ("ConstantSpeed", "IdmFollower"):
        outcomes = run_trials(trials, f"{PLANNERS}:{name}")
        driven += outcomes
        for measure, rate in rates(outcomes).items():
            row = higher if measure == "goals" else lower
            rows.append(row(f"{name}: {measure}", rate.share.value, "", None, str(rate)))
    return rows, driven


def for_testing(count: int) -> list[Row]:
    """Drive a set that `generate --for-testing` makes from a recorded crossing."""
    encounter = read_log("examples/my_log.csv").encounters[0]
    testing = Testing(encounter, "four_way", PipelineConfig(), Request(ego="2"), 7)
    loops = [
        ClosedLoop(join_ego(scenario), "2", result.road)
        for result in testing.run(count).results
        for scenario in result.generated.scenarios
    ]
    rows = []
    for row, group in ((higher, BLIND), (lower, SIGHTED)):
        for name, (planner, target) in group.items():
            verdicts = [judge(loop, loop.drive(planner(loop))) for loop in loops]
            share = sum(not verdict.passed for verdict in verdicts) / len(loops)
            scenarios = f"{len(loops)} of {count} scenarios"
            rows.append(row(f"for testing, {name}: failed", share, "", target, scenarios))
    best = blind_rate(loops)
    if best is not None:
        rows.append(
            lower("for testing, best speed law: passed", best.passed / best.driven, "", 0.1)
        )
    return rows


def witnesses(trials: list[Trial]) -> list[Row]:
    """Drive the witness as ego, in replay and reactive."""
    rows = []
    for policy in (REPLAY, REACTIVE):
        hits = off_road = missed = 0
        deviation = 0.0
        for trial in trials:
            scenario, ego = trial.scenario, int(trial.ego)
            loop = ClosedLoop(scenario, ego, trial.road, ClosedLoopConfig(policy=policy))
            drive = loop.drive(Witness(scenario, ego), after(len(scenario.time) - 1))
            verdict = judge(loop, drive)
            hits += verdict.collision is not None or verdict.among_others > 0
            off_road += not np.isnan(verdict.off_road)
            missed += bool(np.isnan(verdict.goal))
            distance = np.abs(drive.motion.position - scenario.position).max()
            deviation = max(deviation, 100.0 * float(distance))
        name, drives = f"witness as ego, {policy}", f"{len(trials)} drives"
        rows += [
            lower(f"{name}: collisions", hits, "", 0.0, drives),
            lower(f"{name}: off the road", off_road, "", 0.0),
            lower(f"{name}: goal not reached", missed, "", 0.0),
            lower(f"{name}: distance from the certified motion", deviation, "cm", 5.0),
        ]
    return rows


def anything() -> tuple[list[Row], list[Outcome]]:
    """Drive drawn scenarios with random egos, which then leave; also return the first drives."""
    contacts_count = stuck = 0
    forced = 0
    outcomes, jerks = list[Outcome](), list[Floats]()
    for seed in range(RUNS_COUNT):
        scenario = draw_scenario(seed)
        loop = ClosedLoop(scenario, seed % len(scenario.vehicles))
        drive = loop.drive(Anything(seed), after(len(scenario.time) // 2 + seed % 50))
        verdict = judge(loop, drive)
        contacts_count += verdict.among_others
        forced += verdict.forced > 0
        if len(outcomes) < CHECKED_COUNT:
            outcomes.append(Outcome(str(seed), verdict, drive))
        jerks.append(braking_jerks(scenario, drive))
        stuck += _is_stuck(loop, Anything(seed))
    jerk = np.concatenate(jerks)
    high_jerk = float(np.percentile(jerk, 99)) if len(jerk) else 0.0
    share = wilson(forced, RUNS_COUNT, 0.95)
    bounds, runs = f"{share.low:.4f} to {share.high:.4f}", f"{RUNS_COUNT} runs"
    rows = [
        lower("random ego: contacts among the others", contacts_count, "", 0.0, runs),
        lower("random ego: runs in which others are stuck", stuck, "", 0.0, runs),
        lower("random ego: runs with forced braking", share.value, "", None, bounds),
        lower("others' braking jerk, 99th percentile", high_jerk, "m/s³", 10.0),
    ]
    return rows, outcomes


def _is_stuck(loop: ClosedLoop, planner: Anything) -> bool:
    """Whether the others cannot end their motions after an ego of 4 s has left."""
    state = loop.start()
    planner.reset(loop.task())
    for _ in range(40):
        state = loop.step(state, planner.act(loop.observe(state)))
    others = [i for i in range(len(loop.scenario.vehicles)) if i != loop.ego]
    for _ in range(MAX_STEPS_COUNT):
        if (state.clock[others] >= loop.scenario.time[-1]).all():
            return False
        state = loop.step(state, FAR)
    return True


def collisions(outcomes: list[Outcome]) -> list[Row]:
    """Compare the verdict's collisions with those at every millisecond and the checker's."""
    lacking, unseen = dense(outcomes)
    drives = f"{len(outcomes)} drives"
    rows = [
        lower("collisions at 1 ms that the verdict lacks", lacking, "", 0.0, drives),
        lower("collisions of the verdict that no microsecond shows", unseen, "", 0.0, drives),
    ]
    theirs = contacts(outcomes)
    if theirs is not None:
        pairs = zip(theirs, outcomes, strict=True)
        missed = sum(k is not None and one.verdict.collision is None for k, one in pairs)
        name = "collisions of the drivability checker that the verdict lacks"
        rows.append(lower(name, missed, "", 0.0, drives))
    return rows


def dense(outcomes: list[Outcome]) -> tuple[int, int]:
    """Compare with separating axes at every millisecond.

    Returns:
        The collisions that the verdict lacks, and those that it has alone.
    """
    lacking = unseen = 0
    for outcome in outcomes:
        drive, verdict = outcome.drive, outcome.verdict.collision
        hit = seen_at(drive)
        lacking += hit is not None and (verdict is None or verdict.time > hit + 1e-3)
        if verdict is not None and (hit is None or hit > verdict.time + 2e-3):
            step = min(int(verdict.time / drive.motion.time[1] + 1e-9), len(drive.motion.time) - 2)
            unseen += seen_at(drive, (step,), 1e-6) is None
    return lacking, unseen


def seen_at(
    drive: Drive, looked_at: Sequence[int] | None = None, every: float = 1e-3
) -> float | None:
    """First instant [s] at which the ego's box overlaps another's, by plain numpy on the motion, in some steps or in all.

    A jump is no motion: nobody is met on its way.
    """
    motion, ego = drive.motion, drive.ego
    first = None
    for i in range(len(motion.vehicles)):
        steps = np.setdiff1d(
            np.flatnonzero(drive.present[i][:-1] & drive.present[i][1:]),
            np.subtract(drive.jumps, 1),
        )
        if looked_at is not None:
            steps = np.intersect1d(steps, looked_at)
        if i == ego or not len(steps):
            continue
        near = np.hypot(*(motion.position[i] - motion.position[ego]).T)
        moved = np.linalg.norm(np.diff(motion.position[[i, ego]], axis=1), axis=2).sum(axis=0)
        reach = (
            15.0
            + moved
            + motion.speed[[i, ego]].max(axis=1).sum() * (motion.time[1] - motion.time[0])
        )
        steps = steps[near[steps] < reach[steps]]
        if not len(steps):
            continue
        a, b = (instants(drive, n, steps, every) for n in (ego, i))
        hits = overlapping(
            a,
            b,
            motion.vehicles[ego].length,
            motion.vehicles[ego].width,
            motion.vehicles[i].length,
            motion.vehicles[i].width,
        )
        if hits.any():
            k, m = (int(v[0]) for v in np.nonzero(hits))
            at = float(motion.time[steps[k]] + every * m)
            first = at if first is None else min(first, at)
    return first


def instants(drive: Drive, n: int, steps: np.ndarray, every: float) -> Floats:
    """Poses (S, M, 3) of a vehicle at short intervals [s] of some steps: cubic position, linear heading."""
    motion = drive.motion
    h = float(motion.time[1] - motion.time[0])
    u = (np.arange(round(h / every) + 1) / round(h / every))[None, :, None]
    p, q = motion.position[n][steps][:, None], motion.position[n][steps + 1][:, None]
    yaw = motion.heading[n]
    way = motion.speed[n][:, None] * np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
    v, w = way[steps][:, None], way[steps + 1][:, None]
    xy = (
        (1 + 2 * u) * (1 - u) ** 2 * p
        + u * (1 - u) ** 2 * h * v
        + u * u * (3 - 2 * u) * q
        + u * u * (u - 1) * h * w
    )
    turn = yaw[steps][:, None] + u[..., 0] * (yaw[steps + 1] - yaw[steps])[:, None]
    return np.concatenate([xy, turn[..., None]], axis=-1)


def overlapping(a: Floats, b: Floats, la: float, wa: float, lb: float, wb: float) -> np.ndarray:
    """Whether boxes at poses (..., 3) overlap. Source: separating axes."""
    offset = b[..., :2] - a[..., :2]
    apart = np.zeros(a.shape[:-1], dtype=np.bool_)
    for yaw in (a[..., 2], a[..., 2] + np.pi / 2, b[..., 2], b[..., 2] + np.pi / 2):
        c, s = np.cos(yaw), np.sin(yaw)
        reach = np.zeros_like(yaw)
        for pose, length, width in ((a, la, wa), (b, lb, wb)):
            turn = yaw - pose[..., 2]
            reach += 0.5 * (length * np.abs(np.cos(turn)) + width * np.abs(np.sin(turn)))
        apart |= np.abs(offset[..., 0] * c + offset[..., 1] * s) >= reach
    return ~apart


def speed() -> list[Row]:
    """Measure vehicle-steps per CPU second in process, with a planner that costs nothing."""
    rows = []
    for vehicles in (2, 4):
        drawn = [draw_scenario(seed, vehicles) for seed in range(sized(20, quick=1))]
        loops = [ClosedLoop(one, 0) for one in drawn if len(one.vehicles) == vehicles]
        best = 0.0
        for _ in range(3):
            began, steps = process_time(), 0
            for loop in loops:
                steps += loop.drive(Witness(loop.scenario, 0), after(60)).present.size
            best = max(best, steps / (process_time() - began))
        rows.append(higher(f"reactive, {vehicles} vehicles", best, "vehicle-steps/s", 40_000.0))
        rows += highway_env(vehicles)
    return rows


def gymnasium_steps() -> list[Row]:
    """Measure steps per CPU second of the Gymnasium environment on a road of 600 m by 600 m."""
    try:
        from scenario_gen.closed_loop.environment import DriveEnv
    except ImportError as error:
        print(f"the Gymnasium environment is not measured: {error}", file=sys.stderr)
        return []
    free, none = np.ones((3000, 3000), dtype=np.bool_), np.zeros((0, 3))
    road = Road("large", free, 0.2, np.array((-300.0, -300.0)), none, none)
    trials = [Trial(str(seed), draw_scenario(seed), 0, road) for seed in range(1, 13)]
    environment = DriveEnv(trials)
    best, action = 0.0, np.array((0.1, 0.0), dtype=np.float32)
    for _ in range(4):  # the first prepares the scenarios
        began, steps = process_time(), 0
        for index in range(sized(12, quick=2)):
            environment.reset(options={"index": index})
            over = False
            while not over:
                _, _, terminated, truncated, _ = environment.step(action)
                over = terminated or truncated
                steps += 1
        best = max(best, steps / (process_time() - began))
    return [higher("Gymnasium environment", best, "steps/s", 3_000.0, "12 scenarios")]


def dds(result: GenerationResult | None) -> list[Row]:
    """Measure lock-step over DDS, where rclpy is installed."""
    try:
        import rclpy  # noqa: F401
    except ImportError:
        print("no rclpy: nothing is measured over DDS", file=sys.stderr)
        return []
    if result is None:
        return []
    from benchmarks._drive_dds import lock_step

    vehicles = len(result.encounter.vehicles)
    faster, cpu = lock_step(result, sized(300, quick=3))
    load = f"{vehicles} vehicles at 10 Hz, load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores"
    return [
        higher("lock-step over DDS", faster, "× real time", 20.0, load),
        lower("CPU time of a step, node and client", cpu, "ms", 5.0, "100 ms of the drive"),
    ]
