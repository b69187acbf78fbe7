# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Overlap and off-road: known hard cases, and agreement with an independent dense re-check on random motions."""

import itertools

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
import shapely
from support.lengths import LONG
from support.motions import arc, FREE, open_road, road_of, scenario_of, straight, wander
from support.oracle import boxes_at, drivable_area, footprints, off_road, overlapping

from scenario_gen.method.validity import Checker, Limits
from scenario_gen.types import Vehicle
from scenario_gen.types.scenario import Cause

COARSE = np.arange(5) * 1.0
FINE = np.arange(41) * 0.1


def verdict(scenario, road=None, limits=FREE):
    (answer,) = Checker(road, None, None, None, limits).check([scenario])
    return answer


def causes(scenario, road=None, limits=FREE):
    """Of overlap and off-road only: some of these motions are no drives."""
    found = [violation.cause for violation in verdict(scenario, road, limits).violations]
    return [cause for cause in found if cause in (Cause.OVERLAP, Cause.OFF_ROAD)]


def box_at(scenario, i, time):
    return boxes_at(scenario, np.array([time]))[i][0]


# ---------------------------------------------------------------- known cases


@pytest.mark.parametrize("offset", [0.0, 3.0, -4.0])
def test_cars_crossing_between_samples_overlap(offset):
    """At 40 m/s and one sample per second the cars are 20 m apart at every sample, and meet in between."""
    crossing = scenario_of(
        [straight(-60, 0, 0, 40, COARSE), straight(0, -60 + offset, np.pi / 2, 40, COARSE)], COARSE
    )
    assert causes(crossing) == [Cause.OVERLAP]
    later = scenario_of(
        [straight(-60, 0, 0, 40, COARSE), straight(0, -68, np.pi / 2, 40, COARSE)], COARSE
    )
    assert causes(later) == []


def test_rotation_alone_can_touch():
    """Two trucks stand 4 m apart; one turns on the spot, clear at both ends of the only interval."""
    time, trucks = np.array([0.0, 1.0]), (Vehicle("a", 10.0, 2.0), Vehicle("b", 10.0, 2.0))
    still = np.zeros(2)
    standing = (np.array([[0.0, 4.0]] * 2), np.zeros(2), still)
    turning = (np.zeros((2, 2)), np.array([-0.2, 0.2]), still)
    assert causes(scenario_of([turning, standing], time, trucks)) == []
    turning = (np.zeros((2, 2)), np.array([0.2, np.pi - 0.2]), still)
    assert causes(scenario_of([turning, standing], time, trucks)) == [Cause.OVERLAP]


def test_touching_is_overlap():
    cars = (Vehicle("a", 4.0, 2.0), Vehicle("b", 4.0, 2.0))
    for gap, expected in (
        (0.0, [Cause.OVERLAP]),
        (-1e-6, [Cause.OVERLAP]),
        (1e-3, []),
        (1e-6, []),
    ):
        side = scenario_of(
            [straight(0, 0, 0, 10, FINE), straight(1, 2.0 + gap, 0, 8, FINE)], FINE, cars
        )
        assert causes(side) == expected
        queue = scenario_of(
            [
                straight(0, 0, 0.5, 10, FINE),
                straight(*((4.0 + gap) * np.array([np.cos(0.5), np.sin(0.5)])), 0.5, 10, FINE),
            ],
            FINE,
            cars,
        )
        assert causes(queue) == expected


def test_minimum_clearance_is_kept():
    side = scenario_of([straight(0, 0, 0, 10, FINE), straight(30, 2.9, np.pi, 10, FINE)], FINE)
    assert causes(side) == []
    close = verdict(side, limits=Limits(min_clearance=1.1))
    assert [violation.cause for violation in close.violations] == [Cause.OVERLAP]
    assert "1.000 m" in close.violations[0].message
    assert causes(side, limits=Limits(min_clearance=0.99)) == []


@pytest.mark.parametrize("yaw", [0.0, 0.5 * np.pi, 1.0])
@pytest.mark.parametrize("ahead", [0.0, 1.0])
def test_slide_in_any_direction_is_swept(yaw, ahead):
    """Limits aside the proof holds for any motion: 20 m aside, or ahead, between two samples at no speed."""
    turned = yaw + 0.5 * np.pi * (1.0 - ahead)
    way = np.array([np.cos(turned), np.sin(turned)])
    middle, time = np.array([25.1, 25.1]), np.array([0.0, 1.0])
    slide = np.array([middle - 10.0 * way, middle + 10.0 * way]), np.full(2, yaw), np.zeros(2)
    scenario = scenario_of([slide], time, (Vehicle("a", 4.0, 2.0),))
    cells = np.ones((200, 200), dtype=bool)
    assert causes(scenario, road_of(cells, 0.25)) == []
    for post in (-6.0, 6.0):
        column, row = ((middle + post * way) / 0.25).astype(int)
        blocked = cells.copy()
        blocked[row, column] = False
        assert causes(scenario, road_of(blocked, 0.25)) == [Cause.OFF_ROAD]


