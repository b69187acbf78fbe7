# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The paper's planner: RRT*-Connect of a disc in the plane, close to the optimum, never shorter."""

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from support.lengths import LONG

from benchmarks._paper_planner import (
    PAPER,
    Query,
    RrtStarConnect,
    RrtStarConnectConfig,
)
from benchmarks._planning_maps import (
    enters_blocked,
    optimum,
    road_of,
    t_intersection,
)
from scenario_gen.base.errors import RefusedError
from scenario_gen.method.routing.search.planner import (
    Budget,
    BudgetSpentError,
    path_length,
)
from scenario_gen.roads.clearance import segments_free
from scenario_gen.roads.connectivity import FreeSpace

SMALL = 24
QUERIES = 300 if LONG else 90


def random_query(rng, density):
    drivable = rng.random((SMALL, SMALL)) > density
    drivable[0, 0] = True
    return road_of("random", drivable), rng.uniform(0.0, SMALL, (2, 2))


@pytest.mark.parametrize(
    "config", [RrtStarConnectConfig(step=4.0), PAPER], ids=["default", "paper"]
)
@pytest.mark.parametrize("radius", [0.0, 0.7])
def test_no_path_enters_a_blocked_cell(config, radius):
    rng = np.random.default_rng([1, int(10 * radius)])
    found = 0
    for seed in range(QUERIES):
        road, (start, goal) = random_query(rng, rng.uniform(0.01, 0.12 if radius else 0.4))
        try:
            plan = RrtStarConnect(config).plan(road, Query(start, goal, radius), Budget(400), seed)
        except RefusedError:
            continue
        found += 1
        np.testing.assert_array_equal(plan.path[[0, -1]], [start, goal])
        assert not enters_blocked(road.drivable, plan.path)
        assert segments_free(road, plan.path[:-1], plan.path[1:], radius).all()
        assert plan.cost == pytest.approx(path_length(plan.path))
    assert found > QUERIES / 5


@settings(max_examples=80)
@given(seed=st.integers(0, 2**32 - 1), density=st.floats(0.02, 0.35))
def test_cost_is_near_the_optimum(seed, density):
    rng = np.random.default_rng(seed)
    road, ends = random_query(rng, density)
    ends = np.floor(ends) + 0.5
    planner = RrtStarConnect(RrtStarConnectConfig(step=6.0))
    try:
        plan = planner.plan(road, Query(*ends), Budget(1500), 3)
    except BudgetSpentError:  # a maze: patience must find the way that the components promise
        plan = planner.plan(road, Query(*ends), Budget(500_000, first=True), 3)
        assert FreeSpace(road, 0.0).common_component(*ends) is not None
        assert plan.cost >= optimum(road, ends) - 1e-9
        return
    except RefusedError:
        assert FreeSpace(road, 0.0).common_component(*ends) is None
        return
    best = optimum(
        road, ends
    )  # may pass between two cells that touch at a corner: then it is shorter
    assert plan.cost >= best - 1e-9
    padded = ~np.pad(road.drivable, 1)
    pinched = (padded[:-1, :-1] & padded[1:, 1:] & ~padded[:-1, 1:] & ~padded[1:, :-1]).any()
    pinched |= (~padded[:-1, :-1] & ~padded[1:, 1:] & padded[:-1, 1:] & padded[1:, :-1]).any()
    if not pinched:
        assert plan.cost <= best * 1.01 + 1e-6


def test_paper_preset_goes_on_improving():
    road, ends = t_intersection()
    first = RrtStarConnect(PAPER).plan(road, Query(*ends), Budget(10_000, first=True), 5)
    later = RrtStarConnect(PAPER).plan(road, Query(*ends), Budget(10_000), 5)
    best = optimum(road, ends)
    assert later.iterations == 10_000
    assert best < later.cost < first.cost
    assert later.cost < 1.005 * best
    assert (
        np.hypot(*np.diff(first.path, axis=0).T).max() <= 30.0 + 1e-9
    )  # no edge longer than the near radius
