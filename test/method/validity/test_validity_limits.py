# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Limits, consistency, asked states, waits and passing order: each broken on purpose, each found with its cause."""

from dataclasses import replace

import numpy as np
import pytest
from support.motions import arc, encounter_of, open_road, scenario_of, straight

from scenario_gen.base.errors import InputError
from scenario_gen.base.road_users import Dynamics
from scenario_gen.method.validity import Checker, Limits
from scenario_gen.situation import Conflict, find_conflicts, Situation, Wait
from scenario_gen.types import Vehicle
from scenario_gen.types.scenario import BoundaryStates, Cause

TIME = np.arange(201) * 0.1
ROAD = open_road()


def speed_profile(x, y, yaw, knots, speeds):
    """Straight drive with a piecewise linear speed: position is its exact integral."""
    v = np.interp(TIME, knots, speeds)
    knots, speeds = np.asarray(knots, dtype=float), np.asarray(speeds, dtype=float)
    whole = np.concatenate(([0.0], np.cumsum(0.5 * (speeds[1:] + speeds[:-1]) * np.diff(knots))))
    piece = np.clip(np.searchsorted(knots, TIME, side="right") - 1, 0, knots.size - 2)
    s = whole[piece] + 0.5 * (speeds[piece] + v) * (TIME - knots[piece])
    return (
        np.stack((x + s * np.cos(yaw), y + s * np.sin(yaw)), axis=-1),
        np.full(TIME.size, yaw),
        v,
    )


def good(*tracks):
    """One car stops and goes on (its knots lie between samples), one turns."""
    stop = speed_profile(-90, 0, 0, [0, 5.03, 8.04, 12.06, 16.0, 20], [9, 9, 0, 0, 8, 8])
    return scenario_of([*(tracks or (stop, arc(10, -60, 0.3, 8, 0.15, TIME)))], TIME)


def asked_of(scenario):
    start, end = (
        np.column_stack((scenario.position[:, k], scenario.heading[:, k], scenario.speed[:, k]))
        for k in (0, -1)
    )
    return BoundaryStates(start, end)


def causes(scenario, *, road=ROAD, requested=None, conflicts=None, waits=None, limits=None):
    """Causes found by the checker."""
    (verdict,) = Checker(road, requested, conflicts, waits, limits).check([scenario])
    assert all(
        violation.message and np.isfinite(violation.time) for violation in verdict.violations
    )
    return [violation.cause for violation in verdict.violations]


def test_a_good_scenario_is_valid():
    scenario = good()
    waits = (Wait(0, 3.0, 6.0),)
    (verdict,) = Checker(ROAD, asked_of(scenario), (), waits).check([scenario])
    assert verdict.violations == ()


@pytest.mark.parametrize(
    ("dynamics", "cause"),
    [
        (Dynamics(max_speed=8.9), Cause.SPEED),
        (Dynamics(max_acceleration=1.9), Cause.LONGITUDINAL_ACCELERATION),
        (Dynamics(max_deceleration=2.9), Cause.LONGITUDINAL_ACCELERATION),
        (Dynamics(max_lateral_acceleration=1.19), Cause.LATERAL_ACCELERATION),
        (Dynamics(max_curvature=0.018), Cause.CURVATURE),
    ],
)
def test_each_limit_refuses_with_its_cause(dynamics, cause):
    assert set(causes(good(), limits=Limits(car=dynamics))) == {cause}


def test_values_at_their_limits_are_kept():
    limits = Limits(
        car=Dynamics(max_speed=9.0, max_lateral_acceleration=1.2, max_curvature=0.15 / 8 + 1e-4)
    )
    assert causes(good(), limits=limits) == []


@pytest.mark.parametrize(
    ("field", "i", "k", "value", "cause"),
    [
        ("speed", 0, 0, -0.01, Cause.SPEED),
        ("speed", 1, 100, 9.5, Cause.LONGITUDINAL_ACCELERATION),
        ("acceleration", 0, 10, 6.0, Cause.LONGITUDINAL_ACCELERATION),
        ("acceleration", 0, 10, -9.5, Cause.LONGITUDINAL_ACCELERATION),
        ("position", 1, 100, (0.0, 0.0), Cause.SPEED),
        ("heading", 1, 100, 0.3 + 1.5 + 0.2, Cause.CURVATURE),
    ],
)
def test_a_single_wrong_value_is_found(field, i, k, value, cause):
    scenario = good()
    values = np.array(getattr(scenario, field))
    values[i, k] = value
    assert cause in causes(replace(scenario, **{field: values}))


