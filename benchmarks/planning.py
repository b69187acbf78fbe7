# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Planning: RRT*-Connect against the true optimum and against OMPL's planners, in one process, seeds interleaved, CPU time.

A query is timed whole, as a caller sees it: checks, trees, path and string pulling; OMPL likewise from its set-up to its
path (`solve()` ends at its first one). OMPL has our compiled exact edge check as its motion validator; the rows that say "state
by state" give it what its Python users give it, a callback per state with the checking resolution of one cell. For first paths
neither side simplifies. Cached per road are the clearance field and the cell lists made from it.
"""

from collections import defaultdict
from functools import partial
from operator import lt
import os
from pathlib import Path
from statistics import median
from time import process_time
from typing import Any

import numpy as np

from benchmarks._planning_judge import is_drivable
from benchmarks._planning_maps import (
    clutter,
    enters_blocked,
    lane,
    optimum,
    recorded_maps,
    road_of,
    t_intersection,
)
from benchmarks._planning_obstructed import CAR, dubins_length, first_path, obstructed, rrt_connect
from benchmarks._size import sized
from benchmarks.row import higher, lower, Row
from scenario_gen.base.errors import RefusedError
from scenario_gen.base.road_users import Dynamics
from scenario_gen.method.routing import plan_routes, PlanningConfig
from scenario_gen.method.routing.search.car_planner import PoseRrtStarConnect
from scenario_gen.method.routing.search.disc_planner import (
    PAPER,
    RrtStarConnect,
    RrtStarConnectConfig,
)
from scenario_gen.method.routing.search.ompl.solve import exact_plane, plane, PLANNERS, solve
from scenario_gen.method.routing.search.planner import (
    Budget,
    BudgetSpentError,
    path_length,
    plan_with_retry,
    Query,
)
from scenario_gen.numerics.arrays import Floats
from scenario_gen.numerics.distance_field import distance_transform
from scenario_gen.roads.connectivity import FreeSpace
from scenario_gen.types import Vehicle
from scenario_gen.types.fit import Fit, FittedVehicle
from scenario_gen.types.road import Road
from scenario_gen.types.scenario import BoundaryStates

SEEDS = sized(20, quick=1)
BUDGETS = sized((0.01, 0.1, 1.0), quick=(0.01,))  # [s] of CPU time
FEW, MORE, MANY = sized(
    (20_000, 100_000, 1_000_000), quick=(8000, 9000, 10_000)
)  # iterations of one tree
QUERIES, QUERIES_OF_A_MAP = sized((100_000, 500), quick=(100, 2))
MAPS = sized(None, quick=1)
TURNS = sized(10, quick=2)
OBSTRUCTED, MEASURED = sized(
    (200, 40), quick=(2, 1)
)  # feasible roads, and those of them on which lengths are compared
WITHIN = 1.0  # [s] of CPU time to solve a road
STEP = RrtStarConnectConfig(step=5.0, pull=False)
OWN_STEP = RrtStarConnectConfig(pull=False)
DATA = Path(
    os.environ.get("SCENARIO_GEN_DATA", Path(__file__).resolve().parents[2] / "shared" / "data")
)
Case = tuple[Road, Floats, float]


def run() -> list[Row]:
    """All figures."""
    cases: dict[str, Case] = {}
    for road, ends in (lane(), t_intersection(), clutter()):
        cases[road.name] = road, ends, optimum(road, ends)
        _warm(road, ends)
    rows = (
        _field(cases["clutter"][0])
        + _first(cases)
        + _first_own_step(cases)
        + _curves(cases)
        + _throughput(cases)
    )
    return rows + _soundness() + _recorded() + _drivable() + _obstructed()


def _warm(road: Road, ends: Floats) -> None:
    RrtStarConnect().plan(road, Query(*ends), Budget(2000), 0)
    for name in PLANNERS:
        _ompl(road, ends, name, 0.02)


def _ompl(
    road: Road,
    ends: Floats,
    name: str,
    seconds: float,
    step: float | None = None,
    *,
    first: bool = False,
    states: bool = False,
) -> Floats:
    """Return OMPL's path (P, 2) after so much CPU time (or its first one, for RRTConnect), simplified but for the `first`."""
    started = process_time()

    def stop(_: int) -> bool:
        return process_time() - started > seconds

    field = road.clearance_cells
    information = _plane_by_states(field) if states else exact_plane(field, 0.0)
    return solve(information, ends, name, stop, step=step, simplify=not first)[0]


