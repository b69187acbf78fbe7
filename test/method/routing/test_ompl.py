# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""OMPL's planners behind the Protocol: sound curves of a car; the caller survives hangs and crashes."""

import numpy as np
import pytest

pytest.importorskip("ompl", reason="OMPL is not installed: pip install 'scenario_gen[planners]'")

from benchmarks._planning_obstructed import parked, straight_fit
from scenario_gen.method.routing import plan_routes, PlanningConfig
from scenario_gen.method.routing.search.car_planner import PoseRrtStarConnect
from scenario_gen.method.routing.search.ompl_planners import OmplConfig, OmplPlanner
from scenario_gen.method.routing.search.ompl_solve import PLANNERS
from scenario_gen.method.routing.search.planner import Budget, BudgetSpentError, path_length
from scenario_gen.method.routing.search.sweep import sweep_is_free
from scenario_gen.numerics import wrap_angle

CASE = parked(2)
ROAD, QUERY = CASE.road, CASE.query


@pytest.fixture(scope="module")
def ours():
    return PoseRrtStarConnect().plan_poses(ROAD, QUERY, Budget(1000), 7)


@pytest.mark.parametrize("name", PLANNERS)
def test_each_planner_finds_a_sound_curve(ours, name):
    plans = [OmplPlanner(name).plan_poses(ROAD, QUERY, Budget(200), 7) for _ in range(2)]
    path = plans[0].path
    np.testing.assert_array_equal(path, plans[1].path)
    np.testing.assert_allclose(path[[0, -1]], [QUERY.start, QUERY.goal], atol=1e-9)
    free = sweep_is_free(ROAD, path, QUERY.length, QUERY.width)
    assert free.all()
    turn = np.abs(wrap_angle(np.diff(path[:, 2])))
    lengths = np.hypot(*np.diff(path[:, :2], axis=0).T)
    assert (turn <= QUERY.curvature * lengths * 1.02 + 1e-9).all()
    assert plans[0].cost == pytest.approx(path_length(path)) and plans[0].cost < 1.3 * ours.cost


def test_routes_use_the_chosen_planner():
    fit = straight_fit(QUERY)
    (route,) = plan_routes(ROAD, fit, PlanningConfig(planner="ompl_rrt_connect"), 1)
    assert route.searched == 1
    free = sweep_is_free(ROAD, route.points, QUERY.length, QUERY.width)
    assert free.all()


def test_hang_and_crash_are_answers():
    endless = Budget(None)
    with pytest.raises(BudgetSpentError, match="did not answer within 1 s and was ended"):
        config = OmplConfig(time_limit=1.0)
        OmplPlanner("ompl_rrt_star", config).plan_poses(ROAD, QUERY, endless, 0)
    with pytest.raises(BudgetSpentError, match="without an answer"):
        OmplPlanner("no such planner").plan_poses(ROAD, QUERY, endless, 0)
