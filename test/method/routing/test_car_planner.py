# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""RRT*-Connect for vehicles: Dubins curves, exact sweep, paths, routes around obstacles."""

from hypothesis import assume, given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
import shapely
from support.oracle import drivable_area, footprints

from benchmarks._planning_maps import road_of
from scenario_gen.base.errors import RefusedError
from scenario_gen.method.routing import plan_routes, PlanningConfig
from scenario_gen.method.routing.search.car_planner import PoseRrtStarConnect, PoseSearchConfig
from scenario_gen.method.routing.search.dubins import dubins_poses, Pose, shortest_curve
from scenario_gen.method.routing.search.planner import (
    BlockedError,
    Budget,
    BudgetSpentError,
    NoWayError,
    PoseQuery,
    Preferences,
)
from scenario_gen.method.routing.search.sweep import sweep_is_free
from scenario_gen.numerics import wrap_angle
from scenario_gen.numerics.rounding import ROUNDING_M
from scenario_gen.roads import build_road, RoadConfig
from scenario_gen.roads.obstacles import read_obstacles, with_obstacles
from scenario_gen.types import Vehicle
from scenario_gen.types.fit import Fit, FittedVehicle
from scenario_gen.types.scenario import BoundaryStates

CAR = (4.8, 1.9)
LIMIT = 0.225
pose = st.tuples(st.floats(-9, 9), st.floats(-9, 9), st.floats(-7, 7))


def street(obstacles="", length=60.0, width=8.0):
    """A straight road along x from y = 1 m on, cells of 0.2 m."""
    y = (np.arange(int((width + 2.0) / 0.2)) + 0.5) * 0.2
    road = road_of(
        "street",
        np.repeat(((y > 1.0) & (y < 1.0 + width))[:, None], int(length / 0.2), axis=1),
        0.2,
    )
    return with_obstacles(road, read_obstacles(obstacles))


SLALOM = "20 4 1.5708 6 1.5; 31 6 1.5708 6 1.5; 42 4 1.5708 6 1.5"  # walls that leave 2 m, of 8
GATES = "20 3.4 1.5708 4.8 1.5; 31 6.6 1.5708 4.8 1.5; 42 3.4 1.5708 4.8 1.5"  # that leave 3.2 m


def query(start=(4.0, 3.0, 0.0), goal=(56.0, 3.0, 0.0), preferences=Preferences()):
    return PoseQuery(np.array(start), np.array(goal), *CAR, LIMIT, preferences)


def plan_poses(road, asked, budget, seed, config=PoseSearchConfig()):
    return PoseRrtStarConnect(config).plan_poses(road, asked, budget, seed)


def route_on(road, *anchors, config=PlanningConfig(), seed=0, path=None):
    poses = np.array(anchors)
    more = {} if path is None else {"path": np.array(path)}
    fitted = FittedVehicle(
        poses, np.zeros(len(poses)), np.zeros(len(poses) - 1, dtype=bool), 1.0, "straight", **more
    )
    states = BoundaryStates(*(np.append(poses[k], 5.0)[None] for k in (0, -1)))
    (route,) = plan_routes(
        road,
        Fit((Vehicle("a", *CAR),), (fitted,), np.arange(len(poses)), states, ()),
        config,
        seed,
    )
    return route


def off_road_area(road, poses):
    shapes = footprints(poses[:, :2], poses[:, 2], *CAR)
    return shapely.area(shapely.difference(shapes, drivable_area(road))).max()


@given(pose, pose, st.floats(0.3, 5.0))
def test_dubins_curve_ends_where_it_should(start, end, radius):
    curve = shortest_curve(Pose(*start), Pose(*end), radius)
    reached = dubins_poses(np.array(start), np.array(end), radius, 1.0)[-1]
    np.testing.assert_allclose(reached[:2], end[:2], atol=1e-6)
    np.testing.assert_allclose((reached[2] - end[2] + np.pi) % (2 * np.pi) - np.pi, 0.0, atol=1e-6)
    assert sum(curve[1:]) >= np.hypot(end[0] - start[0], end[1] - start[1]) - 1e-9


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1))
def test_the_sweep_is_exact(seed):
    rng = np.random.default_rng(seed)
    road = road_of("random", rng.random((14, 14)) > 0.06, 1.0)
    curvature, size = rng.uniform(-0.3, 0.3), (rng.uniform(2.0, 5.0), rng.uniform(1.0, 2.0))
    first = np.array([*rng.uniform(2.0, 12.0, 2), rng.uniform(-np.pi, np.pi)])
    turn = first[2] + curvature * np.array([0.0, 0.2])
    middle = turn.mean()
    poses = np.array(
        [
            [*first[:2], turn[0]],
            [first[0] + 0.2 * np.cos(middle), first[1] + 0.2 * np.sin(middle), turn[1]],
        ]
    )
    swept = shapely.convex_hull(shapely.union_all(footprints(poses[:, :2], poses[:, 2], *size)))
    area = drivable_area(road)
    overlap = swept.difference(area).area
    doubt = swept.buffer(0.01).difference(area).area - swept.buffer(-0.01).difference(area).area
    assume(overlap > 0.02 or doubt == 0.0)
    assert sweep_is_free(road, poses, *size).all() == (overlap == 0.0)


