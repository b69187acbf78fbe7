# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Algorithms 1-5 of the paper's appendix as kernels: two rapidly-exploring trees that rewire, meet, and go on.

See `tree_nodes` for the trees' memory and `tree_samples` for what they grow to.
"""

import numpy as np

from scenario_gen.method.routing.search.tree_nodes import (  # fmt: skip
    ACTIVE,
    adopt,
    BEST,
    BOUND,
    CHUNKS,
    COST,
    GAMMA,
    GREEDY,
    HISTORY,
    INFORMED,
    insert,
    ITERATION,
    Links,
    NEAR,
    near_nodes,
    nearest_node,
    OUTLINK2,
    PARENT,
    PARTNER,
    propagate,
    RADIUS,
    release,
    settle,
    SIDE,
    SKIP,
    STEP,
    X,
    Y,
    ZETA,
)
from scenario_gen.method.routing.search.tree_samples import detour, next_sample, Random, RandomState
from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.kernels import F2, I, I1, kernel, OUT1, OUT2, OUTI1, OUTI2
from scenario_gen.roads import free_length, segment_free

TRAPPED, ADVANCED, REACHED = 0, 1, 2


@kernel(inline=True)
def _visible_ancestor(parent: int, x: float, y: float, clearance: Floats, node: Floats, link: Links, radius: float) -> int:
    """The farthest of the parent's ancestors, one after the other, that still sees (x, y): as Quick-RRT* (Jeong et al. 2019)."""
    above = link[parent, PARENT]
    while above >= 0 and segment_free(clearance, node[above, X], node[above, Y], x, y, radius):
        parent, above = above, link[above, PARENT]
    return parent


@kernel(inline=True)
def _grow_greedily(
    tree: int, qx: float, qy: float, clearance: Floats, node: Floats, link: Links, chunk: Ints, head: Ints, counter: Ints,
    setting: Floats, columns: int,
) -> tuple[int, int]:  # fmt: skip
    """Haste before the first path: nodes a step apart towards (qx, qy) as far as the way is free; returns as `_extend`."""
    side, step = setting[SIDE], setting[STEP]
    m = nearest_node(tree, qx, qy, node, chunk, head, side, columns)
    ax, ay = node[m, X], node[m, Y]
    distance = np.sqrt((qx - ax) * (qx - ax) + (qy - ay) * (qy - ay))
    if distance < 1e-9:
        return REACHED, m
    ux, uy = (qx - ax) / distance, (qy - ay) / distance
    free = free_length(clearance, ax, ay, qx, qy, setting[RADIUS])  # rounding moves its nodes by less than its contact margin
    status, gone = TRAPPED, 0.0
    while gone + step < min(free, distance - 1e-9) and counter[CHUNKS] + 1 < chunk.shape[0]:
        gone += step
        new = insert(tree, ax + gone * ux, ay + gone * uy, node, link, chunk, head, counter, side, columns)
        adopt(m, new, step, node, link)
        status, m = ADVANCED, new
    if free == np.inf and gone + step >= distance - 1e-9 and counter[CHUNKS] + 1 < chunk.shape[0]:
        new = insert(tree, qx, qy, node, link, chunk, head, counter, side, columns)
        adopt(m, new, distance - gone, node, link)
        status, m = REACHED, new
    return status, m if status != TRAPPED else -1


@kernel(inline=True)
def _cheapest_parent(
    parent: int,
    x: float,
    y: float,
    edge: float,
    count: int,
    clearance: Floats,
    node: Floats,
    radius: float,
    near: Ints,
    gap: Floats,
) -> tuple[int, float]:
    """Algorithm 4: the near node by which (x, y) costs least, and the edge's length; those without a free edge become -1."""
    while True:
        candidate, cheapest = -1, node[parent, COST] + edge
        for k in range(count):
            if near[k] >= 0 and node[near[k], COST] + gap[k] < cheapest:
                candidate, cheapest = k, node[near[k], COST] + gap[k]
        if candidate < 0:
            return parent, edge
        m = near[candidate]
        if segment_free(clearance, node[m, X], node[m, Y], x, y, radius):
            return m, gap[candidate]
        near[candidate] = -1  # not for rewiring either


