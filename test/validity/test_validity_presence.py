# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Validity of scenarios whose vehicles are there for a part of the time only."""

from dataclasses import replace

from hypothesis import given, settings
from hypothesis import strategies as st
from motions import FREE, open_road, scenario_of, straight, wander
import numpy as np
import pytest

from scenario_gen.template.interaction import Wait
from scenario_gen.types.scenario import BoundaryStates, Cause, Scenario
from scenario_gen.validity import Checker

TIME = np.arange(101) * 0.1
ROAD = open_road()


def together(present):
    """Two cars on the same place at 5 s; they meet from 4 s to 6 s."""
    return replace(scenario_of([straight(-25, 0, 0, 5, TIME), straight(25, 0, np.pi, 5, TIME)], TIME), present=np.array(present))


def causes(scenario, **known):
    given = {"road": ROAD, "asked": None, "conflicts": None, "waits": None, "limits": FREE} | known
    (verdict,) = Checker(**given).check([scenario])
    return [violation.cause for violation in verdict.violations], verdict


@pytest.mark.parametrize(
    ("present", "meets"),
    [
        ([[0, 100], [0, 100]], True),
        ([[0, 39], [0, 100]], False),  # gone before
        ([[0, 100], [62, 100]], False),  # comes after
        ([[0, 50], [45, 100]], True),
        ([[0, 38], [38, 100]], False),  # together at one instant, without a motion in common
        ([[0, 30], [40, 100]], False),  # never together
    ],
)
def test_footprints_overlap_only_while_both_are_there(present, meets):
    found, verdict = causes(together(present))
    assert found == ([Cause.OVERLAP] if meets else [])
    if meets:
        assert verdict.violations[0].time >= 0.1 * max(first for first, _ in present) - 1e-9


@given(st.integers(0, 10_000))
@settings(max_examples=20)
def test_a_presence_is_checked_as_its_own_cut_out_scenarios_are(seed):
    """Every vehicle alone, and every pair while both are there, cut out and checked as scenarios of their own."""
    rng = np.random.Generator(np.random.PCG64(seed))
    tracks = [wander(rng, TIME, 25.0) for _ in range(3)]
    present = np.sort(np.array([rng.choice(101, 2, replace=False) for _ in range(3)]), axis=1)
    whole = scenario_of(tracks, TIME)
    road = open_road(60.0)
    found, _ = causes(replace(whole, present=present), road=road, limits=replace(FREE, max_speed=12.0))
    expected = []
    for rows in ([0], [1], [2], [0, 1], [0, 2], [1, 2]):
        first, last = present[rows, 0].max(), present[rows, 1].min()
        if last - first < 1:
            continue
        own = slice(first, last + 1)
        values = (getattr(whole, name)[rows, own] for name in ("position", "heading", "speed", "acceleration"))
        part = Scenario(tuple(whole.vehicles[i] for i in rows), TIME[own] - TIME[first], *values)
        answer, _ = causes(part, road=road, limits=replace(FREE, max_speed=12.0))
        expected += [cause for cause in answer if (cause == Cause.OVERLAP) == (len(rows) == 2)]
    assert sorted(found) == sorted(expected)


def test_states_are_asked_of_a_vehicle_s_own_first_and_last_instant():
    scenario = together([[0, 39], [20, 100]])
    start = np.array([[-25, 0, 0, 5], [15, 0, np.pi, 5]], dtype=float)
    end = np.array([[-5.5, 0, 0, 5], [-25, 0, np.pi, 5]], dtype=float)
    assert causes(scenario, asked=BoundaryStates(start, end))[0] == []
    found, verdict = causes(scenario, asked=BoundaryStates(start + np.array([[0, 0, 0, 0], [1, 0, 0, 0]]), end))
    assert found == [Cause.BOUNDARY_STATE]
    assert verdict.violations[0].time == 2.0


def test_who_waits_from_its_arrival_on_to_its_end_stands_throughout():
    stands = straight(10, 30, 0, 0.0, TIME)
    scenario = replace(scenario_of([straight(-25, 0, 0, 5, TIME), stands], TIME), present=np.array([[0, 100], [20, 80]]))
    state = np.column_stack((scenario.position[:, 0], scenario.heading[:, 0], scenario.speed[:, 0]))
    asked = BoundaryStates(state, state + np.array([[50, 0, 0, 0], [0, 0, 0, 0]]))
    assert causes(scenario, asked=asked, waits=[Wait(1, 2.0, 8.0)])[0] == []
    speed = scenario.speed.copy()
    speed[1, 50] = 0.4
    assert causes(replace(scenario, speed=speed), asked=asked, waits=[Wait(1, 2.0, 8.0)])[0] == [Cause.STOP_NOT_KEPT]
