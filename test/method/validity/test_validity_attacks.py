# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Scenarios and requests made to deceive the checker: each of them is refused."""

from dataclasses import replace

import numpy as np
import pytest
from support.motions import causes_of, FREE, open_road, scenario_of, straight

from scenario_gen.base.errors import InputError
from scenario_gen.method.validity import Checker, containment, dynamics, Limits
from scenario_gen.method.validity.collision import ExtendedMotion
from scenario_gen.method.validity.dynamics import LARGEST_VALUE_RATIO
from scenario_gen.situation import Conflict, find_waits, Situation, Wait
from scenario_gen.types import Encounter, Vehicle
from scenario_gen.types.scenario import BoundaryStates, Cause

TIME = np.arange(101) * 0.1


def passing(time=TIME):
    """Two cars in opposite lanes: nothing is wrong with them."""
    return scenario_of([straight(-25, 0, 0, 5, time), straight(25, 4, np.pi, 5, time)], time)


def states(scenario, k):
    return np.column_stack((scenario.position[:, k], scenario.heading[:, k], scenario.speed[:, k]))


def causes(scenario, limits=Limits(), **known):
    return causes_of(scenario, limits=limits, **known)


@pytest.mark.parametrize("column", [0, 1, 3])
@pytest.mark.parametrize("end", ["start", "end"])
def test_nan_requests_are_never_met(column, end):
    scenario = passing()
    asked = {"start": states(scenario, 0), "end": states(scenario, -1)}
    assert causes(scenario, requested=BoundaryStates(**asked)) == []
    asked[end][1, column] = np.nan
    assert causes(scenario, requested=BoundaryStates(**asked)) == [Cause.BOUNDARY_STATE]


def test_nan_frees_no_state():
    scenario = passing()
    asked = BoundaryStates(
        states(scenario, 0) + 5.0, states(scenario, -1), np.full((2, 2, 2), np.nan)
    )
    assert Cause.BOUNDARY_STATE in causes(scenario, requested=asked)


def test_request_for_fewer_vehicles_is_refused():
    scenario = passing()
    with pytest.raises(InputError, match="states were requested for 1"):
        causes(scenario, requested=BoundaryStates(states(scenario, 0), states(scenario, -1)[:1]))


@pytest.mark.parametrize("index", [-1, 2])
def test_wait_of_nobody_is_refused(index):
    with pytest.raises(InputError, match=f"name vehicle {index}"):
        causes(passing(), waits=[Wait(index, 2.0, 8.0)])
    with pytest.raises(InputError, match=f"name vehicle {index}"):
        causes(passing(), conflicts=[Conflict(0, index, False, 1.0, 2.0, 3.0, 4.0)])


@pytest.mark.parametrize(
    ("present", "ends"), [([0, 1], "leaves"), ([99, 100], "enters"), ([50, 51], "enters")]
)
def test_standing_vehicle_does_not_vanish(present, ends):
    """Its first and last state are as asked, it never moves, and it is gone when the other one drives through its place."""
    template = scenario_of([straight(0, 0, 0, 0.0, TIME), straight(-25, 9, 0, 5.0, TIME)], TIME)
    arrays = (template.time, template.position, template.heading, template.speed)
    encounter = Encounter(template.vehicles, *arrays, "t")
    asked = BoundaryStates(states(template, 0), states(template, -1))
    own = Checker.of_template(
        Situation.of(encounter), open_road(), asked, find_waits(encounter), FREE
    )
    assert not own.check([template])[0].violations
    (verdict,) = own.check([replace(template, present=np.array([present, [0, 100]]))])
    assert Cause.BOUNDARY_STATE in {violation.cause for violation in verdict.violations}
    assert (
        f"vehicle 0: {ends} at {0.1 * present[ends == 'leaves']:.3f} s"
        in verdict.violations[0].message
    )
    late = replace(encounter, present=np.array([[20, 80], [0, 100]]))
    own = Checker.of_template(Situation.of(late), open_road(), asked, find_waits(late), FREE)
    assert not own.check([replace(template, present=np.array([[10, 90], [0, 100]]))])[
        0
    ].violations, "who comes late may"
    (verdict,) = own.check([replace(template, present=np.array([[20, 21], [0, 100]]))])
    assert [violation.cause for violation in verdict.violations] == [Cause.STOP_NOT_KEPT], (
        "but it waits"
    )