@kernel(inline=True)
def _extend(  # noqa: PLR0912
    tree: int, qx: float, qy: float, ends: Floats, clearance: Floats, node: Floats, link: Links, chunk: Ints, head: Ints,
    counter: Ints, setting: Floats, columns: int, nearest: int, near: Ints, gap: Floats,
) -> tuple[int, int]:  # fmt: skip
    """Algorithm 2: one step of a tree towards (qx, qy); returns what came of it, and the node.

    `nearest` is the tree's node nearest to (qx, qy) where that is known, else -1.
    """
    side, radius, step, bound = setting[SIDE], setting[RADIUS], setting[STEP], setting[BOUND]
    n = float(max(counter[tree], 2))
    reach = min(setting[GAMMA] * np.sqrt(np.log(n) / n), setting[ZETA])  # eq 10 with exponent 1/d, d = 2
    count = 0
    if nearest < 0 and reach <= step:  # nearly always the nearest node is near: one search for both
        count = near_nodes(tree, qx, qy, reach, node, chunk, head, side, columns, near, gap)
        for k in range(count):
            if nearest < 0 or gap[k] < gap[nearest]:
                nearest = k
        nearest = near[nearest] if nearest >= 0 else -1
    searched = count > 0
    if nearest < 0:
        nearest = nearest_node(tree, qx, qy, node, chunk, head, side, columns)
    nx, ny = node[nearest, X], node[nearest, Y]
    distance = np.sqrt((qx - nx) * (qx - nx) + (qy - ny) * (qy - ny))
    if distance < 1e-9:
        return REACHED, nearest
    status, x, y, edge = REACHED, qx, qy, distance
    if distance > step:
        status, edge = ADVANCED, step
        x, y = nx + (qx - nx) * edge / distance, ny + (qy - ny) * edge / distance
    if detour(ends, x, y) >= bound or not segment_free(clearance, nx, ny, x, y, radius):
        return TRAPPED, -1
    if not searched:
        count = near_nodes(tree, x, y, reach, node, chunk, head, side, columns, near, gap)
    parent, edge = _cheapest_parent(nearest, x, y, edge, count, clearance, node, radius, near, gap)
    cost = node[parent, COST] + edge
    skip = setting[SKIP] > 0.0 and setting[BEST] < np.inf
    if skip:
        parent = _visible_ancestor(parent, x, y, clearance, node, link, radius)
        edge = np.sqrt((x - node[parent, X]) ** 2 + (y - node[parent, Y]) ** 2)
        cost = node[parent, COST] + edge
    if cost + np.sqrt((x - ends[1 - tree, 0]) ** 2 + (y - ends[1 - tree, 1]) ** 2) >= bound:  # infinite unless informed
        return TRAPPED, -1
    new = insert(tree, x, y, node, link, chunk, head, counter, side, columns)
    adopt(parent, new, edge, node, link)
    for k in range(count):  # Algorithm 5
        m = near[k]
        if m < 0 or m == parent or cost + gap[k] >= node[m, COST] - 1e-9:
            continue
        if segment_free(clearance, node[m, X], node[m, Y], x, y, radius):
            above, length = new, gap[k]
            if skip:
                above = _visible_ancestor(new, node[m, X], node[m, Y], clearance, node, link, radius)
                length = np.sqrt((node[m, X] - node[above, X]) ** 2 + (node[m, Y] - node[above, Y]) ** 2)
            release(m, link)
            adopt(above, m, length, node, link)
            propagate(m, node, link, counter, setting)
    return status, new


