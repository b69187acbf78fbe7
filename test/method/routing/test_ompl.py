# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""OMPL's planners behind the Protocol: sound answers; the caller survives hangs and crashes."""

import numpy as np
import pytest

from benchmarks._planning_maps import enters_blocked, optimum, t_intersection
from scenario_gen.method.routing.search.ompl.planners import OmplConfig, OmplPlanner
from scenario_gen.method.routing.search.ompl.solve import PLANNERS
from scenario_gen.method.routing.search.planner import Budget, BudgetSpentError, Query

ROAD, ENDS = t_intersection()


@pytest.mark.parametrize("name", PLANNERS)
def test_each_planner_finds_a_sound_path_and_keeps_its_seed(name):
    plans = [OmplPlanner(name).plan(ROAD, Query(*ENDS), Budget(3000), 7) for _ in range(2)]
    np.testing.assert_array_equal(plans[0].path, plans[1].path)
    np.testing.assert_array_equal(plans[0].path[[0, -1]], ENDS)
    assert not enters_blocked(ROAD.drivable, plans[0].path)
    best = optimum(ROAD, ENDS)
    assert best - 1e-9 <= plans[0].cost <= 1.1 * best


def test_a_hang_a_crash_and_a_change_of_mind_are_answers():
    query, endless = Query(*ENDS), Budget(None)
    with pytest.raises(BudgetSpentError, match="did not answer within 1 s and was ended"):
        OmplPlanner("ompl_rrt_star", OmplConfig(time_limit=1.0)).plan(ROAD, query, endless, 0)
    with pytest.raises(BudgetSpentError, match="without an answer"):
        OmplPlanner("no such planner").plan(ROAD, query, endless, 0)
    with pytest.raises(BudgetSpentError, match="cancelled"):
        OmplPlanner("ompl_rrt_star").plan(ROAD, query, Budget(None, cancelled=lambda: True), 0)