def _plane_by_states(field: Floats) -> Any:
    """The plane as OMPL's Python users have it: edges checked state by state, a cell apart."""

    def is_free(state: Any) -> bool:
        row, column = min(int(state[1]), len(field) - 1), min(int(state[0]), len(field[0]) - 1)
        return bool(field[row, column] > 0.0)

    information = plane(field)
    information.setStateValidityChecker(is_free)
    extent = information.getStateSpace().getMaximumExtent()
    information.setStateValidityCheckingResolution(1.0 / extent)
    information.setup()
    return information


def _field(road: Road) -> list[Row]:
    out = np.empty(road.drivable.shape)
    times = []
    for _ in range(10):
        started = process_time()
        distance_transform(road.drivable, out)
        times.append(process_time() - started)
    return [lower("clearance field, 1000×1000", 1e3 * median(times), "ms", 30.0)]


def _first(cases: dict[str, Case]) -> list[Row]:
    """Time to the first path at step 5."""
    rows = []
    for name, target in (("lane", None), ("T", 5.0), ("clutter", 15.0)):
        road, ends, _ = cases[name]
        ours, exact, states = list[float](), list[float](), list[float]()
        for seed in range(SEEDS):
            started = process_time()
            RrtStarConnect(STEP).plan(road, Query(*ends), Budget(10**7, first=True), seed)
            ours.append(process_time() - started)
            for theirs, by_state in ((exact, False), (states, True)):
                started = process_time()
                _ompl(road, ends, "ompl_rrt_connect", 60.0, 5.0, first=True, states=by_state)
                theirs.append(process_time() - started)
        rows.append(lower(f"{name}: first path, step 5", 1e3 * median(ours), "ms"))
        for theirs, how in (
            (exact, "our compiled exact edge check in it"),
            (states, "a Python callback per state"),
        ):
            peer = f"OMPL RRTConnect, {how}: {1e3 * median(theirs):.2f} ms"
            label = f"{name}: first path, speed-up{', state by state' if theirs is states else ''}"
            rows.append(higher(label, median(theirs) / median(ours), "×", target, peer))
    return rows


def _first_own_step(cases: dict[str, Case]) -> list[Row]:
    """Time to the first path with each planner's own step; what compiled OMPL took in C++ is the target."""
    rows = []
    for name, target in (("T", 0.05), ("clutter", 0.23)):
        road, ends, _ = cases[name]
        ours, theirs = list[float](), list[float]()
        for seed in range(SEEDS):
            started = process_time()
            RrtStarConnect(OWN_STEP).plan(road, Query(*ends), Budget(10**7, first=True), seed)
            ours.append(process_time() - started)
            started = process_time()
            _ompl(road, ends, "ompl_rrt_connect", 60.0, first=True)
            theirs.append(process_time() - started)
        peer = (
            f"OMPL RRTConnect, our compiled exact edge check in it: {1e3 * median(theirs):.2f} ms"
        )
        rows.append(lower(f"{name}: first path, own step", 1e3 * median(ours), "ms", target, peer))
    return rows


