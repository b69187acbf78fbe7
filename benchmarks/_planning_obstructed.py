# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Roads with something in the way, and OMPL's RRTConnect in Dubins space as the peer on them.

Half of the roads have two to five parked cars at random places and angles, half are slaloms of walls that leave 2.6 to 4 m; or
streets have cars parked in a row on the driver's lane. OMPL checks motions with our compiled exact sweep of the rectangle, so that its Python does not stand in its way.
"""

from dataclasses import dataclass
from itertools import pairwise
from time import process_time

import numpy as np

from benchmarks._planning_maps import road_of
from scenario_gen.base.errors import RefusedError
from scenario_gen.method.routing.search.car_planner import PoseRrtStarConnect
from scenario_gen.method.routing.search.dubins import Pose
from scenario_gen.method.routing.search.planner import Budget, path_length, PoseQuery
from scenario_gen.method.routing.search.sweep import car_scene, poses_in_cells, steering_cost
from scenario_gen.numerics.arrays import Floats
from scenario_gen.numerics.curve import Curve
from scenario_gen.roads import build_road, RoadConfig
from scenario_gen.roads.clearance import footprint_fits
from scenario_gen.roads.obstacles import ParkedConfig, with_obstacles
from scenario_gen.types import Obstacle, Vehicle
from scenario_gen.types.fit import Fit, FittedVehicle
from scenario_gen.types.road import Road
from scenario_gen.types.scenario import BoundaryStates

LENGTH, WIDTH, WALL = 80.0, 8.0, 1.0  # [m]
CELL = 0.2  # [m]
CAR = (4.8, 1.9)  # [m]
CURVATURE = 0.225  # [1/m]
REACH = 100.0  # [m] OMPL's longest motion; with its own, 16 m, the goal's tree, measured forwards, never meets the other


@dataclass(frozen=True, eq=False)
class Obstructed:
    """A road, and from where to where."""

    road: Road
    query: PoseQuery


def obstructed(seed: int) -> Obstructed | None:
    """The road of a seed; None if its start or goal is blocked."""
    rng = np.random.default_rng(seed)
    y = (np.arange(int((WIDTH + 2.0 * WALL) / CELL)) + 0.5) * CELL
    drivable = np.repeat(((y > WALL) & (y < WALL + WIDTH))[:, None], int(LENGTH / CELL), axis=1)
    obstacles = []
    if seed % 2 == 0:
        for _ in range(int(rng.integers(2, 6))):
            place = rng.uniform((15.0, WALL), (LENGTH - 15.0, WALL + WIDTH))
            shape = rng.uniform((0.0, 3.8, 1.7), (np.pi, 5.0, 2.0))
            obstacles.append(Obstacle(*place.tolist(), *shape.tolist()))
    else:
        depth = WIDTH - rng.uniform(2.6, 4.0)
        count = int(rng.integers(2, 5))
        pitch = rng.uniform(9.0, 16.0)
        side = int(rng.integers(2))
        for k in range(count):
            middle = WALL + 0.5 * depth if (k + side) % 2 == 0 else WALL + WIDTH - 0.5 * depth
            angle = 0.5 * np.pi + rng.uniform(-0.2, 0.2)
            thickness = rng.uniform(1.0, 2.0)
            obstacles.append(Obstacle(20.0 + k * pitch, middle, angle, depth, thickness))
    road = with_obstacles(road_of(f"obstructed {seed}", drivable, CELL), tuple(obstacles))
    ends = np.array([[4.0, WALL + 0.25 * WIDTH, 0.0], [LENGTH - 4.0, WALL + 0.25 * WIDTH, 0.0]])
    ends[:, 1] += rng.uniform(-0.5, 0.5, 2)
    if not footprint_fits(road, ends, *CAR).all():
        return None
    return Obstructed(road, PoseQuery(ends[0], ends[1], *CAR, CURVATURE))


def parked(seed: int) -> Obstructed | None:
    """A street with one to three parked cars on the right lane; None if its start or goal is blocked."""
    rng = np.random.default_rng(seed)
    row = ParkedConfig(
        lanes="1.-1",
        begin=float(rng.uniform(20.0, 50.0)),
        count=int(rng.integers(1, 4)),
        width=float(rng.uniform(1.7, 2.0)),
        offset=float(rng.uniform(-1.0, 0.8)),
    )
    config = RoadConfig(lane_width=float(rng.uniform(2.8, 3.75)), arm_length=80.0, parked=row)
    road = build_road(("straight", "curve")[seed % 2], config=config)
    lane = next(lane for lane in road.lanes.lanes if lane.id == row.lanes) if road.lanes else None
    if lane is None:
        return None
    start, goal = Curve.through(lane.centre).at(np.array([6.0, 74.0]))
    if not footprint_fits(road, np.stack((start, goal)), *CAR).all():
        return None
    return Obstructed(road, PoseQuery(start, goal, *CAR, CURVATURE))


def rrt_connect(
    case: Obstructed, seconds: float, reach: float = REACH, *, simplify: bool = False
) -> tuple[Floats, float]:
    """OMPL's path (P, 3) in cells, no row if it found none in so much CPU time, and the time."""
    from scenario_gen.method.routing.search.ompl_solve import curves, solve

    started = process_time()
    road, query = case.road, case.query

    def is_over(_: int) -> bool:
        return process_time() - started > seconds

    ends = poses_in_cells(road, np.stack((query.start, query.goal)))
    step = reach / road.resolution
    information = curves(car_scene(road, query))
    path, _ = solve(information, ends, "ompl_rrt_connect", is_over, step=step, simplify=simplify)
    return path, process_time() - started


def dubins_length(case: Obstructed, path: Floats) -> float:
    """Length [m] of a chain of Dubins curves (P, 3) in cells, infinity if it is not free: judged by the same sweep for all."""
    road, query = case.road, case.query
    scene = car_scene(road, query)
    return road.resolution * float(
        np.sum([steering_cost(Pose(*a), Pose(*b), scene) for a, b in pairwise(path.tolist())])
    )


def first_path(case: Obstructed, seconds: float, seed: int) -> tuple[float, float] | None:
    """Our first path: CPU seconds it took, and its length [m]; None if it took longer, or there is none."""
    started = process_time()
    try:
        plan = PoseRrtStarConnect().plan_poses(
            case.road, case.query, Budget(None, seconds, first=True), seed
        )
    except RefusedError:
        return None
    return process_time() - started, path_length(plan.path)


def straight_fit(query: PoseQuery) -> Fit:
    """A fit of one vehicle without a changepoint."""
    poses = np.stack((query.start, query.goal))
    fitted = FittedVehicle(poses, np.zeros(2), np.zeros(1, dtype=bool), 1.0, "straight")
    states = BoundaryStates(*(np.append(pose, 5.0)[None] for pose in poses))
    return Fit((Vehicle("a", *CAR),), (fitted,), np.array([0, 1]), states, ())
