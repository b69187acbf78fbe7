# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Planning: RRT*-Connect beside the true optimum and OMPL's planners, in one process, CPU time.

A query is timed as a whole: checks, trees, path and string pulling; OMPL from its set-up to its
path. OMPL has our compiled exact edge check as its motion validator. For first paths neither side
simplifies. The clearance field of a road is cached.
"""

from collections import defaultdict
from collections.abc import Callable
from statistics import fmean, median
from time import process_time

import numpy as np

from benchmarks._paper_planner import (
    plan_with_retry,
    Query,
    RrtStarConnect,
    RrtStarConnectConfig,
)
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
from benchmarks._planning_obstructed import (
    dubins_length,
    first_path,
    Obstructed,
    obstructed,
    parked,
    rrt_connect,
    straight_fit,
)
from benchmarks._planning_plane import exact_plane, solve
from benchmarks._sampling_cases import DATA
from benchmarks._size import sized
from benchmarks.row import higher, lower, Row
from scenario_gen.base.errors import RefusedError
from scenario_gen.method.routing import plan_routes, PlanningConfig
from scenario_gen.method.routing.search.car_planner import PoseRrtStarConnect
from scenario_gen.method.routing.search.ompl_solve import PLANNERS
from scenario_gen.method.routing.search.planner import (
    Budget,
    BudgetSpentError,
    path_length,
)
from scenario_gen.numerics.arrays import Floats
from scenario_gen.roads.connectivity import FreeSpace
from scenario_gen.types.road import Road

SEEDS_COUNT = sized(20, quick=1)
BUDGETS_S = sized((0.01, 0.1, 1.0), quick=(0.01,))
QUERIES_COUNT, MAP_QUERIES_COUNT = sized((100_000, 500), quick=(100, 2))
MAPS = sized(None, quick=1)
OBSTRUCTED_COUNT, PARKED_COUNT, COMPARED_COUNT = sized((200, 40, 40), quick=(2, 1, 1))
"""Roads that the judge drives, and those of each kind on which lengths are compared."""
LIMIT_S = 1.0
"""CPU time for one obstructed road."""
EXCESS_TARGETS = {
    ("lane", 0.01): 1e-6,
    ("T", 0.1): 5e-4,
    ("clutter", 0.1): 0.02,
    ("clutter", 1.0): 0.003,
}
Case = tuple[Road, Floats, float]


def run() -> list[Row]:
    """Return all rows."""
    cases: dict[str, Case] = {}
    for road, ends in (lane(), t_intersection(), clutter()):
        cases[road.name] = road, ends, optimum(road, ends)
        RrtStarConnect().plan(road, Query(*ends), Budget(2000), 0)
        for name in PLANNERS:
            _ompl(road, ends, name, 0.02)
    return [
        *_first(cases),
        *_excess(cases),
        _soundness(),
        *_recorded(),
        *_obstructed("obstructed", obstructed, OBSTRUCTED_COUNT),
        *_obstructed("parked cars", parked, PARKED_COUNT),
    ]


def _timed(call: Callable[[], object]) -> float:
    """Return the CPU seconds of a call."""
    started = process_time()
    call()
    return process_time() - started


def _ompl(road: Road, ends: Floats, name: str, seconds: float, *, first: bool = False) -> Floats:
    """Return OMPL's path (P, 2) after this CPU time, simplified unless it is the `first` one."""
    started = process_time()

    def stop(_: int) -> bool:
        return process_time() - started > seconds

    plane = exact_plane(road.clearance_cells, 0.0)
    return solve(plane, ends, name, stop, simplify=not first)[0]


def _first(cases: dict[str, Case]) -> list[Row]:
    """Measure the time to the first path; the targets are the times of OMPL in C++."""
    rows = []
    planner = RrtStarConnect(RrtStarConnectConfig(pull=False))
    for name, target in (("T", 0.05), ("clutter", 0.23)):
        road, ends, _ = cases[name]
        query, budget = Query(*ends), Budget(10**7, first=True)
        ours, theirs = list[float](), list[float]()
        for seed in range(SEEDS_COUNT):
            ours.append(_timed(lambda: planner.plan(road, query, budget, seed)))  # noqa: B023
            theirs.append(_timed(lambda: _ompl(road, ends, "ompl_rrt_connect", 60.0, first=True)))  # noqa: B023
        peer = f"OMPL RRTConnect {1e3 * median(theirs):.2f} ms"
        rows.append(lower(f"{name}: first path", 1e3 * median(ours), "ms", target, peer))
    return rows


def _excess(cases: dict[str, Case]) -> list[Row]:
    """Measure the cost over the optimum at equal CPU time."""
    rows = []
    shorter = 0
    for name, (road, ends, best) in cases.items():
        for budget in BUDGETS_S[:1] if name == "lane" else BUDGETS_S:
            excess: dict[str, list[float]] = defaultdict(list)
            for seed in range(SEEDS_COUNT):
                excess["ours"].append(_our_excess(road, ends, best, budget, seed))
                shorter += excess["ours"][-1] < -1e-9
                for planner in list(PLANNERS)[1:]:
                    path = _ompl(road, ends, planner, budget)
                    excess[planner].append(path_length(path) / best - 1.0 if len(path) else np.inf)
            ours = median(excess.pop("ours"))
            theirs, peer = min((median(values), key) for key, values in excess.items())
            label = f"{name}: excess over the optimum at {budget:g} s"
            target = EXCESS_TARGETS.get((name, budget))
            rows.append(lower(label, ours, "", target, f"{peer} {theirs:.2e}"))
    return [*rows, lower("paths shorter than the optimum", shorter, "", 0.0)]