def _curves(cases: dict[str, Case]) -> list[Row]:
    """Cost over the optimum at equal CPU time."""
    targets = {
        ("lane", 0.01): 1e-6,
        ("T", 0.1): 5e-4,
        ("clutter", 0.1): 0.02,
        ("clutter", 1.0): 0.003,
    }
    rows = []
    below = 0
    for name, (road, ends, best) in cases.items():
        for budget in BUDGETS[:1] if name == "lane" else BUDGETS:
            excess: dict[str, list[float]] = defaultdict(list)
            for seed in range(SEEDS):
                excess["ours"].append(_excess_of_ours(road, ends, best, budget, seed))
                below += excess["ours"][-1] < -1e-9
                for planner in list(PLANNERS)[1:]:
                    path = _ompl(road, ends, planner, budget)
                    excess[planner].append(path_length(path) / best - 1.0 if len(path) else np.inf)
            ours = median(excess.pop("ours"))
            peer, theirs = min(
                ((key, median(values)) for key, values in excess.items()), key=lambda item: item[1]
            )
            told = f"{peer} {theirs:.2e}"
            label = f"{name}: excess over the optimum at {budget:g} s"
            rows.append(lower(label, ours, "", targets.get((name, budget)), told))
            if name != "lane":
                rows.append(lower(f"{label}, ours / best of OMPL", ours / theirs, "", 0.5, told))
    return [*rows, lower("paths shorter than the optimum", float(below), "", 0.0)]


def _excess_of_ours(road: Road, ends: Floats, best: float, budget: float, seed: int) -> float:
    try:
        return (
            RrtStarConnect().plan(road, Query(*ends), Budget(None, budget), seed).cost / best - 1.0
        )
    except BudgetSpentError:
        return np.inf


def _throughput(cases: dict[str, Case]) -> list[Row]:
    """Iterations per second, and how the cost of one grows with their number (neither informed nor pulled: all samples count)."""
    rows = []
    for name in ("T", "clutter"):
        road, ends, _ = cases[name]
        default = _per_iteration(road, ends, RrtStarConnectConfig(), FEW)
        few, more, many = (_per_iteration(road, ends, PAPER, n) for n in (FEW, MORE, MANY))
        for cost, label in ((default, "default"), (few, "paper preset")):
            rows.append(higher(f"{name}: iterations per second, {label}", 1.0 / cost, "1/s", 1e5))
        for base, start, target, told in (
            (few, FEW, 1.0, _growth_of_ompl(road, ends) if name == "T" else None),
            (more, MORE, None, "from where eq 10, not zeta, sets the radius"),
        ):
            growth = many / base / (np.log(MANY) / np.log(start))
            label = f"{name}: cost per iteration at {MANY:.0e} over {start:.0e}, over log n"
            rows.append(lower(label, growth, "×", target, told))
    return rows


def _per_iteration(
    road: Road, ends: Floats, config: RrtStarConnectConfig, iterations: int
) -> float:
    """CPU seconds per iteration, the median of three runs (of one, if they are many)."""
    times = []
    for seed in range(1, 4 if iterations < 500_000 else 2):
        started = process_time()
        RrtStarConnect(config).plan(road, Query(*ends), Budget(iterations), seed)
        times.append(process_time() - started)
    return median(times) / iterations


def _growth_of_ompl(road: Road, ends: Floats) -> str:
    """The same growth of OMPL's trees that rewire, at what they can do in reasonable time: 10⁵ over 2·10⁴."""
    told = []
    for name in ("ompl_rrt_star", "ompl_informed_rrt_star"):
        cost = []
        for iterations in (FEW, MORE):
            started = process_time()
            until = partial(lt, iterations)  # so many have been made
            information = exact_plane(road.clearance_cells, 0.0)
            solve(information, ends, name, until, step=5.0, simplify=False)
            cost.append((process_time() - started) / iterations)
        told.append(f"{PLANNERS[name]} {cost[1] / cost[0] / (np.log(MORE) / np.log(FEW)):.2f}")
    return f"OMPL at {MORE:.0e} over {FEW:.0e}: {', '.join(told)}"


def _soundness(queries: int = QUERIES) -> list[Row]:
    """Random queries on random grids, re-checked by the exact rasteriser."""
    rng = np.random.default_rng(0)
    planner = RrtStarConnect(RrtStarConnectConfig(step=4.0))
    hits = asked = found = missed = 0
    while asked < queries:
        drivable = rng.random((20, 20)) > rng.uniform(0.05, 0.4)
        drivable[0, 0] = True
        road = road_of("random", drivable)
        for _ in range(100):
            asked += 1
            start, goal = rng.uniform(0.0, 20.0, (2, 2))
            query = Query(start, goal, float(rng.choice((0.0, 0.0, 0.6))))
            try:
                path = planner.plan(road, query, Budget(200, first=bool(asked % 4)), asked).path
            except BudgetSpentError:
                missed += 1
                continue
            except RefusedError:
                continue
            found += 1
            hits += enters_blocked(drivable, path)
    told = f"{found} paths, {missed} budgets spent"
    return [
        lower(f"paths into occupied cells, of {asked} random queries", float(hits), "", 0.0, told)
    ]