@pytest.mark.parametrize("step", [0.1, 0.7, 1.2, 2.0])
def test_vanished_vehicle_is_not_driven_over(step):
    """A car stands and goes at the fifth instant; another one gets there within a second, between that instant and the next."""
    time = np.arange(11) * step
    gone = time[4]
    behind = straight(-5.5 - 8.0 * gone, 0, 0, 8.0, time)
    scenario = replace(
        scenario_of([straight(0, 0, 0, 0.0, time), behind], time),
        present=np.array([[0, 4], [0, 10]]),
    )
    assert causes(scenario) == [Cause.OVERLAP]
    assert causes(scenario, limits=Limits(presence_margin=0.0)) == []


@pytest.mark.parametrize("step", [0.1, 0.3, 0.7])
@pytest.mark.parametrize("margin", [0.0, 0.6, 1.0])
def test_margin_is_whole_at_each_instant(step, margin):
    """However the sums are rounded: it reaches at least so far, and by less than a step more."""
    time = np.round(np.arange(101) * step, 9)
    for at in range(1, 99):
        scenario = replace(passing(time), present=np.array([[at, 100], [0, at]]))
        (first, _), (_, last) = time[ExtendedMotion.of(scenario, margin).present]
        for reached, whole in (
            (time[at] - first, time[at]),
            (last - time[at], time[-1] - time[at]),
        ):
            assert min(margin, whole) - 1e-8 <= reached < margin + step - 1e-8


def test_standing_vehicle_does_not_turn():
    """Half a turn on the spot in 32 ms, each step of it 0.1 mrad; a step of 0.1 s may show as much."""
    count = 32_000
    short = np.arange(count) * 1e-6
    turning = (np.zeros((count, 2)), np.arange(count) * 0.98e-4, np.zeros(count))
    assert causes(scenario_of([turning], short)) == [Cause.CURVATURE]
    long = (np.zeros((101, 2)), np.arange(101) * 0.98e-4, np.zeros(101))
    assert causes(scenario_of([long], TIME)) == []


@pytest.mark.parametrize("far", [2.0 * LARGEST_VALUE_RATIO, 1e15, 1e300])
def test_coarse_coordinates_prove_nothing(far):
    time = np.array([0.0, 1.0, 2.0])
    crossing = scenario_of(
        [straight(far - 30, 0, 0, 40, time), straight(far, -30, np.pi / 2, 40, time)], time
    )
    assert causes(crossing, limits=FREE) == [Cause.NOT_FINITE]


@pytest.mark.parametrize(
    "size", [(0.0, 1.0), (-1.0, 1.0), (np.nan, 1.0), (5.0, np.nan), (np.inf, 1.0), (1e-12, 1e-12)]
)
def test_no_size_permits_one_place(size):
    standing = [straight(0, 0, 0, 0.0, TIME)] * 2
    scenario = scenario_of(standing, TIME, (Vehicle("a", *size), Vehicle("b", *size)))
    if all(extent > 0.0 for extent in size):
        assert causes(scenario) == [Cause.OVERLAP]
    else:
        with pytest.raises(InputError, match="not positive"):
            causes(scenario)


def test_unfilled_results_are_refused(monkeypatch):
    monkeypatch.setattr(dynamics, "worst_excess", lambda *_: None)
    monkeypatch.setattr(containment, "first_exits", lambda *_: None)
    found = causes(passing(), road=open_road())
    assert found.count(Cause.OFF_ROAD) == 2
    assert {Cause.SPEED, Cause.CURVATURE, Cause.LATERAL_ACCELERATION} <= set(found)
