# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Routes: exact ends, on the road, drivable, through the anchors, on their side; refusals."""

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
import shapely
from support.oracle import drivable_area, footprints

from benchmarks._planning_maps import road_of
from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.method.routing import plan_routes, PlanningConfig
from scenario_gen.types import Vehicle
from scenario_gen.types.fit import Fit, FittedVehicle
from scenario_gen.types.scenario import BoundaryStates


def farthest_anchor(route, anchors):
    """How far [m] a route passes from the anchor that it misses most."""
    return np.hypot(*(route.points[route.anchor, :2] - np.array(anchors)[:, :2]).T).max()


UP, LEFT, RIGHT = np.pi / 2, np.pi, 0.0
CAR = Vehicle("car", 4.8, 1.9)


def t_road(half=3.5, kerb=5.0):
    """100 m by 100 m, arms to the west, east and south, two lanes each."""
    y, x = (np.mgrid[:500, :500] + 0.5) * 0.2
    drivable = (abs(y - 50.0) < half) | ((abs(x - 50.0) < half) & (y < 50.0))
    for side in (-1.0, 1.0):
        u, v = side * (x - 50.0), 50.0 - y
        drivable |= (
            (u > 0)
            & (v > 0)
            & (u < half + kerb)
            & (v < half + kerb)
            & (np.hypot(u - half - kerb, v - half - kerb) > kerb)
        )
    return road_of("t", drivable, 0.2)


T = t_road()


def fit_of(*vehicles, cars=None):
    """A fit from (anchors, stands) per vehicle."""
    fitted = tuple(
        FittedVehicle(np.array(a, float), np.zeros(len(a)), np.array(s, bool), 1.0, "any")
        for a, s in vehicles
    )
    start, end = (np.array([[*np.array(a, float)[k], 5.0] for a, _ in vehicles]) for k in (0, -1))
    cars = cars or tuple(Vehicle(f"car{n}", CAR.length, CAR.width) for n in range(len(vehicles)))
    return Fit(cars, fitted, np.arange(len(vehicles[0][0])), BoundaryStates(start, end), ())


def routes_of(road, *vehicles, config=PlanningConfig(), seed=0):
    return plan_routes(road, fit_of(*vehicles), config, seed)


def off_road_area(road, route, car):
    """Largest area [m²] of the footprint off the road, along the whole route, by shapely."""
    at = np.linspace(0.0, route.length[-1], max(4 * len(route.points), 2))
    poses = np.column_stack([np.interp(at, route.length, column) for column in route.points.T])
    shapes = footprints(poses[:, :2], poses[:, 2], car.length, car.width)
    return shapely.area(shapely.difference(shapes, drivable_area(road))).max()


def assert_drivable(route, anchors, limit=0.2):
    points, length = route.points, route.length
    anchors = np.asarray(anchors, float)
    np.testing.assert_allclose(points[[0, -1], :2], anchors[[0, -1], :2], atol=1e-6)
    turn = (points[[0, -1], 2] - anchors[[0, -1], 2] + np.pi) % (2 * np.pi) - np.pi
    np.testing.assert_allclose(turn, 0.0, atol=1e-8)
    step = np.diff(length)
    assert (step > 0.0).all()
    assert (step <= 0.5 + 1e-9).all()
    np.testing.assert_allclose(np.hypot(*np.diff(points[:, :2], axis=0).T), step, atol=2e-3)
    np.testing.assert_array_less(np.abs(np.diff(points[:, 2]) / step), limit * 1.02)
    heading = np.arctan2(*np.diff(points[:, :2], axis=0).T[::-1])
    middle = 0.5 * (points[1:, 2] + points[:-1, 2])
    np.testing.assert_allclose((heading - middle + np.pi) % (2 * np.pi) - np.pi, 0.0, atol=0.02)
    assert len(route.anchor) == len(anchors)
    assert (np.diff(route.anchor) >= 0).all()
    assert route.anchor[0] == 0
    assert route.anchor[-1] == len(points) - 1


