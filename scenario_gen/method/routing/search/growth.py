# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Algorithms 1-5 of the paper's appendix as kernels: two rapidly-exploring trees that rewire, meet, and go on.

`steering` says what an edge is: a straight line, as in the paper, or a car's curve. See `tree` for the trees' memory and
`tree_samples` for what they grow to. Lengths are in cells; `root` is 0 for the start's tree and 1 for the goal's.
"""

from typing import cast

import numpy as np

from scenario_gen.method.routing.search.dubins import Curve, length_of, piece, Pose
from scenario_gen.method.routing.search.steering import end_of_first, price, steer, surely_free
from scenario_gen.method.routing.search.sweep import CAR_SCENE, DISC_SCENE, Scene
from scenario_gen.method.routing.search.tree import (  # fmt: skip
    adopt,
    COST,
    EDGE,
    insert,
    LINE,
    near_nodes,
    nearest_node,
    next_sample,
    PARENT,
    PARTNER,
    pose_of,
    propagate,
    release,
    settle,
    TREE,
    Tree,
)
from scenario_gen.method.routing.search.tree_samples import apart, detour, RULES, Rules
from scenario_gen.numerics.kernels import I, kernel

TRAPPED, ADVANCED, REACHED = 0, 1, 2
NONE = cast("int", np.int64(-1))  # no node; for a literal numba would compile a function once more
GAIN = 1e-6  # what lowers a cost by less changes nothing
SAME = 1e-6  # poses nearer to each other are one


@kernel(inline=True, forced=True)
def _has_room(tree: Tree) -> bool:
    """Whether another node can be added."""
    return bool(tree.state[0].chunks + 1 < tree.chunk.shape[0])


@kernel(inline=True)
def _grow_greedily(
    root: int, target: Pose, scene: Scene, rules: Rules, tree: Tree
) -> tuple[int, int]:
    """Haste before the first path: nodes a step apart along the edge to a pose as far as it is free; returns as `_extend`."""
    m = nearest_node(root, target, scene.body, tree)
    here = pose_of(m, tree.node)
    edge = steer(here, target, scene.body)
    length = length_of(edge)
    if length < SAME:
        return REACHED, m
    free = surely_free(here, target, scene.body, scene)
    status, gone = TRAPPED, 0.0
    while gone < length and _has_room(tree):
        to = gone + rules.step
        if to >= length - SAME - rules.snap:
            to = length
        first = piece(edge, gone, to)
        there = (
            end_of_first(here, target, first, length - gone, scene.body) if to < length else target
        )
        cost = (
            length_of(first)
            if to < free
            else np.inf
            if free > 0.0
            else price(here, there, first, scene.body, scene)
        )
        if cost == np.inf:
            break
        new = insert(root, there, tree)
        adopt(m, new, first, cost, tree.node, tree.link)
        m, here, gone, status = new, there, to, ADVANCED if to < length else REACHED
    return status, m if status != TRAPPED else -1


@kernel(inline=True, forced=True)
def _cheapest_parent(
    parent: int, pose: Pose, edge: Curve, cost: float, count: int, scene: Scene, tree: Tree
) -> tuple[int, Curve, float]:  # fmt: skip
    """Algorithm 4: of a node and those near the one by which a pose costs least, the edge from there, and what it costs."""
    node, near = tree.node, tree.near
    best = node[parent, COST] + cost
    for k in range(count):
        near[k].least = (
            node[near[k].id, COST] + near[k].gap
        )  # no edge is shorter than the straight line
    while True:
        candidate, cheapest = -1, best - GAIN
        for k in range(count):
            if near[k].least < cheapest:
                candidate, cheapest = k, near[k].least
        if candidate < 0:
            return parent, edge, cost
        near[candidate].least = np.inf
        m = near[candidate].id
        start = pose_of(m, node)
        other = steer(start, pose, scene.body)
        if node[m, COST] + length_of(other) < best - GAIN:
            paid = price(start, pose, other, scene.body, scene)
            if node[m, COST] + paid < best - GAIN:
                best, parent, edge, cost = node[m, COST] + paid, m, other, paid


@kernel(inline=True, forced=True)
def _visible_ancestor(
    parent: int, pose: Pose, edge: Curve, cost: float, scene: Scene, tree: Tree
) -> tuple[int, Curve, float]:  # fmt: skip
    """The farthest of the parent's ancestors, one after the other, that still sees a pose: as Quick-RRT* (Jeong et al. 2019)."""
    node, link = tree.node, tree.link
    above = int(np.int64(link[parent, PARENT]))
    while above >= 0:
        start = pose_of(above, node)
        other = steer(start, pose, scene.body)
        paid = price(start, pose, other, scene.body, scene)
        if paid == np.inf:
            break
        parent, edge, cost = above, other, paid
        above = int(np.int64(link[parent, PARENT]))
    return parent, edge, cost


@kernel(inline=True, forced=True)
def _rewire(new: int, count: int, skip: bool, scene: Scene, tree: Tree) -> None:
    """Algorithm 5: hang near nodes under a new one where they then cost less."""
    node, link, near = tree.node, tree.link, tree.near
    pose, total = pose_of(new, node), node[new, COST]
    for k in range(count):
        m = near[k].id
        if m == link[new, PARENT] or total + near[k].gap >= node[m, COST] - GAIN:
            continue
        there = pose_of(m, node)
        edge = steer(pose, there, scene.body)
        if total + length_of(edge) >= node[m, COST] - GAIN:
            continue
        cost = price(pose, there, edge, scene.body, scene)
        if total + cost >= node[m, COST] - GAIN:
            continue
        above = new
        if skip:
            above, edge, cost = _visible_ancestor(new, there, edge, cost, scene, tree)
        release(m, link)
        adopt(above, m, edge, cost, node, link)
        propagate(m, node, link, tree.state)