def _recorded(queries: int = QUERIES_OF_A_MAP) -> list[Row]:
    """Random queries on the recorded maps."""
    rows = []
    for road in recorded_maps(DATA / "maps" / "occupancy_grids")[:MAPS] if DATA.is_dir() else ():
        for radius in (0.0, 1.25):
            rng = np.random.default_rng(5)
            space = FreeSpace(road, radius)
            cells = np.argwhere(space.labels > 0)
            times, ways, failed = [], 0, 0
            space.component_at(np.zeros(2))
            for seed in range(queries):
                start, goal = (
                    road.origin
                    + (cells[rng.integers(len(cells), size=2)][:, ::-1] + 0.5) * road.resolution
                )
                if space.common_component(start, goal) is None:
                    continue
                ways += 1
                started = process_time()
                try:
                    plan_with_retry(
                        RrtStarConnect(),
                        road,
                        Query(start, goal, radius),
                        PlanningConfig().iterations,
                        seed,
                    )
                except BudgetSpentError:
                    failed += 1
                times.append(process_time() - started)
            name = f"{road.name}, radius {radius:g} m"
            rows.append(
                higher(
                    f"{name}: found where a way exists",
                    100.0 * (1 - failed / ways),
                    "%",
                    100.0,
                    f"{ways} ways",
                )
            )
            rows.append(lower(f"{name}: median time", 1e3 * median(times), "ms", 50.0))
    return rows


def _drivable() -> list[Row]:
    """Drivable mode on a metric T-intersection with two lanes a road: a left and a right turn, found and not given."""
    size, half = 500, 3.5
    y, x = (np.mgrid[:size, :size] + 0.5) * 0.2
    drivable = (abs(y - 50.0) < half) | ((abs(x - 50.0) < half) & (y < 50.0))
    for side in (-1.0, 1.0):  # kerbs of 5 m radius
        corner = np.hypot(x - 50.0 - side * (half + 5.0), y - (50.0 - half - 5.0)) > 5.0
        drivable |= (
            corner
            & (y < 50.0)
            & (y > 50.0 - half - 5.0)
            & (side * (x - 50.0) > 0.0)
            & (side * (x - 50.0) < half + 5.0)
        )
    road = road_of("metric T", drivable, 0.2)
    config = PlanningConfig()
    rows = []
    turns = {
        "left": ((51.75, 10.0, np.pi / 2), (10.0, 51.75, np.pi)),
        "right": ((51.75, 10.0, np.pi / 2), (90.0, 48.25, 0.0)),
    }
    for name, anchors in turns.items():
        poses = np.array(anchors)
        fitted = FittedVehicle(poses, np.zeros(2), np.zeros(1, dtype=bool), 1.0, name)
        states = BoundaryStates(*(np.append(pose, 5.0)[None] for pose in poses))
        fit = Fit((Vehicle("a"),), (fitted,), np.array([0, 1]), states, ())
        times = []
        for seed in range(TURNS):
            started = process_time()
            (route,) = plan_routes(road, fit, config, seed)
            times.append(process_time() - started)
        curvature = np.abs(np.diff(route.points[:, 2]) / np.diff(route.length)).max()
        shortest = (
            RrtStarConnect()
            .plan(road, Query(poses[0, :2], poses[1, :2], 0.95), Budget(2000), 0)
            .cost
        )
        rows.append(lower(f"drivable, {name} turn: time", 1e3 * median(times[1:]), "ms", 150.0))
        rows.append(
            lower(
                f"drivable, {name} turn: largest curvature",
                float(curvature),
                "1/m",
                Dynamics().planned.max_curvature,
            )
        )
        rows.append(
            lower(
                f"drivable, {name} turn: length",
                float(route.length[-1]),
                "m",
                None,
                f"shortest {shortest:.2f} m",
            )
        )
    return rows


