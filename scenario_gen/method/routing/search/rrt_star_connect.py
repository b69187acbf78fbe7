# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""RRT*-Connect: Algorithms 1-5 of the paper's appendix, with steering as a parameter.

Two rapidly-exploring trees rewire, meet, and keep growing. `sweep` defines their edges: straight
lines, as in the paper, or Dubins curves of a vehicle. Samples are free poses through which a
better path is possible. Lengths are in cells.
"""

from typing import NamedTuple

import numpy as np

from scenario_gen.method.routing.search.dubins import FULL_TURN_RAD, length_of, Pose
from scenario_gen.method.routing.search.sweep import (
    distance,
    edge_cost,
    is_free,
    pose_on_edge,
    SCENE,
    Scene,
    steer,
)
from scenario_gen.method.routing.search.trees import (
    add_node,
    attach,
    detach,
    has_room,
    near_nodes,
    nearest_node,
    pose_of,
    propagate_cost,
    Records,
    TREE,
    Tree,
)
from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.kernels import B, F, F2, I, I1, kernel, named, OUTI2
from scenario_gen.numerics.numba_import import numba

TRAPPED_CODE, ADVANCED_CODE, REACHED_CODE = 0, 1, 2
MIN_GAIN_CELLS = 1e-6  # a smaller decrease of a cost changes nothing
SAME_POSE_CELLS = 1e-6  # closer poses are the same
MAX_CONNECT_STEPS = 1_000_000
STATE = np.dtype(
    [
        ("active", np.int64),  # the tree to extend next: 0 or 1
        ("iteration", np.int64),
        ("meetings", np.int64),
        ("bound", np.float64),  # a useful path costs less: infinite unless the search is informed
        ("random", np.uint64),  # state of the generator
    ]
)
STATES = numba.types.Array(numba.from_dtype(STATE), 1, "C")
SPREAD_SHARES = np.array([1.0, 0.5, 0.25, 0.125])  # narrow gaps need samples close to the path
MAX_ATTEMPTS_COUNT = 100  # to draw a sample that can help


class Rules(NamedTuple):
    """How the trees grow.

    Attributes:
        cells: (n,) flat indices of the cells to sample from.
        near: (G, 3) poses to sample near; may be empty.
        near_share: share of the samples near them.
        spread: standard deviation of these samples.
        yaw_spread: standard deviation of their headings [rad].
        step: longest new edge.
        gamma: of eq 10.
        zeta: largest near radius of eq 10.
        exponent: 1/d of eq 10.
        greedy: extend both trees as far as possible, without rewiring, until they meet.
        informed: discard what cannot improve the best path.
    """

    cells: Ints
    near: Floats
    near_share: float
    spread: float
    yaw_spread: float
    step: float
    gamma: float
    zeta: float
    exponent: float
    greedy: bool
    informed: bool


RULES = named(Rules, I1, F2, F, F, F, F, F, F, F, B, B)


@kernel(inline=True, forced=True)
def _uniform(state: Records) -> float:
    """Return a number in [0, 1) from SplitMix64 (Steele, Lea & Flood 2014)."""
    state[0].random += np.uint64(0x9E3779B97F4A7C15)
    z = state[0].random
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    value: float = float((z ^ (z >> np.uint64(31))) >> np.uint64(11)) * 2.0**-53
    return value


@kernel(inline=True)
def _bell(state: Records) -> float:
    """Return a number of mean 0 and variance 1: the sum of four uniform numbers, scaled."""
    total = _uniform(state) + _uniform(state) + _uniform(state) + _uniform(state)
    return float((total - 2.0) * np.sqrt(3.0))


@kernel(inline=True)
def _pose_near(rules: Rules, state: Records) -> Pose:
    """Return a random pose near one of the known poses."""
    k = int(_uniform(state) * rules.near.shape[0])
    x, y, yaw = rules.near[k, 0], rules.near[k, 1], rules.near[k, 2]
    share = SPREAD_SHARES[int(_uniform(state) * SPREAD_SHARES.size)]
    ahead = rules.spread * _bell(state)
    left = share * rules.spread * _bell(state)
    cos, sin = np.cos(yaw), np.sin(yaw)
    turned = yaw + share * rules.yaw_spread * _bell(state)
    return Pose(x + cos * ahead - sin * left, y + sin * ahead + cos * left, turned)


@kernel(inline=True)
def _pose_in_cells(rules: Rules, columns: int, state: Records) -> Pose:
    """Return a random pose in one of the cells, uniformly."""
    cell = rules.cells[int(_uniform(state) * rules.cells.size)]
    x = cell % columns + _uniform(state)
    y = cell // columns + _uniform(state)
    return Pose(x, y, FULL_TURN_RAD * _uniform(state))


@kernel(inline=True)
def random_pose(start: Pose, goal: Pose, scene: Scene, rules: Rules, state: Records) -> Pose:
    """Return a random free pose through which a path can cost less than the bound.

    Source: the informed set is that of Gammell, Srinivasa & Barfoot 2014.
    """
    pose = goal
    for _ in range(MAX_ATTEMPTS_COUNT):
        if rules.near.shape[0] > 0 and _uniform(state) < rules.near_share:
            pose = _pose_near(rules, state)
        else:
            pose = _pose_in_cells(rules, scene.clearance.shape[1], state)
        shortest = distance(start, pose) + distance(pose, goal)
        if shortest < state[0].bound and is_free(pose, scene):
            break
    return pose


@kernel(inline=True, forced=True)
def _near_radius(tree: Tree, rules: Rules) -> float:
    """Return |V| of eq 10, never capped at the step size (Karaman & Frazzoli 2011)."""
    n = float(max(tree.size[0], 2))
    return float(min(rules.gamma * (np.log(n) / n) ** rules.exponent, rules.zeta))  # eq 10


@kernel(inline=True, forced=True)
def _choose_parent(
    tree: Tree, nearest: int, pose: Pose, cost: float, count: int, scene: Scene
) -> tuple[int, float]:
    """Algorithm 4: return the parent by which a pose costs least, and the cost of the edge."""
    parent = nearest  # line 1
    least = tree.node[nearest].cost + cost  # line 2
    for k in range(count):  # line 3
        m = tree.near[k].node
        root_cost = tree.node[m].cost
        if root_cost + tree.near[k].distance >= least - MIN_GAIN_CELLS:
            continue
        start = pose_of(tree, m)
        edge = steer(start, pose, scene.body)
        if root_cost + length_of(edge) >= least - MIN_GAIN_CELLS:
            continue
        other_cost = edge_cost(start, pose, edge, scene)
        if root_cost + other_cost < least - MIN_GAIN_CELLS:  # line 4
            parent, cost = m, other_cost  # line 5
            least = root_cost + cost  # line 6
    return parent, cost  # line 7


@kernel(inline=True, forced=True)
def _rewire(tree: Tree, new: int, count: int, scene: Scene) -> None:
    """Algorithm 5: make near nodes children of a new node where this lowers their cost."""
    start, root_cost = pose_of(tree, new), tree.node[new].cost
    for k in range(count):  # line 1
        m = tree.near[k].node
        most = tree.node[m].cost - MIN_GAIN_CELLS
        if root_cost + tree.near[k].distance >= most:
            continue
        end = pose_of(tree, m)
        edge = steer(start, end, scene.body)
        if root_cost + length_of(edge) >= most:
            continue
        cost = edge_cost(start, end, edge, scene)
        if root_cost + cost < most:  # line 2
            detach(tree, m)
            attach(tree, m, new, cost)  # lines 3 and 4
            propagate_cost(tree, m)


@kernel(inline=True, forced=True)
def _extend(
    tree: Tree, target: Pose, nearest: int, greedy: bool, scene: Scene, rules: Rules, bound: float
) -> tuple[int, int]:
    """Algorithm 2: one step from the nearest node to a pose; return its outcome and new node."""
    start, pose, status = pose_of(tree, nearest), target, REACHED_CODE
    edge = steer(start, target, scene.body)
    if length_of(edge) < SAME_POSE_CELLS:
        return REACHED_CODE, nearest
    if length_of(edge) > rules.step:
        pose = pose_on_edge(start, target, edge, rules.step, scene.body)  # line 2
        edge = steer(start, pose, scene.body)
        status = ADVANCED_CODE
    cost = edge_cost(start, pose, edge, scene)
    if cost == np.inf:  # line 3
        return TRAPPED_CODE, -1
    count, parent = 0, nearest
    if not greedy:
        count = near_nodes(tree, pose, _near_radius(tree, rules))  # line 4
        parent, cost = _choose_parent(tree, nearest, pose, cost, count, scene)  # line 5
    if tree.node[parent].cost + cost + distance(pose, tree.goal) >= bound:
        return TRAPPED_CODE, -1
    new = add_node(tree, pose, parent, cost)  # line 6
    _rewire(tree, new, count, scene)  # line 7
    return status, new  # lines 8 to 12


@kernel(inline=True)
def _connect(
    tree: Tree,
    target: Pose,
    max_steps: int,
    greedy: bool,
    scene: Scene,
    rules: Rules,
    bound: float,
) -> tuple[int, int]:
    """Algorithm 3: extend a tree until it reaches a pose or is trapped; return the last node.

    With one step at most it is Algorithm 2. Without a new node, the node is -1.
    """
    status, last, steps = ADVANCED_CODE, -1, 0
    nearest = nearest_node(tree, target, scene.body)  # line 1 of Algorithm 2
    while status == ADVANCED_CODE and steps < max_steps and has_room(tree):
        status, new = _extend(tree, target, nearest, greedy, scene, rules, bound)
        last = new if new >= 0 else last
        nearest = last  # it is the nearest one now
        steps += 1
    return status, last


@kernel(inline=True, forced=True)
def _turned_back(pose: Pose) -> Pose:
    """Return a pose of one tree in the direction of the other one."""
    return Pose(pose.x, pose.y, pose.yaw + np.pi)


@kernel(inline=True)
def _next_target(tree: Tree, start_tree: Tree, scene: Scene, rules: Rules, state: Records) -> Pose:
    """Line 3 of Algorithm 1; the first sample is the root of the other tree: the direct edge."""
    if state[0].iteration == 0:
        return tree.goal
    pose = random_pose(start_tree.root, start_tree.goal, scene, rules, state)
    return pose if state[0].active == 0 else _turned_back(pose)


@kernel(inline=True)
def _extend_and_connect(
    tree: Tree,
    other: Tree,
    target: Pose,
    greedy: bool,
    scene: Scene,
    rules: Rules,
    bound: float,
) -> tuple[int, int]:
    """Lines 4 and 5 of Algorithm 1; return the nodes at which the trees meet, or -1 and -1."""
    steps = MAX_CONNECT_STEPS if greedy else 1
    _, new = _connect(tree, target, steps, greedy, scene, rules, bound)  # line 4
    if new < 0:
        return -1, -1
    target = _turned_back(pose_of(tree, new))
    steps = MAX_CONNECT_STEPS
    status, reached = _connect(other, target, steps, greedy, scene, rules, bound)  # line 5
    return (new, reached) if status == REACHED_CODE else (-1, -1)


@kernel(I, SCENE, RULES, TREE, TREE, OUTI2, STATES, on_demand=True)
def grow(
    iterations: int,
    scene: Scene,
    rules: Rules,
    start_tree: Tree,
    goal_tree: Tree,
    meeting: Ints,
    state: Records,
) -> None:
    """Algorithm 1 for at most `iterations`; returns early at the first meeting and without room.

    Args:
        iterations: K.
        scene: what edges are checked against.
        rules: how the trees grow.
        start_tree: T_a at first.
        goal_tree: T_b at first.
        meeting: (M, 2) nodes of both trees at which they meet; all are recorded.
        state: (1,) of `STATE`.
    """
    s = state[0]
    for _ in range(iterations):  # line 2
        has_rows = s.meetings < meeting.shape[0]
        if not (has_rows and has_room(start_tree) and has_room(goal_tree)):
            return
        forward = s.active == 0
        tree, other = (start_tree, goal_tree) if forward else (goal_tree, start_tree)
        target = _next_target(tree, start_tree, scene, rules, state)
        greedy = rules.greedy and s.meetings == 0
        new, reached = _extend_and_connect(tree, other, target, greedy, scene, rules, s.bound)
        s.iteration += 1
        s.active = 1 - s.active  # line 6
        if new < 0:
            continue
        meeting[s.meetings, 0 if forward else 1] = new
        meeting[s.meetings, 1 if forward else 0] = reached
        s.meetings += 1
        if rules.informed:
            s.bound = min(s.bound, tree.node[new].cost + other.node[reached].cost)
        if s.meetings == 1:
            return