def test_message_carries_vehicle_and_figures():
    scenario = good()
    acceleration = np.array(scenario.acceleration)
    acceleration[0, 10] = 6.0
    (verdict,) = Checker(ROAD, None, None, None).check(
        [replace(scenario, acceleration=acceleration)]
    )
    (violation,) = (v for v in verdict.violations if "5.000" in v.message)
    assert (violation.time, violation.vehicles) == (1.0, (0,))
    assert "6.000 m/s²" in violation.message


def test_sliding_sideways_is_found():
    position, heading, speed = straight(-50, 0, 0, 5, TIME)
    assert causes(good((position, heading, speed))) == []
    assert set(causes(good((position, heading + 0.3, speed)))) == {Cause.CURVATURE}


def test_zigzag_positions_are_found():
    position, heading, speed = straight(-90, 0, 0, 8, TIME)
    zigzag = position + np.stack(
        (0 * TIME, 0.02 * (-1.0) ** np.arange(TIME.size)), axis=-1
    )  # 0.4 m/s sideways, 8 m/s²
    assert set(causes(good((zigzag, heading, speed)))) == {Cause.LATERAL_ACCELERATION}
    jerky = position + np.stack((0.02 * (-1.0) ** np.arange(TIME.size), 0 * TIME), axis=-1)
    assert set(causes(good((jerky, heading, speed)))) == {Cause.LONGITUDINAL_ACCELERATION}


def test_too_fast_motion_is_found():
    position, heading, speed = straight(-50, 0, 0, 5, TIME)
    assert set(causes(good((position, heading, speed + 0.8)))) == {Cause.SPEED}


def test_acceleration_without_speed_change_is_found():
    scenario = good(straight(-50, 0, 0, 5, TIME))
    assert set(causes(replace(scenario, acceleration=np.full((1, 201), 1.0)))) == {
        Cause.LONGITUDINAL_ACCELERATION
    }


