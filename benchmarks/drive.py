# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Closed loop: what planners come to, the witness as ego, egos that do anything, throughput, lock-step over DDS.

About 8 minutes of CPU time; `--count` is the number of drives of each of our planners; the reactive planner gets three fifths
of them: with a fifth even no collision would not tell it from constant speed. 12 minutes more for it.
Counts of every row stand beside it. The judges' rows need `make judges`, the peer's `make bench`.
"""

from collections.abc import Callable, Sequence
from functools import partial
import os
import sys
from time import process_time

import numpy as np

from benchmarks._drive_judges import contacts, reactive_planner
from benchmarks._drive_others import braking_jerks, rear_ends
from benchmarks._drive_peers import highway_env, sumo
from benchmarks._drive_testing import discriminating
from benchmarks._driving_worlds import Anything, draw_scenario, Witness
from benchmarks._sampling_cases import cases, Prepared
from benchmarks._size import sized
from benchmarks.row import higher, lower, Row
from scenario_gen.closed_loop.config import ClosedLoopConfig, REACTIVE, REPLAY
from scenario_gen.closed_loop.ego import Pose
from scenario_gen.closed_loop.origin import Trial, units_of
from scenario_gen.closed_loop.results import Drives
from scenario_gen.closed_loop.simulation import ClosedLoop, Drive, State
from scenario_gen.closed_loop.trials import Outcome, rates, run_trials
from scenario_gen.closed_loop.verdict import judge
from scenario_gen.method.evaluation.bootstrap import paired_difference, wilson
from scenario_gen.numerics.arrays import Floats
from scenario_gen.types.generation import GenerationResult
from scenario_gen.types.road import Road

PLANNERS = "scenario_gen.closed_loop.planners"
BAD, GOOD = f"{PLANNERS}:ConstantSpeed", f"{PLANNERS}:IdmFollower"
WITNESSES = sized(1000, quick=4)
TRIED = sized(400, quick=2)  # natural scenarios of which those that need a reaction are driven
RUNS = sized(10_000, quick=5)
KEPT = sized(600, quick=5)  # drives of egos that do anything, that are looked at for collisions
FAR = Pose(1e4, 1e4, 0.0, 0.0)
LATE = 15.0  # seconds beyond what the certified motion still needs
PATIENCE = 3000  # steps after which others that the ego has left alone count as stuck


def run(count: int = sized(200, quick=2)) -> list[Row]:
    """Measure; `count` drives of each planner."""
    trials, made = recorded(max(WITNESSES, count))
    rows: list[Row] = []
    driven: list[Outcome] = []
    if trials:
        found, driven = planners(spread(trials, count))
        bad = partial(run_trials, trials, BAD, ClosedLoopConfig(policy=REPLAY))
        rows += found + discriminating(spread(trials, TRIED))
        rows += reactive_planner(spread(trials, max(3 * count // 5, 1)), bad) + witnesses(
            spread(trials, WITNESSES)
        )
    found, wild = anything()
    return (
        rows
        + found
        + rear_ends()
        + collisions([*driven, *wild])
        + speed()
        + gymnasium_steps()
        + dds(made)
    )


def recorded(count: int) -> tuple[list[Trial], GenerationResult | None]:
    """Scenarios of every recorded encounter on every road that takes it, each vehicle in turn the ego's; and one result."""
    prepared = [case for case in cases() if isinstance(case, Prepared)]
    trials: list[Trial] = []
    made = None
    for case in prepared:
        each = max(1, -(-count // max(len(prepared) * len(case.encounter.vehicles), 1)))
        found = case.sample(each)
        if made is None or len(case.encounter.vehicles) == 4:
            made = GenerationResult(
                case.encounter, case.segmentation, case.road, case.fit, case.routes, found
            )
        for scenario in found.scenarios:
            for ego in range(len(scenario.vehicles)):
                name = f"{case.name} on {case.road_name} {scenario.index} {ego}"
                trials += [Trial(name, scenario, ego, case.road, case.name)]
    return trials, made


def after(steps: int) -> Callable[[State], bool]:
    """End a drive after so many steps."""
    return lambda state: state.step >= steps


def spread(trials: list[Trial], count: int) -> list[Trial]:
    """Return so many of the trials, spread over all."""
    return [
        trials[k]
        for k in np.unique(np.linspace(0, len(trials) - 1, count).round().astype(int)).tolist()
    ]


def planners(trials: list[Trial]) -> tuple[list[Row], list[Outcome]]:
    """What constant speed and the follower come to, the same bytes in two runs and for two workers; and their drives."""
    bad, good = (run_trials(trials, name) for name in (BAD, GOOD))
    found = {"constant speed": rates(bad), "IDM follower": rates(good)}
    rows = [
        Row(
            f"{name}: {what}",
            rate.share.value,
            "",
            "lower" if what != "goals" else "higher",
            None,
            str(rate),
        )
        for name, each in found.items()
        for what, rate in each.items()
    ]
    unit, encounters = units_of([one.name for one in bad], [one.origin for one in bad])
    more = [
        float(a.verdict.collision is not None) - (b.verdict.collision is not None)
        for a, b in zip(bad, good, strict=True)
    ]
    share = paired_difference(np.array(more), unit, 0.95)
    said = f"{share.value:.3f}, {share.low:.3f} to {share.high:.3f}; {encounters} encounters"
    rows.append(
        higher(
            "collisions: constant speed's less IDM's on the same scenarios, lower bound",
            share.low,
            "",
            0.0,
            said,
        )
    )
    again = run_trials(trials[:40], GOOD, workers=2)
    config = ClosedLoopConfig()
    same = Drives(good[:40], GOOD, config).json() == Drives(again, GOOD, config).json()
    rows.append(higher("same bytes in a second run, with two workers", float(same), "", 1.0))
    return rows, [*bad, *good]


def collisions(outcomes: list[Outcome]) -> list[Row]:
    """The verdict's collisions beside those at every millisecond, and those of the drivability checker at every instant."""
    lacking, brief, beyond = dense(outcomes)
    hits = sum(outcome.verdict.collision is not None for outcome in outcomes)
    of = f"{len(outcomes)} drives, {hits} with a collision"
    rows = [
        lower("collisions at 1 ms that the verdict lacks", float(lacking), "", 0.0, of),
        lower("collisions of the verdict that no millisecond shows", float(brief), "", None, of),
        lower(
            "collisions of the verdict that no microsecond of their step shows either",
            float(beyond),
            "",
            0.0,
            of,
        ),
    ]
    theirs = contacts(outcomes)
    if theirs is not None:
        both = list(zip(theirs, outcomes, strict=True))
        missed = sum(k is not None and one.verdict.collision is None for k, one in both)
        late = sum(
            k is not None
            and one.verdict.collision is not None
            and one.verdict.collision.time > 0.1 * k + 1e-3
            for k, one in both
        )
        said = f"commonroad-drivability-checker 2025.4.0: {sum(k is not None for k in theirs)} of {len(theirs)} drives"
        rows += [
            lower(
                "collisions of the drivability checker that the verdict lacks",
                float(missed),
                "",
                0.0,
                said,
            ),
            lower("collisions that it has earlier than the verdict", float(late), "", 0.0, said),
        ]
    return rows


def dense(outcomes: list[Outcome]) -> tuple[int, int, int]:
    """Compare with separating axes at every millisecond.

    Returns:
        Collisions that the verdict lacks; those that it has and no millisecond shows, for a contact may be shorter; and those of
        them that no microsecond of their own step shows either.
    """
    lacking = brief = beyond = 0
    for outcome in outcomes:
        drive, verdict = outcome.drive, outcome.verdict.collision
        hit = seen_at(drive)
        lacking += hit is not None and (verdict is None or verdict.time > hit + 1e-3)
        if verdict is not None and (hit is None or hit > verdict.time + 2e-3):
            brief += 1
            own = min(int(verdict.time / drive.motion.time[1] + 1e-9), len(drive.motion.time) - 2)
            beyond += seen_at(drive, (own,), 1e-6) is None
    return lacking, brief, beyond


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
            np.flatnonzero(drive.here[i][:-1] & drive.here[i][1:]), np.subtract(drive.jumps, 1)
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


def witnesses(trials: list[Trial]) -> list[Row]:
    """The witness as ego, in replay and reactive."""
    rows = []
    for policy in (REPLAY, REACTIVE):
        hits = off = missed = 0
        deviation = 0.0
        for trial in trials:
            scenario, ego = trial.scenario, int(trial.ego)
            loop = ClosedLoop(scenario, ego, trial.road, ClosedLoopConfig(policy=policy))
            drive = loop.drive(Witness(scenario, ego), after(len(scenario.time) - 1))
            verdict = judge(loop, drive)
            hits += verdict.collision is not None or verdict.among_others > 0
            off += verdict.off_road == verdict.off_road
            missed += verdict.goal != verdict.goal
            deviation = max(
                deviation, float(np.abs(drive.motion.position - scenario.position).max())
            )
        name = f"witness as ego, {policy}"
        of = f"{len(trials)} drives"
        rows += [
            lower(f"{name}: collisions", float(hits), "", 0.0, of),
            lower(f"{name}: off the road", float(off), "", 0.0, of),
            lower(f"{name}: goal not reached", float(missed), "", 0.0, of),
            lower(
                f"{name}: largest distance from the certified motion",
                100.0 * deviation,
                "cm",
                5.0,
                of,
            ),
        ]
    return rows


def anything() -> tuple[list[Row], list[Outcome]]:
    """Drawn scenarios of 2 to 5 vehicles with egos that do anything, then leave; and the first of these drives."""
    met = stuck = forced = late = 0
    kept: list[Outcome] = []
    jerks: list[Floats] = []
    for seed in range(RUNS):
        scenario = draw_scenario(seed)
        ego = seed % len(scenario.vehicles)
        loop, planner = ClosedLoop(scenario, ego), Anything(seed)
        steps = len(scenario.time) // 2 + seed % 50
        drive = loop.drive(planner, after(steps))
        verdict = judge(loop, drive)
        met += verdict.among_others
        if len(kept) < KEPT:
            kept.append(Outcome(str(seed), verdict, drive))
        forced += verdict.forced > 0
        jerks.append(braking_jerks(scenario, drive))
        state = loop.start()
        planner.reset(loop.task())
        for _ in range(40):
            state = loop.step(state, planner.act(loop.observe(state)))
        others = [i for i in range(len(scenario.vehicles)) if i != ego]
        rest = float((scenario.time[-1] - state.clock[others]).max())
        for k in range(PATIENCE):
            if (state.clock[others] >= scenario.time[-1]).all():
                late += k * loop.config.step > rest + LATE
                break
            state = loop.step(state, FAR)
        else:
            stuck += 1
    jerk = np.concatenate(jerks)
    hardest = float(np.percentile(jerk, 99)) if len(jerk) else 0.0
    bounds = wilson(forced, RUNS, 0.95)
    said = f"{forced} of {RUNS}, {100 * bounds.low:.1f} to {100 * bounds.high:.1f} %"
    rows = [
        lower(
            "ego doing anything: contacts among the others", float(met), "", 0.0, f"{RUNS} runs"
        ),
        lower(
            "ego doing anything: runs with a circle without the ego",
            float(stuck),
            "",
            0.0,
            f"{RUNS} runs",
        ),
        lower(
            f"ego doing anything: runs with a vehicle more than {LATE:g} s late after it",
            float(late),
            "",
            0.0,
            f"{RUNS} runs",
        ),
        lower(
            "ego doing anything: runs with braking that the order forced",
            bounds.value,
            "",
            None,
            said,
        ),
        lower(
            "others' braking jerk, 99th percentile", hardest, "m/s³", 10.0, f"{len(jerk)} steps"
        ),
    ]
    return rows, kept


def speed() -> list[Row]:
    """Vehicle-steps per CPU second in process, the ego among them, with a planner that costs nothing."""
    rows = []
    for vehicles in (2, 4):
        drawn = [draw_scenario(seed, vehicles) for seed in range(sized(20, quick=1))]
        loops = [
            ClosedLoop(scenario, 0) for scenario in drawn if len(scenario.vehicles) == vehicles
        ]
        best = 0.0
        for _ in range(3):
            began, steps = process_time(), 0
            for loop in loops:
                drive = loop.drive(Witness(loop.scenario, 0), after(60))
                steps += drive.here.size
            best = max(best, steps / (process_time() - began))
        rows.append(
            higher(f"in process, reactive, {vehicles} vehicles", best, "vehicle-steps/s", 40_000.0)
        )
        rows += [*highway_env(vehicles), *sumo(vehicles)]
    return rows


def gymnasium_steps() -> list[Row]:
    """Steps per CPU second of the Gymnasium environment on one large road, where gymnasium is."""
    try:
        from scenario_gen.closed_loop.environment import DriveEnv
    except ImportError as error:
        print(f"the Gymnasium environment is not measured: {error}", file=sys.stderr)
        return []
    none = np.zeros((0, 3))
    road = Road(
        "large", np.ones((3000, 3000), dtype=np.bool_), 0.2, np.array((-300.0, -300.0)), none, none
    )
    environment = DriveEnv(
        [Trial(str(seed), draw_scenario(seed), 0, road) for seed in range(1, 13)]
    )
    best, action = 0.0, np.array((0.1, 0.0), dtype=np.float32)
    for _ in range(4):  # the first prepares the scenarios
        began, steps = process_time(), 0
        for index in range(sized(12, quick=2)):
            environment.reset(options={"index": index})
            over = False
            while not over:
                _, _, terminated, truncated, _ = environment.step(action)
                over, steps = terminated or truncated, steps + 1
        best = max(best, steps / (process_time() - began))
    return [
        higher(
            "Gymnasium environment, road of 600 m by 600 m",
            best,
            "steps/s",
            3_000.0,
            "12 scenarios",
        )
    ]


def dds(made: GenerationResult | None) -> list[Row]:
    """Lock-step and real time over DDS, where rclpy is."""
    try:
        import rclpy  # noqa: F401
    except ImportError:
        print("no rclpy: nothing is measured over DDS", file=sys.stderr)
        return []
    if made is None:
        return []
    from benchmarks._drive_dds import lock_step, real_time

    count = len(made.encounter.vehicles)
    faster, used = lock_step(made, sized(300, quick=3))
    late = real_time(made, sized(200, quick=10))
    load = f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores"
    return [
        higher(
            f"lock-step over DDS, {count} vehicles at 10 Hz", faster, "× real time", 20.0, load
        ),
        lower("CPU time of such a step, node and client", used, "ms", 5.0, "100 ms of the drive"),
        lower("real time, 99th percentile of the period's error", late, "ms", 10.0, load),
    ]