def _unsure(solved: list[tuple[bool, bool]]) -> Row:
    """Roads on which the judge found no way, for want of room or because there is none: how many each planner solved."""
    ours, theirs = (np.count_nonzero([each[k] for each in solved]) for k in (0, 1))
    name = f"obstructed: solved of {len(solved)} roads on which the judge finds no way with room"
    return higher(name, float(ours), "", None, f"OMPL RRTConnect {theirs}")


def _obstructed() -> list[Row]:
    """Roads with something in the way: solved within a second, time to the first path, its length, the published route."""
    ours, theirs, excess, routes, bends = (
        list[float](),
        list[float](),
        list[float](),
        list[float](),
        list[float](),
    )
    feasible, seed, unsure = 0, 0, list[tuple[bool, bool]]()
    while feasible < OBSTRUCTED:
        case = obstructed(seed)
        seed += 1
        if case is None:
            continue
        _ = case.road.clearance_cells
        found, (path, took) = first_path(case, WITHIN, 0), rrt_connect(case, WITHIN)
        if not is_drivable(case):
            unsure.append((found is not None, len(path) > 0))
            continue
        feasible += 1
        ours += [found[0]] if found else []
        theirs += [took] if len(path) else []
        started = process_time()
        try:
            (route,) = plan_routes(
                case.road, _straight_fit(case.query.start, case.query.goal), PlanningConfig(), 0
            )
        except RefusedError:
            continue
        routes.append(process_time() - started)
        bends.append(float(np.abs(np.diff(route.points[:, 2]) / np.diff(route.length)).max()))
        if len(excess) < MEASURED and len(path):
            simplified = [rrt_connect(case, WITHIN, simplify=True)[0] for _ in range(3)]
            lengths = [dubins_length(case, each) for each in simplified if len(each)]
            plan = PoseRrtStarConnect().plan_poses(
                case.road, case.query, Budget(20 * PlanningConfig().iterations), 0
            )
            excess += [path_length(plan.path) / median(lengths)] if lengths else []
    share, peer = (
        100.0 * len(ours) / feasible,
        f"OMPL RRTConnect {100.0 * len(theirs) / feasible:.1f} %",
    )
    within = 100.0 * float(np.mean(np.array(excess) <= 1.02)) if excess else float("nan")
    told = (
        f"OMPL RRTConnect {1e3 * median(theirs):.1f} ms, with Python callbacks" if theirs else ""
    )
    return [
        higher(
            f"obstructed: solved within {WITHIN:g} s, of {feasible} roads a judge drives",
            share,
            "%",
            99.0,
            peer,
        ),
        _unsure(unsure),
        lower("obstructed: first path", 1e3 * median(ours), "ms", 5.0, told),
        lower(
            "obstructed: length over the median of OMPL's, simplified",
            median(excess or [np.inf]),
            "×",
            1.02,
        ),
        higher("obstructed: roads on which that is at most 1.02", within, "%"),
        higher(
            "obstructed: routes published, with side and margin kept",
            100.0 * len(routes) / feasible,
            "%",
            99.0,
        ),
        lower("obstructed: time of such a route", 1e3 * median(routes or [np.inf]), "ms"),
        lower(
            "obstructed: largest curvature of a route, median", median(bends or [np.inf]), "1/m"
        ),
    ]


def _straight_fit(start: Floats, goal: Floats) -> Fit:
    """A fit of one vehicle without a changepoint."""
    poses = np.stack((start, goal))
    fitted = FittedVehicle(poses, np.zeros(2), np.zeros(1, dtype=bool), 1.0, "straight")
    states = BoundaryStates(*(np.append(pose, 5.0)[None] for pose in poses))
    return Fit((Vehicle("a", *CAR),), (fitted,), np.array([0, 1]), states, ())