@pytest.mark.parametrize("field", ["position", "heading", "speed", "acceleration"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_non_finite_value_is_only_violation(field, value):
    scenario = good()
    values = np.array(getattr(scenario, field))
    values[1, 7] = value
    with np.errstate(invalid="ignore"):
        assert causes(replace(scenario, **{field: values})) == [Cause.NOT_FINITE]


def test_time_must_increase():
    time = TIME.copy()
    time[50] = time[49]
    assert causes(replace(good(), time=time)) == [Cause.NOT_FINITE]


def test_requested_states_are_within_tolerances():
    scenario = good()
    asked = asked_of(scenario)
    for column, off, expected in (
        (0, 0.099, 0),
        (0, 0.101, 1),
        (1, -0.101, 1),
        (3, 0.099, 0),
        (3, -0.101, 1),
        (2, 0.5, 0),
    ):
        for name in ("start", "end"):
            states = np.array(getattr(asked, name))
            states[1, column] += off
            assert (
                causes(scenario, requested=replace(asked, **{name: states}))
                == [Cause.BOUNDARY_STATE] * expected
            )


CROSSING = (straight(-90, 0, 0, 9, TIME), straight(0, -60, np.pi / 2, 7, TIME))


def test_passing_order_is_the_template_s():
    scenario = scenario_of(CROSSING, TIME)
    kept = find_conflicts(scenario)
    assert causes(scenario, conflicts=kept) == []
    reverse = (Conflict(kept[0].second, kept[0].first, False, 0.0, 1.0, 2.0, 3.0),)
    assert causes(scenario, conflicts=reverse) == [Cause.PASSING_ORDER]


def test_missing_conflict_is_counted_not_refused():
    lanes = scenario_of(
        [straight(-90, 0, 0, 9, TIME), straight(90, 4, np.pi, 9, TIME), CROSSING[1]], TIME
    )
    conflicts = tuple(Conflict(a, b, False, 0.0, 1.0, 2.0, 3.0) for a, b in ((1, 0), (2, 0)))
    (verdict,) = Checker(ROAD, None, conflicts, None).check([lanes])
    assert (verdict.valid, verdict.conflicts, verdict.not_applicable) == (True, 1, 1)


def stopping(stop, crawl=0.0):
    return good(
        speed_profile(-90, 0, 0, [0, 5, 8, 8 + stop, 12 + stop, 20], [9, 9, crawl, crawl, 8, 8])
    )


def test_wait_stands_for_a_second():
    waits = (Wait(0, 7.0, 10.0),)
    assert causes(stopping(1.2), waits=waits) == []
    assert causes(stopping(0.5), waits=waits) == [Cause.STOP_NOT_KEPT]
    assert causes(stopping(3.0, crawl=0.15), waits=waits) == [Cause.STOP_NOT_KEPT]
    assert causes(stopping(3.0, crawl=0.05), waits=waits) == []


def test_creeping_wait_is_slow_one_second():
    waits = (Wait(0, 7.0, 10.0, moves_slowly=True),)
    assert causes(stopping(3.0, crawl=0.4), waits=waits) == []
    assert causes(stopping(1.2), waits=waits) == []
    assert causes(stopping(3.0, crawl=0.6), waits=waits) == [Cause.STOP_NOT_KEPT]
    both = (Wait(0, 2.0, 3.5), Wait(0, 7.0, 10.0, moves_slowly=True))
    assert causes(stopping(3.0, crawl=0.4), waits=both) == [Cause.STOP_NOT_KEPT]
    assert causes(stopping(3.0), waits=both) == []


def test_two_waits_need_two_stands():
    waits = (Wait(0, 2.0, 3.5), Wait(0, 5.0, 6.2))
    assert causes(stopping(1.2), waits=waits) == [Cause.STOP_NOT_KEPT]
    assert causes(stopping(2.4), waits=waits) == []
    twice = speed_profile(-90, 0, 0, [0, 3, 4.5, 7, 10, 11.5, 15, 20], [6, 0, 0, 5, 0, 0, 6, 6])
    assert causes(good(twice), waits=waits) == []


def test_creeping_under_standstill_is_no_stand():
    scenario = stopping(1.2)
    position = np.array(scenario.position)
    position[0, 80:93, 0] += 0.015 * np.arange(13)  # 0.15 m/s, while the speed says 0
    position[0, 93:, 0] += 0.18
    assert causes(replace(scenario, position=position), waits=(Wait(0, 7.0, 8.2),)) == [
        Cause.STOP_NOT_KEPT
    ]


def test_unchecked_claims_are_named():
    checker = Checker(None, None, None, None)
    assert [sentence.split(":")[0] for sentence in checker.not_applicable] == [
        "off_road",
        "boundary_state",
        "passing_order",
        "stop_not_kept",
    ]
    assert Checker(ROAD, asked_of(good()), (), ()).not_applicable == ()
    far = scenario_of([straight(1e5, 0, 0, 5, TIME)], TIME)
    assert checker.check([far])[0].valid
    assert causes(far) == [Cause.OFF_ROAD]


def test_unsuitable_requests_are_errors():
    scenario = good()
    with pytest.raises(InputError, match="frame 'odom'"):
        Checker(ROAD, None, None, None).check([replace(scenario, frame_id="odom")])
    with pytest.raises(InputError, match="shape"):
        Checker(None, None, None, None).check([replace(scenario, speed=scenario.speed[:, :-1])])
    with pytest.raises(InputError, match="positive"):
        Checker(None, None, None, None).check(
            [replace(scenario, vehicles=(Vehicle("a"), Vehicle("b", 0.0)))]
        )
    with pytest.raises(InputError, match="max_speed"):
        Dynamics(max_speed=-1.0)


def test_least_gap_follows_the_template():
    time = np.arange(51) * 0.1
    position = np.stack([np.column_stack([5.0 * time, np.full(51, y)]) for y in (0.0, 2.5)])
    beside = encounter_of(position, speed=5.0)
    assert Limits().clearance == 0.0  # nothing is known of a template
    assert Limits().for_template(Situation.of(beside)).clearance == pytest.approx(
        0.3
    )  # half of 2.5 m less the width
    far = replace(beside, position=position + np.array([[[0.0, 0.0]], [[0.0, 8.0]]]))
    assert Limits().for_template(Situation.of(far)).clearance == 0.5
    overlapping = replace(beside, position=position * np.array([1.0, 0.2]))
    assert Limits().for_template(Situation.of(overlapping)).clearance == 0.0
    assert Limits(min_clearance=0.1).for_template(Situation.of(beside)).clearance == 0.1
    late = replace(beside, present=np.array([[0, 20], [10, 50]]), position=position)
    assert Limits().for_template(Situation.of(late)).clearance == pytest.approx(0.3)
