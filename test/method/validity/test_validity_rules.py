# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Stop lines of a map: who runs one is refused, unless the request ignores the map's rules."""

from dataclasses import replace

import numpy as np
import pytest
from support.motions import FREE, open_road, scenario_of, straight

from scenario_gen.method.validity import Checker
from scenario_gen.types import Cause, Lane, LaneNetwork, RuleKind, TrafficRule

TIME = np.linspace(0.0, 10.0, 101)


def causes(scenario, road):
    (verdict,) = Checker(road, None, None, None, FREE).check([scenario])
    return [violation.cause for violation in verdict.violations], verdict


def road_with(rules_kept=True):
    x = np.array([-40.0, 40.0])
    lane = Lane("east", *(np.column_stack((x, np.full(2, y))) for y in (2.0, -2.0)))
    rule = TrafficRule("sign 7", RuleKind.STOP, (0,), (), np.array([(0.0, -2.0), (0.0, 2.0)]))
    return replace(open_road(), lanes=LaneNetwork("one lane", (lane,), (), (rule,), rules_kept))


@pytest.mark.parametrize("start", [-25.0, -6.0])
def test_stop_line_runner_is_named(start):
    found, verdict = causes(scenario_of([straight(start, 0, 0, 5, TIME)], TIME), road=road_with())
    assert found == [Cause.TRAFFIC_RULE]
    (violation,) = verdict.violations
    assert "stop line of sign 7" in violation.message and violation.vehicles == (0,)
    assert violation.time == pytest.approx((-start - 2.4) / 5.0, abs=0.2)


@pytest.mark.parametrize("start", [2.0, -2.0])
def test_start_beyond_line_runs_nothing(start):
    assert causes(scenario_of([straight(start, 0, 0, 3, TIME)], TIME), road=road_with())[0] == []


def test_ignored_rules_are_not_checked():
    road = road_with(rules_kept=False)
    assert causes(scenario_of([straight(-25, 0, 0, 5, TIME)], TIME), road=road)[0] == []
    said = Checker(road, None, None, None).not_applicable
    assert "traffic_rule: the request ignores the map's rules" in said
    assert not any(
        sentence.startswith("traffic_rule")
        for sentence in Checker(road_with(), None, None, None).not_applicable
    )