@kernel(inline=True)
def _extend(
    root: int, target: Pose, nearest: int, scene: Scene, rules: Rules, tree: Tree
) -> tuple[int, int]:
    """Algorithm 2: one step of a tree towards a pose; returns what came of it, and the node.

    `nearest` is the tree's node nearest to the pose where that is known, else -1.
    """
    state, far = tree.state[0], rules.goal if root == 0 else rules.start
    curved = tree.node.shape[1] > LINE
    density = float(max(state.nodes[root], 2))
    density = np.sqrt(
        np.log(density) / density
    )  # eq 10 with exponent 1/d: d = 2, or 4 of poses (Karaman & Frazzoli 2013)
    reach = min(rules.gamma * (np.sqrt(density) if curved else density), rules.zeta)
    count, m = 0, nearest
    if (
        m < 0 and reach <= rules.step and not curved
    ):  # nearly always the nearest node is near: one search for both
        count, k = near_nodes(root, target, reach, tree), 0
        for other in range(1, count):
            k = other if tree.near[other].gap < tree.near[k].gap else k
        m = tree.near[k].id if count > 0 else -1
    if m < 0:
        m = nearest_node(root, target, scene.body, tree)
    here = pose_of(m, tree.node)
    edge = steer(here, target, scene.body)
    length, status, pose = length_of(edge), REACHED, target
    if length < SAME:
        return REACHED, m
    if length > rules.step:
        status, edge = ADVANCED, piece(edge, 0.0, rules.step)
        pose = end_of_first(here, target, edge, length, scene.body)
    if detour(rules.start, rules.goal, pose) >= state.bound:
        return TRAPPED, -1
    cost = price(here, pose, edge, scene.body, scene)
    if cost == np.inf:
        return TRAPPED, -1
    if count == 0:
        count = near_nodes(root, pose, reach, tree)
    parent, edge, cost = _cheapest_parent(m, pose, edge, cost, count, scene, tree)
    skip = rules.skip and state.best < np.inf
    if skip:
        parent, edge, cost = _visible_ancestor(parent, pose, edge, cost, scene, tree)
    if tree.node[parent, COST] + cost + apart(pose, far) >= state.bound:
        return TRAPPED, -1
    new = insert(root, pose, tree)
    adopt(parent, new, edge, cost, tree.node, tree.link)
    _rewire(new, count, skip, scene, tree)
    return status, new


@kernel(inline=True)
def _connect(root: int, target: Pose, scene: Scene, rules: Rules, tree: Tree) -> tuple[int, int]:
    """Algorithm 3: extend a tree towards a pose, a new node of the other one, until it is there or trapped."""
    status, m = ADVANCED, NONE
    while status == ADVANCED and _has_room(tree):  # what was added last is nearest
        status, m = _extend(root, target, m, scene, rules, tree)
    return status, m


@kernel(inline=True, forced=True)
def _turned(pose: Pose, half_circles: int) -> Pose:
    """A pose, turned round so often."""
    return Pose(pose.x, pose.y, pose.yaw + half_circles * np.pi)


@kernel(inline=True)
def _plant(rules: Rules, tree: Tree) -> None:
    """Put the two roots into an empty pool."""
    tree.state[0].root = insert(0, rules.start, tree)
    other = insert(1, _turned(rules.goal, 1), tree)
    for m in (tree.state[0].root, other):
        tree.node[m, COST], tree.node[m, EDGE] = 0.0, 0.0


@kernel(inline=True)
def _grow(iterations: int, scene: Scene, rules: Rules, tree: Tree) -> None:
    """Algorithm 1 for at most `iterations`; returns early at the first path, and when the pool is full.

    The very first sample is the other tree's root: the direct edge first.
    """
    state = tree.state[0]
    if state.chunks == 0:
        _plant(rules, tree)
    for _ in range(iterations):
        if state.chunks + 8 >= tree.chunk.shape[0]:
            return
        root = state.active
        target = (
            (rules.goal if root == 0 else rules.start)
            if state.iteration == 0
            else next_sample(scene, rules, tree)
        )
        target = _turned(target, root)
        state.iteration += 1
        state.active = 1 - root
        known, status, m = state.best, TRAPPED, NONE
        greedy = rules.greedy and known == np.inf
        if greedy:
            _, new = _grow_greedily(root, target, scene, rules, tree)
        else:
            _, new = _extend(root, target, m, scene, rules, tree)
        if new < 0:
            continue
        target = _turned(pose_of(new, tree.node), 1)
        if greedy:
            status, m = _grow_greedily(1 - root, target, scene, rules, tree)
        else:
            status, m = _connect(1 - root, target, scene, rules, tree)
        if status == REACHED:
            tree.link[new, PARTNER], tree.link[m, PARTNER] = m, new
            settle(new, tree.node, tree.link, tree.state)
        if state.best < known:
            if rules.informed:
                state.bound = min(state.bound, state.best)
            if known == np.inf:
                return


@kernel(I, DISC_SCENE, RULES, TREE)
def grow_lines(iterations: int, scene: Scene, rules: Rules, tree: Tree) -> None:
    """Grow with straight lines, as in the paper."""
    _grow(iterations, scene, rules, tree)


@kernel(I, CAR_SCENE, RULES, TREE)
def grow_curves(iterations: int, scene: Scene, rules: Rules, tree: Tree) -> None:
    """Grow with a car's curves."""
    _grow(iterations, scene, rules, tree)