@kernel(inline=True)
def _connect(
    tree: int, x: float, y: float, ends: Floats, clearance: Floats, node: Floats, link: Links, chunk: Ints, head: Ints,
    counter: Ints, setting: Floats, columns: int, near: Ints, gap: Floats,
) -> tuple[int, int]:  # fmt: skip
    """Algorithm 3: extend a tree towards (x, y), a new node of the other one, until it is there or trapped."""
    status, m = ADVANCED, -1
    while status == ADVANCED and counter[CHUNKS] + 1 < chunk.shape[0]:  # what was added last is nearest
        status, m = _extend(tree, x, y, ends, clearance, node, link, chunk, head, counter, setting, columns, m, near, gap)
    return status, m


@kernel(I, F2, F2, I1, I1, OUT2, OUT2, OUTLINK2, OUTI2, OUTI2, OUTI1, OUT1, OUT2, RandomState)
def grow(  # noqa: PLR0912
    iterations: int, clearance: Floats, ends: Floats, free_cells: Ints, corner_cells: Ints, drawn: Floats,
    node: Floats, link: Links, chunk: Ints, head: Ints,
    counter: Ints, setting: Floats, history: Floats, random: Random,
) -> None:  # fmt: skip
    """Algorithm 1 for at most `iterations`; returns early at the first path, and when the pool or the history is full.

    Args:
        iterations: how many samples to draw.
        clearance: (H, W) cells.
        ends: (2, 2) start and goal, the trees' roots.
        free_cells: flat indices of the cells to sample from.
        corner_cells: those of them that lie before convex corners of obstacles.
        drawn: see `next_sample`; this and what follows is changed in place.
        node: see `tree_nodes`.
        link: as above.
        chunk: as above.
        head: as above.
        counter: as above.
        setting: as above.
        history: (h, 2) iteration and cost of each improvement, written from counter[HISTORY] on.
        random: (1,) state of the generator.
    """
    columns = int(np.ceil(clearance.shape[1] / setting[SIDE]))
    near, gap = np.empty(NEAR, dtype=np.int64), np.empty(NEAR)
    for _ in range(iterations):
        if counter[CHUNKS] + 8 >= chunk.shape[0] or counter[HISTORY] + 1 >= history.shape[0]:
            return
        tree = counter[ACTIVE]
        if counter[ITERATION] == 0:
            x, y = ends[1 - tree, 0], ends[1 - tree, 1]  # the straight way first
        else:
            x, y = next_sample(
                ends, free_cells, corner_cells, clearance, drawn, head.shape[1], columns, counter, setting, random
            )  # fmt: skip
        counter[ITERATION] += 1
        counter[ACTIVE] = 1 - tree
        known, m = setting[BEST], -1
        if setting[GREEDY] > 0.0 and known == np.inf:
            status, new = _grow_greedily(tree, x, y, clearance, node, link, chunk, head, counter, setting, columns)
            if new >= 0:
                x, y = node[new, X], node[new, Y]
                status, m = _grow_greedily(1 - tree, x, y, clearance, node, link, chunk, head, counter, setting, columns)
        else:
            status, new = _extend(
                tree, x, y, ends, clearance, node, link, chunk, head, counter, setting, columns, -1, near, gap
            )  # fmt: skip
            if new >= 0:
                x, y = node[new, X], node[new, Y]
                status, m = _connect(
                    1 - tree, x, y, ends, clearance, node, link, chunk, head, counter, setting, columns, near, gap
                )  # fmt: skip
        if new < 0:
            continue
        if status == REACHED:
            link[new, PARTNER], link[m, PARTNER] = m, new
            settle(new, node, link, counter, setting)
        if setting[BEST] < known:
            if setting[INFORMED] > 0.0:
                setting[BOUND] = min(setting[BOUND], setting[BEST])
            history[counter[HISTORY], 0], history[counter[HISTORY], 1] = counter[ITERATION], setting[BEST]
            counter[HISTORY] += 1
            if known == np.inf:
                return