@pytest.mark.parametrize("obstacles", ["30 3 0.4 4.5 1.8", GATES])
def test_paths_are_arcs_and_keep_clear(obstacles):
    road = street(obstacles)
    plan = plan_poses(road, query(), Budget(2000), 3)
    first = plan_poses(road, query(), Budget(2000, first=True), 3)
    assert plan.iterations > 1
    assert plan.cost <= first.cost + ROUNDING_M
    assert first.cost <= 1.5 * plan.cost
    np.testing.assert_allclose(plan.path[[0, -1]], [query().start, query().goal], atol=1e-6)
    half_turn = 0.5 * wrap_angle(np.diff(plan.path[:, 2]))
    chord = np.diff(plan.path[:, :2], axis=0)
    direction = np.arctan2(chord[:, 1], chord[:, 0])  # of an arc: the mean of the headings
    off = wrap_angle(direction - plan.path[:-1, 2] - half_turn)
    np.testing.assert_allclose(off, 0.0, atol=1e-4)
    arc = np.hypot(*chord.T) / np.sinc(half_turn / np.pi)
    assert np.abs(2.0 * half_turn / arc).max() <= LIMIT * (1 + 1e-6)
    assert plan.cost == pytest.approx(arc.sum())
    assert off_road_area(road, plan.path) < 1e-6
    again = plan_poses(road, query(), Budget(2000), 3)
    assert again.path.tobytes() == plan.path.tobytes()


def test_searches_that_fail_say_why():
    with pytest.raises(BlockedError, match=r"start .* has no room"):
        plan_poses(street(), query(start=(4.0, 1.2, 0.0)), Budget(10), 0)
    with pytest.raises(NoWayError, match=r"too narrow for a width of 1.90 m"):
        plan_poses(street("30 5 0 2 7"), query(), Budget(10), 0)
    with pytest.raises(BudgetSpentError, match="within 40 iterations"):
        plan_poses(street(SLALOM), query(), Budget(40), 0)


def test_clearance_is_kept_where_possible():
    road = street("30 6.5 0 4.5 1.8")
    room = []
    for wanted in (Preferences(), Preferences(clearance=0.8, clearance_cost=3.0)):
        asked = query((4.0, 4.4, 0.0), (56.0, 4.4, 0.0), wanted)
        path = plan_poses(road, asked, Budget(500), 0).path
        driven = shapely.union_all(footprints(path[:, :2], path[:, 2], *CAR))
        room.append(shapely.distance(driven, drivable_area(road).boundary))
    assert room[1] >= room[0]


def test_routes_pass_obstacles_on_side():
    oncoming = route_on(
        street("30 3 0 4.5 1.8"), (4.0, 3.0, 0.0), (56.0, 3.0, 0.0)
    )  # own lane closed: by the other one
    assert (oncoming.joined, oncoming.searched) == (0, 1)
    assert oncoming.points[:, 1].max() > 4.5
    wide = street("30 6.2 0 4.5 1.8", width=11.0)  # room for a car on either side
    for side, sign in (("right", -1.0), ("left", 1.0)):
        route = route_on(
            wide, (4.0, 6.5, 0.0), (56.0, 6.5, 0.0), config=PlanningConfig(traffic_side=side)
        )
        offset = route.points[:, 1] - 6.5
        assert sign * offset[np.argmax(np.abs(offset))] > 1.0


def test_oncoming_lane_needs_permission():
    road = build_road("straight", config=RoadConfig(arm_length=60.0))
    lane = next(lane for lane in road.lanes.lanes if lane.inward)
    x, y = lane.centre[len(lane.centre) // 2]
    blocked = with_obstacles(road, read_obstacles(f"{x} {y} 0 4.5 2.6"))
    poses = np.column_stack((lane.centre, lane.yaw[[0, *range(len(lane.yaw))]]))
    poses = poses[5:-5]
    ends = poses[[0, -1]]
    assert route_on(blocked, *ends, path=poses).farthest > 2.0
    with pytest.raises(RefusedError, match=r"planning\.oncoming=around_obstacles"):
        route_on(blocked, *ends, path=poses, config=PlanningConfig(oncoming="never"))


def test_a_slalom_is_driven():
    road = street(GATES)
    route = route_on(road, (4.0, 3.0, 0.0), (56.0, 3.0, 0.0))
    bend = np.diff(route.points[:, 2]) / np.diff(route.length)
    assert np.abs(bend).max() < LIMIT * 1.02
    assert np.abs(np.diff(bend)).max() < 0.08  # per half a metre: no jump of curvature
    assert off_road_area(road, route.points) < 1e-6