@pytest.mark.parametrize(
    "anchors",
    [
        [[51.75, 10, UP], [10, 51.75, LEFT]],
        [[51.75, 10, UP], [90, 48.25, RIGHT]],
        [
            [51.75, 10, UP],
            [51.75, 30, UP],
            [46, 51, LEFT - 0.5],
            [30, 51.75, LEFT],
            [10, 51.75, LEFT],
        ],
        [[51.75, 10, UP], [54.5, 46, UP / 2], [90, 48.25, RIGHT]],
        [[5, 48.25, RIGHT], [95, 48.25, RIGHT]],
        [[95, 51.75, LEFT], [48.25, 10, -UP]],
    ],
)
def test_turns_on_a_t_intersection(anchors):
    (route,) = routes_of(T, (anchors, [False] * (len(anchors) - 1)))
    assert_drivable(route, anchors)
    assert off_road_area(T, route, CAR) < 1e-6
    assert farthest_anchor(route, anchors) < 0.3


@pytest.mark.parametrize(("side", "sign"), [("right", 1.0), ("left", -1.0)])
def test_route_keeps_to_its_side(side, sign):
    start, end = [50.0 + sign * 1.75, 10, UP], [10, 50.0 + sign * 1.75, LEFT]
    (route,) = routes_of(T, ([start, end], [False]), config=PlanningConfig(traffic_side=side))
    x, y = route.points[:, 0], route.points[:, 1]
    assert (sign * (x[y < 40] - 50.0) > 1.0).all()
    assert (sign * (y[x < 38] - 50.0) > 1.0).all()


def test_two_vehicles_dwells_and_standing():
    waits = [[51.75, 10, UP], [51.75, 38, UP], [51.75, 38, UP], [10, 51.75, LEFT]]
    stands = [[20, 48.25, RIGHT]] * 4
    first, second = routes_of(T, (waits, [False, True, False]), (stands, [True] * 3))
    assert_drivable(first, waits)
    assert first.anchor[1] == first.anchor[2]
    assert 0 < first.anchor[1] < len(first.points) - 1
    np.testing.assert_array_equal(second.points, [stands[0]])
    np.testing.assert_array_equal(second.anchor, [0, 0, 0, 0])


def test_close_anchors_make_no_loops():
    anchors = [
        [5, 48.25, 0],
        [20, 48.0, 0.1],
        [20.5, 48.6, -0.2],
        [20.4, 48.2, 2.0],
        [40, 48.0, 0],
        [39.5, 48.3, 0],
        [95, 48.25, 0],
    ]
    (route,) = routes_of(T, (anchors, [False] * 6))
    assert_drivable(route, anchors)
    assert route.length[-1] < 90.2
    assert np.abs(np.diff(route.points[:, 2])).sum() < 0.5


@settings(max_examples=25)
@given(seed=st.integers(0, 2**32 - 1))
def test_noisy_anchors_give_drivable_routes(seed):
    rng = np.random.default_rng(seed)
    at = np.sort(rng.uniform(10.0, 90.0, rng.integers(0, 7)))
    poses = np.array([[5.0, 48.25, 0.0], *([x, 48.25, 0.0] for x in at), [95.0, 48.25, 0.0]])
    poses[1:-1] += rng.normal(0.0, (0.3, 0.3, 0.15), (len(at), 3))
    stands = np.zeros(len(poses) - 1, dtype=bool)
    try:
        (route,) = routes_of(T, (poses, stands), seed=seed)
    except RefusedError as error:
        pytest.fail(str(error))
    assert_drivable(route, poses)


def test_refusals_name_vehicle_and_anchor():
    goal = [10, 51.75, LEFT]
    with pytest.raises(RefusedError, match=r"start of vehicle car0 .*is blocked"):
        routes_of(T, ([[20, 20, UP], goal], [False]))
    with pytest.raises(RefusedError, match=r"end of vehicle car1 .*is blocked"):
        routes_of(T, ([goal, goal], [True]), ([goal, [10, 53.0, LEFT]], [False]))
    cut = T.drivable.copy()
    cut[:, 150:153] = False
    with pytest.raises(
        RefusedError, match=r"between the start of vehicle car0 .* and the end .*no route leads"
    ):
        routes_of(road_of("cut", cut, 0.2), ([[51.75, 10, UP], goal], [False]))
    with pytest.raises(RefusedError, match=r"no drivable route for vehicle car0 .*curvature"):
        routes_of(
            T, ([[51.75, 10, UP], [51.75, 20, -UP]], [False])
        )  # turn round within 10 m of a lane 7 m wide
    with pytest.raises(InputError, match="traffic_side"):
        PlanningConfig(traffic_side="middle")
