# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""RRT*-Connect: Algorithms 1-5 of the paper's appendix, with steering as a parameter.

Two rapidly-exploring trees rewire, meet, and keep growing. `steering` defines their edges:
straight lines, as in the paper, or Dubins curves of a vehicle. Lengths are in cells.
"""

import numpy as np

from scenario_gen.method.routing.search.dubins import length_of, Pose
from scenario_gen.method.routing.search.sampler import random_pose, RULES, Rules, STATES
from scenario_gen.method.routing.search.steering import distance, edge_cost, pose_on_edge, steer
from scenario_gen.method.routing.search.sweep import SCENE, Scene
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
from scenario_gen.numerics import Ints
from scenario_gen.numerics.kernels import I, kernel, OUTI2

TRAPPED_CODE, ADVANCED_CODE, REACHED_CODE = 0, 1, 2
MIN_GAIN_CELLS = 1e-6  # a smaller decrease of a cost changes nothing
SAME_POSE_CELLS = 1e-6  # closer poses are the same
MAX_CONNECT_STEPS = 1_000_000


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