def _our_excess(road: Road, ends: Floats, best: float, budget: float, seed: int) -> float:
    try:
        path = RrtStarConnect().plan(road, Query(*ends), Budget(None, budget), seed)
    except BudgetSpentError:
        return np.inf
    return path.cost / best - 1.0


def _soundness() -> Row:
    """Check random queries on random grids with the exact rasteriser."""
    rng = np.random.default_rng(0)
    planner = RrtStarConnect(RrtStarConnectConfig(step=4.0))
    hits = asked = found = 0
    while asked < QUERIES_COUNT:
        drivable = rng.random((20, 20)) > rng.uniform(0.05, 0.4)
        drivable[0, 0] = True
        road = road_of("random", drivable)
        for _ in range(100):
            asked += 1
            start, goal = rng.uniform(0.0, 20.0, (2, 2))
            query = Query(start, goal, float(rng.choice((0.0, 0.0, 0.6))))
            try:
                path = planner.plan(road, query, Budget(200, first=bool(asked % 4)), asked).path
            except (BudgetSpentError, RefusedError):
                continue
            found += 1
            hits += enters_blocked(drivable, path)
    return lower(f"paths into occupied cells, {asked} queries", hits, "", 0.0, f"{found} paths")


def _recorded() -> list[Row]:
    """Plan between random cells of the recorded maps."""
    rows = []
    for road in recorded_maps(DATA / "maps" / "occupancy_grids")[:MAPS]:
        for radius in (0.0, 1.25):
            times, failed = _map_times(road, radius)
            name, found = f"{road.name}, radius {radius:g} m", 100.0 * (1 - failed / len(times))
            rows += [
                higher(f"{name}: found", found, "%", 100.0, f"{len(times)} queries"),
                lower(f"{name}: median time", 1e3 * median(times), "ms", 50.0),
            ]
    return rows


def _map_times(road: Road, radius: float) -> tuple[list[float], int]:
    """Return CPU seconds of the queries for which a path exists, and how many failed."""
    rng = np.random.default_rng(5)
    space = FreeSpace(road, radius)
    cells = np.argwhere(space.labels > 0)
    times, failed = [], 0
    for seed in range(MAP_QUERIES_COUNT):
        chosen = cells[rng.integers(len(cells), size=2)][:, ::-1]
        start, goal = road.origin + (chosen + 0.5) * road.resolution
        if space.common_component(start, goal) is None:
            continue
        query, started = Query(start, goal, radius), process_time()
        try:
            plan_with_retry(RrtStarConnect(), road, query, PlanningConfig().iterations, seed)
        except BudgetSpentError:
            failed += 1
        times.append(process_time() - started)
    return times, failed


def _obstructed(kind: str, case_of: Callable[[int], Obstructed | None], count: int) -> list[Row]:
    """Plan on roads with obstacles: share solved, time to the first path, length, route."""
    ours, theirs, excess, routes = list[float](), list[float](), list[float](), list[float]()
    feasible = seed = 0
    while feasible < count:
        case = case_of(seed)
        seed += 1
        if case is None or not is_drivable(case):
            continue
        feasible += 1
        _ = case.road.clearance_cells
        if feasible == 1:  # neither is measured while it loads
            first_path(case, LIMIT_S, 0)
            rrt_connect(case, LIMIT_S)
        first, (path, seconds) = first_path(case, LIMIT_S, 0), rrt_connect(case, LIMIT_S)
        ours += [first[0]] if first else []
        theirs += [seconds] if len(path) else []
        fit = straight_fit(case.query)
        started = process_time()
        try:
            plan_routes(case.road, fit, PlanningConfig(), 0)
        except RefusedError:
            continue
        routes.append(process_time() - started)
        if len(excess) < COMPARED_COUNT and len(path):
            simplified = [rrt_connect(case, LIMIT_S, simplify=True)[0] for _ in range(3)]
            lengths = [dubins_length(case, each) for each in simplified if len(each)]
            budget = Budget(20 * PlanningConfig().iterations)
            plan = PoseRrtStarConnect().plan_poses(case.road, case.query, budget, 0)
            excess += [path_length(plan.path) / median(lengths)] if lengths else []
    solved = f"OMPL RRTConnect {100.0 * len(theirs) / feasible:.1f} %"
    time = f"OMPL RRTConnect {1e3 * median(theirs or [np.inf]):.1f} ms, with Python callbacks"
    name = f"{kind}, {feasible} roads that a judge drives"
    ratio = median(ours or [np.inf]) / median(theirs or [np.inf])
    total = fmean(ours or [np.inf]) / fmean(theirs or [np.inf])
    return [
        higher(f"{name}: solved within 1 s", 100.0 * len(ours) / feasible, "%", 99.0, solved),
        lower(f"{name}: first path", 1e3 * median(ours or [np.inf]), "ms", 5.0, time),
        lower(f"{name}: first path over OMPL's, medians", ratio, "×", 1.0),
        lower(f"{name}: first path over OMPL's, in total", total, "×", 1.0),
        lower(f"{name}: length over OMPL's, simplified", median(excess or [np.inf]), "×", 1.02),
        higher(f"{name}: routes published", 100.0 * len(routes) / feasible, "%", 99.0),
        lower(f"{name}: time of a route", 1e3 * median(routes or [np.inf]), "ms"),
    ]