@pytest.mark.parametrize(
    ("quarters", "over"),
    [(0, 0.0), *itertools.product(range(4), (-2e-6, 1e-6))],  # multiples of π are no floats
)
def test_border_of_grid_is_road(quarters, over):
    """A car of 4 m by 2 m stands along each side of a road of 24 m by 20 m, cells of which end there."""
    road = road_of(np.ones((80, 96), dtype=bool), 0.25)
    x, y = (1.0, 2.0) if quarters % 2 else (2.0, 1.0)
    for place in (
        (x - over, 9.0),
        (24.0 - x + over, 9.0),
        (9.0, y - over),
        (9.0, 20.0 - y + over),
    ):
        stands = straight(*place, 0.5 * np.pi * quarters, 0.0, COARSE)
        found = causes(scenario_of([stands], COARSE, (Vehicle("a", 4.0, 2.0),)), road)
        assert found == ([Cause.OFF_ROAD] if over > 0.0 else []), place


def test_cubic_counts_not_the_chord():
    """Both samples of a wide swerve lie on a straight corridor; the motion between them leaves it."""
    time = np.array([0.0, 4.0])
    road = road_of(np.pad(np.ones((16, 300), dtype=bool), 40), 0.25)
    swerve = (
        np.array([[15.0, 12.0], [55.0, 12.0]]),
        np.array([0.3, -0.3]),
        np.array([11.0, 11.0]),
    )
    assert causes(scenario_of([swerve], time, (Vehicle("a", 1.0, 0.5),)), road) == [Cause.OFF_ROAD]
    steady = (np.array([[15.0, 12.0], [55.0, 12.0]]), np.zeros(2), np.array([10.0, 10.0]))
    assert causes(scenario_of([steady], time, (Vehicle("a", 1.0, 0.5),)), road) == []


def test_many_vehicles_are_checked_in_pairs():
    lanes = [straight(-40, 3.0 * i, 0, 8 + i, FINE) for i in range(8)]
    assert causes(scenario_of(lanes, FINE)) == []
    lanes[5] = straight(-20, 9.0, 0, 2, FINE)  # vehicle 3, from behind
    (violation,) = verdict(scenario_of(lanes, FINE)).violations
    assert violation.vehicles == (3, 5)
    assert 1.6 <= violation.time <= 1.9


# ---------------------------------------------------------------- random motions against the oracle


def random_road(rng):
    cells = np.ones((240, 240), dtype=bool)
    for _ in range(rng.integers(0, 12)):
        i, j, h, w = *rng.integers(0, 240, 2), *rng.integers(1, 25, 2)
        cells[i : i + h, j : j + w] = False
    cells[120, 120] = True
    return road_of(cells, rng.choice([0.2, 0.5]), rng.uniform(-60, -20, 2))


def random_case(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 5))
    time = np.concatenate(
        ([0.0], np.cumsum(rng.choice([0.1, 0.3, 1.0]) * rng.uniform(0.5, 1.5, 10)))
    )
    vehicles = tuple(Vehicle(str(i), *rng.uniform((1.5, 0.5), (12.0, 2.6))) for i in range(n))
    return scenario_of([wander(rng, time, 25.0) for _ in range(n)], time, vehicles), random_road(
        rng
    )


def compare(seed):
    """Assert that checker and oracle agree about overlaps and road, up to slivers; return whether the scenario was valid."""
    scenario, road = random_case(seed)
    answer = verdict(scenario, road)
    refused = {(violation.cause, violation.vehicles) for violation in answer.violations}
    assert {(Cause.OVERLAP, pair) for pair in overlapping(scenario, FREE, 0.01)} <= refused
    assert {(Cause.OFF_ROAD, (i,)) for i in off_road(scenario, road, 0.01)} <= refused
    for (
        violation
    ) in answer.violations:  # never refused without reason: at the instant it names, it is so
        if violation.cause is Cause.OVERLAP:
            a, b = (box_at(scenario, i, violation.time) for i in violation.vehicles)
            assert shapely.distance(a, b) < 0.02, violation
        elif violation.cause is Cause.OFF_ROAD:
            (i,) = violation.vehicles
            assert not shapely.covers(
                drivable_area(road), shapely.buffer(box_at(scenario, i, violation.time), 0.02)
            ), violation
    return answer.valid


def test_random_scenarios_agree_with_the_oracle():
    assert 6 <= sum(map(compare, range(60))) <= 54


