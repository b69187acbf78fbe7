# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Validity of scenarios whose vehicles are there for a part of the time only."""

from dataclasses import replace
from itertools import combinations

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
import shapely
from support.lengths import LONG
from support.motions import FREE, open_road, scenario_of, straight, verdict_of, wander
from support.oracle import boxes_beyond, overlapping

from scenario_gen.base.road_users import Dynamics
from scenario_gen.method.validity import collision
from scenario_gen.situation import Wait
from scenario_gen.types import Vehicle
from scenario_gen.types.lanes import Lane, LaneNetwork, Obstacle
from scenario_gen.types.scenario import BoundaryStates, Cause, Scenario

TIME = np.arange(101) * 0.1
ROAD = open_road()


def together(present):
    """Two cars on the same place at 5 s; they meet from 4 s to 6 s."""
    return replace(
        scenario_of([straight(-25, 0, 0, 5, TIME), straight(25, 0, np.pi, 5, TIME)], TIME),
        present=np.array(present),
    )


def causes(scenario, road=ROAD, **known):
    verdict = verdict_of(scenario, road=road, **known)
    return [violation.cause for violation in verdict.violations], verdict


@pytest.mark.parametrize(
    ("present", "shown", "beyond"),
    [
        ([[0, 100], [0, 100]], True, True),
        ([[0, 29], [0, 100]], False, False),  # gone before
        ([[0, 39], [0, 100]], False, True),  # gone while the other comes
        ([[0, 100], [62, 100]], False, True),  # comes where the other has just been
        ([[0, 100], [75, 100]], False, False),
        ([[0, 50], [45, 100]], True, True),
        ([[0, 50], [50, 100]], True, True),  # together at one instant, at the same place
        ([[0, 38], [38, 100]], False, True),  # together at one instant, apart
        ([[0, 10], [80, 100]], False, False),  # never together
    ],
)
def test_footprints_overlap_within_the_margin(present, shown, beyond):
    for margin, meets in ((0.0, shown), (1.0, beyond)):
        found, verdict = causes(together(present), limits=replace(FREE, presence_margin=margin))
        assert found == ([Cause.OVERLAP] if meets else [])
        if meets:
            first, last = max(first for first, _ in present), min(last for _, last in present)
            time = verdict.violations[0].time
            assert 0.1 * first - margin - 1e-9 <= time <= 0.1 * last + margin + 1e-9
            assert ("more than it is shown" in verdict.violations[0].message) == (
                not 0.1 * first <= time <= 0.1 * last
            )


@pytest.mark.parametrize(("comes", "valid"), [(42, False), (55, False), (60, False), (62, True)])
def test_vanished_place_stays_blocked(comes, valid):
    scenario = scenario_of([straight(0, 0, 0, 0.0, TIME), straight(1, 0, 0.2, 0.0, TIME)], TIME)
    found, _ = causes(replace(scenario, present=np.array([[0, 40], [comes, 100]])))
    assert found == ([] if valid else [Cause.OVERLAP])


def test_uncompared_pair_is_refused(monkeypatch):
    monkeypatch.setattr(collision, "first_contacts", lambda *_: None)
    for present in ([[0, 100], [0, 100]], [[0, 60], [40, 100]], [[0, 50], [50, 100]]):
        found, verdict = causes(together(present))
        assert found == [Cause.OVERLAP] and "were not compared" in verdict.violations[0].message


def random_case(seed, group=0):
    """Two to five wandering or standing boxes, each there for a part of an uneven time; spans of 0, 1, 2 and more in common.

    Or a `group` of so many, on as much more room.
    """
    rng = np.random.default_rng(seed)
    n = group or int(rng.integers(2, 6))
    room = 3.0 * group or 12.0
    time = np.concatenate(
        ([0.0], np.cumsum(rng.choice([0.1, 0.3, 1.0]) * rng.uniform(0.5, 1.5, 12)))
    )
    tracks = [wander(rng, time, room, rng.choice([0.0, 12.0], p=[0.2, 0.8])) for _ in range(n)]
    vehicles = tuple(Vehicle(str(i), *rng.uniform((1.5, 0.5), (12.0, 2.6))) for i in range(n))
    present = np.array([np.sort(rng.choice(len(time), 2, replace=False)) for _ in range(n)])
    if rng.random() < 0.5:  # the second comes about when the first goes
        at = int(np.clip(present[0, 1] + rng.integers(-2, 2), 0, len(time) - 2))
        present[1] = at, rng.integers(at + 1, len(time))
    margin = float(rng.choice([0.0, 0.25, 1.0]))
    return replace(scenario_of(tracks, time, vehicles), present=present), replace(
        FREE, presence_margin=margin
    )


