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
    plan_with_retry,
    Query,
    RrtStarConnect,
    RrtStarConnectConfig,
    straight_path,
)
from benchmarks._planning_maps import (
    clutter,
    enters_blocked,
    lane,
    optimum,
    road_of,
    t_intersection,
)
from scenario_gen.base.errors import RefusedError
from scenario_gen.method.routing.search.planner import (
    BlockedError,
    Budget,
    BudgetSpentError,
    NoWayError,
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
def test_cost_is_near_the_optimum_and_never_below(seed, density):
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


@pytest.mark.parametrize(
    ("case", "slack"), [(lane, 1e-9), (t_intersection, 1e-4), (clutter, 3e-3)]
)
def test_large_maps_come_close_to_the_true_optimum(case, slack):
    road, ends = case()
    best = optimum(road, ends)
    plan = RrtStarConnect().plan(road, Query(*ends), Budget(40_000), 1)
    assert best - 1e-6 <= plan.cost <= best * (1.0 + slack)
    assert (np.diff(plan.history[:, 2]) < 0.0).all()
    assert plan.history[-1, 2] == pytest.approx(plan.cost)


def test_the_paper_preset_goes_on_improving_after_the_first_meeting():
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


def small():
    return road_of("small", np.ones((8, 30), dtype=bool)), np.array([[1.5, 1.5], [28.5, 6.5]])


def grown(road, ends, config, iterations):
    """The search after some iterations, and the nodes of both trees."""
    search = RrtStarConnect(config).search(FreeSpace(road, 0.0), Query(*ends), 1, 2)
    search.grow(iterations)
    while search.iteration < iterations:
        search.grow(iterations - search.iteration)
    return search, [tree.node[: tree.size[0]] for tree in search.trees]


def xy(node):
    return np.column_stack((node["x"], node["y"]))


@pytest.mark.parametrize("config", [RrtStarConnectConfig(), PAPER], ids=["default", "paper"])
@pytest.mark.parametrize("case", [clutter, lane, small])
def test_large_trees_are_whole(config, case):
    road, ends = case()
    search, trees = grown(road, ends, config, 20_000)
    for tree, node in zip(search.trees, trees, strict=True):
        linked = []
        for first in tree.bucket[tree.bucket >= 0]:
            m = first
            while m >= 0:
                linked.append(m)
                m = node["next_in_bucket"][m]
        assert sorted(linked) == list(range(len(node)))
        child = node[1:]
        parent = node[child["parent"]]
        edge = np.hypot(*(xy(child) - xy(parent)).T)
        np.testing.assert_allclose(child["edge_cost"], edge, atol=1e-9)
        np.testing.assert_allclose(child["cost"], parent["cost"] + edge, atol=1e-7)
        assert segments_free(road, xy(parent), xy(child), 0.0).all()
    path = straight_path(search)
    assert path_length(path) == pytest.approx(search.best)
    np.testing.assert_array_equal(path[[0, -1]], ends)


def test_the_cheapest_of_all_meeting_nodes_wins():
    search, trees = grown(*t_intersection(), PAPER, 5_000)
    count = search.state["meetings"][0]
    costs = sum(node["cost"][search.meeting[:count, k]] for k, node in enumerate(trees))
    assert count > 100
    assert search.best == pytest.approx(costs.min())


def test_only_an_informed_search_discards_useless_samples():
    drivable = np.ones((200, 200), dtype=bool)
    drivable[95:140, 100] = False  # a wall to go round
    road, ends = road_of("open", drivable), np.array([[80.5, 100.5], [120.5, 100.5]])
    for config, everywhere in (
        (PAPER, True),
        (RrtStarConnectConfig(greedy=False, pull=False), False),
    ):
        search, trees = grown(road, ends, config, 4_000)
        places = np.concatenate([xy(node) for node in trees])
        detour = np.hypot(*(places - ends[0]).T) + np.hypot(*(places - ends[1]).T)
        assert (np.mean(detour > 2.0 * search.best) > 0.3) == everywhere


def test_same_seed_same_path():
    road, ends = clutter()
    plans = [RrtStarConnect().plan(road, Query(*ends), Budget(3000), seed) for seed in (4, 4, 5)]
    np.testing.assert_array_equal(plans[0].path, plans[1].path)
    assert not np.array_equal(plans[0].path, plans[2].path)


def test_failures_are_told_apart():
    drivable = np.ones((60, 60), dtype=bool)
    drivable[:, 30] = False
    road = road_of("two halves", drivable)
    planner = RrtStarConnect()
    left, right, wall = np.array([5.5, 5.5]), np.array([50.5, 50.5]), np.array([30.5, 5.5])
    with pytest.raises(BlockedError, match=r"start \(30.50, 5.50\)") as caught:
        planner.plan(road, Query(wall, right), Budget(), 0)
    assert caught.value.end == "start"
    with pytest.raises(BlockedError, match="goal"):
        planner.plan(road, Query(left, wall), Budget(), 0)
    with pytest.raises(NoWayError, match="no route leads"):
        planner.plan(road, Query(left, right), Budget(10**9), 0)  # at once: the components say so
    drivable = drivable.copy()
    drivable[59, 30] = True
    with pytest.raises(BudgetSpentError, match="3 iterations"):
        planner.plan(road_of("a gap", drivable), Query(left, right), Budget(3), 0)
    with pytest.raises(BudgetSpentError):
        planner.plan(
            road_of("a gap", drivable),
            Query(left, right),
            Budget(10**9, cancelled=lambda: True),
            0,
        )


def test_a_disc_needs_its_room():
    drivable = np.ones((40, 40), dtype=bool)
    drivable[:, 20] = False
    drivable[10:13, 20] = True  # three cells wide
    road = road_of("gate", drivable)
    query = np.array([5.5, 30.5]), np.array([35.5, 30.5])
    wide = RrtStarConnect().plan(road, Query(*query, 1.4), Budget(2000), 0)
    assert segments_free(road, wide.path[:-1], wide.path[1:], 1.4).all()
    assert wide.cost > RrtStarConnect().plan(road, Query(*query, 0.0), Budget(2000), 0).cost
    with pytest.raises(NoWayError):
        RrtStarConnect().plan(road, Query(*query, 1.6), Budget(2000), 0)


def test_a_retry_finds_a_path_that_a_small_budget_does_not():
    drivable = np.zeros((60, 60), dtype=bool)
    drivable[:, :28] = drivable[:, 34:] = True
    drivable[57, :] = True
    road, query = (
        road_of("a far gap", drivable),
        Query(np.array([2.5, 2.5]), np.array([57.5, 2.5])),
    )
    with pytest.raises(BudgetSpentError):
        RrtStarConnect().plan(road, query, Budget(20), 0)
    plan = plan_with_retry(RrtStarConnect(), road, query, 20, 0)
    assert plan.iterations > 20
    assert not enters_blocked(drivable, plan.path)