@settings(max_examples=1000 if LONG else 60)
@given(seed=st.integers(0, 2**32 - 1))
def test_standing_footprint_equals_its_cells(seed):
    rng = np.random.default_rng(seed)
    road = road_of(rng.random((30, 30)) > 0.02, 0.5, rng.uniform(-5, 5, 2))
    car = Vehicle("a", *rng.uniform(0.3, 5.0, 2))
    yaw = rng.choice([rng.uniform(-np.pi, np.pi), rng.integers(-2, 3) * np.pi / 2])
    track = straight(*(road.origin + rng.uniform(0, 15, 2)), yaw, 0.0, np.array([0.0, 1.0]))
    scenario = scenario_of([track], np.array([0.0, 1.0]), (car,))
    at = scenario.position[:, 0], scenario.heading[:, 0]
    smaller = footprints(*at, car.length - 1e-6, car.width - 1e-6)[0]
    larger = footprints(*at, car.length + 1e-6, car.width + 1e-6)[0]
    area = drivable_area.__wrapped__(road)
    if causes(scenario, road):
        assert not area.covers(larger)
    else:
        assert area.covers(smaller)


WALL = road_of(np.pad(np.ones((200, 200), dtype=bool), 10), 0.2, (-22.0, -22.0))  # at ±20 m


def beside_the_wall(rng, over):
    """A drive of one interval, with turns of up to 57°, that reaches `over` metres into a wall, by dense sampling."""
    car = (Vehicle("a", *rng.uniform((0.5, 0.5), (18.0, 3.0))),)
    yaw = rng.uniform(-np.pi, np.pi) + rng.uniform(-1.0, 1.0) * np.array([0.0, 1.0])
    speed = rng.uniform(0.0, 8.0, 2) * rng.integers(0, 2)
    time = np.array([0.0, rng.choice([0.1, 0.5])])
    ahead = np.stack((np.cos(yaw), np.sin(yaw)), axis=-1) * speed[:, None]
    position = np.stack((np.zeros(2), 0.5 * time[1] * ahead.sum(axis=0)))

    def placed(shift):
        return scenario_of([(position + shift, yaw, speed)], time, car)

    low_x, low_y, high_x, high_y = shapely.bounds(
        boxes_at(placed(np.zeros(2)), np.linspace(0.0, time[1], 2001))[0]
    ).T
    shifts = (
        (20.0 - high_x.max() + over, 0.0),
        (-20.0 - low_x.min() - over, 0.0),
        (0.0, 20.0 - high_y.max() + over),
        (0.0, -20.0 - low_y.min() - over),
    )
    return placed(np.array(shifts[rng.integers(4)]))


def test_footprint_turning_at_wall_is_exact():
    rng = np.random.default_rng(0)
    for over in 10.0 ** rng.uniform(-6.0, -2.0, 3000 if LONG else 150):
        assert causes(beside_the_wall(rng, over), WALL) == [Cause.OFF_ROAD], over
        assert causes(beside_the_wall(rng, -over - 5e-4), WALL) == [], over


@settings(max_examples=100 if LONG else 10)
@given(seed=st.integers(0, 2**32 - 1))
def test_grazing_arcs_agree_with_oracle(seed):
    """Arcs that graze each other: the pair is shifted until the smallest gap the oracle sees is a centimetre."""
    rng = np.random.default_rng(seed)
    time = np.arange(6) * rng.choice([0.1, 0.5, 1.0])
    tracks = [
        arc(
            *rng.uniform(-8, 8, 2),
            rng.uniform(-3, 3),
            rng.uniform(0, 12),
            rng.choice([-1, 1]) * rng.uniform(0.1, 0.6),
            time,
        )
        for _ in range(2)
    ]
    angle = rng.uniform(-np.pi, np.pi)
    away = np.array([np.cos(angle), np.sin(angle)])

    def shifted(shift):
        return scenario_of([tracks[0], (tracks[1][0] + shift * away, *tracks[1][1:])], time)

    def gap(shift):
        return shapely.distance(*boxes_at(shifted(shift), np.linspace(0, time[-1], 500))).min()

    low, high = 0.0, 200.0
    while high - low > 1e-3:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if gap(middle) <= 0.01 else (low, middle)
    for shift in (high, max(low - 0.03, 0.0), high + 0.2):
        scenario = shifted(shift)
        overlaps = [
            violation.time
            for violation in verdict(scenario).violations
            if violation.cause is Cause.OVERLAP
        ]
        if overlaps:
            assert shapely.distance(*boxes_at(scenario, np.array(overlaps)))[0] < 1e-4
        else:
            assert (
                shapely.distance(*boxes_at(scenario, np.linspace(0, time[-1], 2000))).min() > 0.0
            )


def test_far_from_the_origin_nothing_changes():
    """Coordinates as in UTM: 500 km east, 4,000 km north."""
    shift = np.array([500_000.0, 4_000_000.0])
    near = open_road(60.0)
    far = road_of(near.drivable, near.resolution, near.origin + shift)
    for gap, expected in ((1.9, [Cause.OVERLAP]), (1.91, [])):
        tracks = [
            straight(-15, 0, 0.3, 5, FINE),
            straight(-15 - gap * np.sin(0.3), gap * np.cos(0.3), 0.3, 6, FINE),
        ]
        assert causes(scenario_of(tracks, FINE), near) == expected
        tracks = [(position + shift, heading, speed) for position, heading, speed in tracks]
        assert causes(scenario_of(tracks, FINE), far) == expected