def compare(seed, group=0):
    """Assert that checker and oracle agree about overlaps; return (valid, spans in common of 0, 1, 2 and more samples)."""
    scenario, limits = random_case(seed, group)
    _, verdict = causes(scenario, road=None, limits=limits)
    refused = {
        violation.vehicles: violation
        for violation in verdict.violations
        if violation.cause is Cause.OVERLAP
    }
    assert overlapping(scenario, limits, 0.02) <= set(refused), "what the oracle finds is refused"
    for (
        pair,
        violation,
    ) in refused.items():  # and what is refused is so, at the instant that is named
        boxes = [boxes_beyond(scenario, i, np.array([violation.time]))[0] for i in pair]
        assert shapely.distance(*boxes) < 0.02, violation
    first, last = scenario.present.T
    spans = {
        int(np.clip(min(last[[i, j]]) - max(first[[i, j]]) + 1, 0, 3))
        for i, j in combinations(range(len(first)), 2)
    }
    return not refused, spans


def test_changing_presence_agrees_with_the_oracle():
    found = [compare(seed) for seed in range(40)]
    assert 5 <= sum(valid for valid, _ in found) <= 35
    assert set().union(*(spans for _, spans in found)) == {0, 1, 2, 3}
    for seed in range(600 if LONG else 3):
        compare(seed, 9)


@given(st.integers(0, 10_000))
@settings(max_examples=20)
def test_each_vehicle_is_checked_alone(seed):
    """Road and dynamics of every vehicle are those of a scenario of its own."""
    rng = np.random.Generator(np.random.PCG64(seed))
    tracks = [wander(rng, TIME, 25.0) for _ in range(3)]
    present = np.sort(np.array([rng.choice(101, 2, replace=False) for _ in range(3)]), axis=1)
    whole = scenario_of(tracks, TIME)
    road = open_road(60.0)
    found, _ = causes(
        replace(whole, present=present),
        road=road,
        limits=replace(FREE, car=Dynamics(12.0, 1e6, 1e6, 1e6, 1e6)),
    )
    expected = []
    for row, (first, last) in enumerate(present):
        own = slice(first, last + 1)
        values = (
            getattr(whole, name)[[row], own]
            for name in ("position", "heading", "speed", "acceleration")
        )
        part = Scenario((whole.vehicles[row],), TIME[own] - TIME[first], *values)
        expected += causes(
            part, road=road, limits=replace(FREE, car=Dynamics(12.0, 1e6, 1e6, 1e6, 1e6))
        )[0]
    assert sorted(cause for cause in found if cause != Cause.OVERLAP) == sorted(expected)


def test_states_are_those_at_presence():
    scenario = together([[0, 39], [20, 100]])
    start = np.array([[-25, 0, 0, 5], [15, 0, np.pi, 5]], dtype=float)
    end = np.array([[-5.5, 0, 0, 5], [-25, 0, np.pi, 5]], dtype=float)
    shown = replace(FREE, presence_margin=0.0)
    assert causes(scenario, requested=BoundaryStates(start, end), limits=shown)[0] == []
    off = BoundaryStates(start + np.array([[0, 0, 0, 0], [1, 0, 0, 0]]), end)
    found, verdict = causes(scenario, requested=off, limits=shown)
    assert found == [Cause.BOUNDARY_STATE]
    assert verdict.violations[0].time == 2.0


def test_waiting_from_arrival_stands_throughout():
    stands = straight(10, 30, 0, 0.0, TIME)
    scenario = replace(
        scenario_of([straight(-25, 0, 0, 5, TIME), stands], TIME),
        present=np.array([[0, 100], [20, 80]]),
    )
    state = np.column_stack(
        (scenario.position[:, 0], scenario.heading[:, 0], scenario.speed[:, 0])
    )
    asked = BoundaryStates(state, state + np.array([[50, 0, 0, 0], [0, 0, 0, 0]]))
    assert causes(scenario, requested=asked, waits=[Wait(1, 2.0, 8.0)])[0] == []
    speed = scenario.speed.copy()
    speed[1, 50] = 0.4
    assert causes(replace(scenario, speed=speed), requested=asked, waits=[Wait(1, 2.0, 8.0)])[
        0
    ] == [Cause.STOP_NOT_KEPT]


def test_wrong_way_counts_while_present():
    """A lane to the west, a car to the east that comes after 2 s and goes after 6 s."""
    x = np.array([40.0, -40.0])
    lane = Lane("west", *(np.column_stack((x, np.full(2, y))) for y in (-2.0, 2.0)))
    road = replace(ROAD, lanes=LaneNetwork("one lane", (lane,)))
    scenario = replace(
        scenario_of([straight(-25, 0, 0, 5, TIME), straight(0, 30, 0, 5, TIME)], TIME),
        present=[[20, 60], [0, 100]],
    )
    found, verdict = causes(scenario, road=road)
    assert found == [Cause.WRONG_WAY]
    assert verdict.violations[0].time == 2.0 and "41 samples" in verdict.violations[0].message
    obstacles = (Obstacle(0.0, 4.0, 0.0, 4.5, 1.8),)
    passed = replace(road, lanes=replace(road.lanes, obstacles=obstacles))
    assert causes(scenario, road=passed)[0] == []
