# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Algorithms 1-5 of the paper's appendix in the vehicle's own space: two trees of poses, joined by Dubins curves.

Lengths are in cells. The tree of the goal grows backwards: its poses are kept turned by half a circle, so that a curve from a
node onwards is one that is driven towards the goal, and one code serves both trees. They share one pool: the first tree fills it
from the front, the second from the back. Rows of the arrays::

    node   (n, 10)  x, y, cost from the root, cost of the edge from the parent, yaw, the edge: word and lengths of its parts; a
                    spare column
    link   (n, 5)   as in `tree_nodes`
"""

import numpy as np

from scenario_gen.method.routing.search.dubins import onward, piece, shortest, TURNS
from scenario_gen.method.routing.search.sweep import follow, scratch_rows, swept_free
from scenario_gen.method.routing.search.tree_nodes import (  # fmt: skip
    ACTIVE,
    adopt,
    BEST,
    BOUND,
    COST,
    EDGE,
    GAMMA,
    GREEDY,
    INFORMED,
    ITERATION,
    Links,
    NODES_A,
    NODES_B,
    OUTLINK2,
    PARTNER,
    propagate,
    release,
    settle,
    STEP,
    X,
    Y,
    ZETA,
)
from scenario_gen.method.routing.search.tree_samples import Random, RandomState, uniform
from scenario_gen.numerics import Counts, Floats, Ints
from scenario_gen.numerics.kernels import F2, I, I1, kernel, N2, OUT1, OUT2, OUTI1

YAW, WORD, PART_A, PART_B, PART_C = 4, 5, 6, 7, 8
COLUMNS = 10
# further settings, beside those of `tree_nodes`: radius of the arcs, half length and half width of the footprint, distance
# between two poses that are checked, what is wished for (see `sweep.follow`), share of samples about a known path, their spread
# sideways [cells] and in heading [rad], cost of the path that was shortened last
TURN, HALF_LENGTH, HALF_WIDTH, SWEEP, WISH, ABOUT, SPREAD, YAW_SPREAD, LENGTH = 11, 12, 13, 14, 15, 21, 22, 23, 24
SETTINGS = 25
DIMENSIONS = 4.0  # d of eq 10, of a ball that small Dubins curves reach: along 1, heading 1, sideways 2 (Karaman & Frazzoli 2013)
TRAPPED, ADVANCED, REACHED = 0, 1, 2
NEAR = 256  # most nodes of a near set
GAIN = 1e-6  # [cells] what lowers a cost by less changes nothing
SAME = 1e-6  # [cells] poses nearer to each other are one
FINER = np.array([1.0, 0.5, 0.25, 0.125])  # shares of the spread: narrow gaps need samples that are near to the path
TRIES = 20  # to draw a sample that is free


@kernel(inline=True)
def _range(tree: int, node: Floats, counter: Ints) -> tuple[int, int]:
    """The ids of a tree's nodes: from, up to."""
    if tree == 0:
        return 0, counter[NODES_A]
    return node.shape[0] - counter[NODES_B], node.shape[0]


@kernel(inline=True)
def _insert(tree: int, x: float, y: float, yaw: float, node: Floats, link: Links, counter: Ints) -> int:
    """Put a bare node into the pool and return its id."""
    m = counter[NODES_A] if tree == 0 else node.shape[0] - 1 - counter[NODES_B]
    counter[tree] += 1
    node[m, X], node[m, Y], node[m, YAW] = x, y, yaw
    for which in range(5):
        link[m, which] = -1
    return int(m)


@kernel(inline=True)
def _full(node: Floats, counter: Ints) -> bool:
    """Whether there is no room for what one iteration may add."""
    return bool(counter[NODES_A] + counter[NODES_B] + 64 >= node.shape[0])


@kernel(inline=True)
def _hang(parent: int, m: int, cost: float, word: int, a: float, b: float, c: float, node: Floats, link: Links) -> None:
    """Hang node m under `parent`, by an edge that costs `cost`."""
    adopt(parent, m, cost, node, link)
    node[m, WORD], node[m, PART_A], node[m, PART_B], node[m, PART_C] = word, a, b, c


@kernel(inline=True)
def _nearest(
    tree: int, x: float, y: float, yaw: float, node: Floats, counter: Ints, radius: float
) -> tuple[int, int, float, float, float]:
    """The node from which the curve to a pose is shortest, and the curve; -1 where the pose is a node itself."""
    first, last = _range(tree, node, counter)
    best, nearest, word, a, b, c = np.inf, -1, 0, 0.0, 0.0, 0.0
    for m in range(first, last):
        dx, dy = node[m, X] - x, node[m, Y] - y
        if dx * dx + dy * dy < best * best:  # no curve is shorter than the straight line
            w, p, q, r = shortest(node[m, X], node[m, Y], node[m, YAW], x, y, yaw, radius)
            if p + q + r < best:
                best, nearest, word, a, b, c = p + q + r, m, w, p, q, r
    return nearest, word, a, b, c


@kernel(inline=True)
def _is_free(x: float, y: float, yaw: float, blocked: Counts, setting: Floats, low: Floats, high: Floats) -> bool:
    """Whether the footprint at a pose is free."""
    c, s = np.cos(yaw), np.sin(yaw)
    return bool(swept_free(blocked, x, y, c, s, x, y, c, s, setting[HALF_LENGTH], setting[HALF_WIDTH], 0.0, low, high))


@kernel(inline=True)
def _bell(random: Random) -> float:
    """A number of mean 0 and variance 1: the sum of four uniform ones."""
    return float((uniform(random) + uniform(random) + uniform(random) + uniform(random) - 2.0) * 1.7320508075688772)


@kernel(inline=True)
def _sample(
    ends: Floats, free_cells: Ints, about: Floats, clearance: Floats, blocked: Counts, setting: Floats, random: Random,
    low: Floats, high: Floats,
) -> tuple[float, float, float]:  # fmt: skip
    """A free pose: about a known path, or anywhere that a better path can lie."""
    x, y, yaw = ends[1, 0], ends[1, 1], ends[1, 2]
    width, bound = clearance.shape[1], setting[BOUND]
    for _ in range(TRIES):
        if about.shape[0] > 0 and uniform(random) < setting[ABOUT]:
            k = int(uniform(random) * about.shape[0])
            scale = FINER[int(uniform(random) * FINER.size)]
            aside, ahead = scale * setting[SPREAD] * _bell(random), setting[SPREAD] * _bell(random)
            c, s = np.cos(about[k, 2]), np.sin(about[k, 2])
            x, y = about[k, 0] + c * ahead - s * aside, about[k, 1] + s * ahead + c * aside
            yaw = about[k, 2] + scale * setting[YAW_SPREAD] * _bell(random)
        else:
            cell = free_cells[int(uniform(random) * free_cells.size)]
            x, y = cell % width + uniform(random), cell // width + uniform(random)
            yaw = 2.0 * np.pi * uniform(random)
        from_start = np.sqrt((x - ends[0, 0]) ** 2 + (y - ends[0, 1]) ** 2)
        to_goal = np.sqrt((x - ends[1, 0]) ** 2 + (y - ends[1, 1]) ** 2)
        if from_start + to_goal < bound and _is_free(x, y, yaw, blocked, setting, low, high):
            break
    return x, y, yaw


@kernel(inline=True)
def _edge(
    m: int, word: int, a: float, b: float, c: float, node: Floats, clearance: Floats, blocked: Counts, setting: Floats,
    guide: Floats, low: Floats, high: Floats,
) -> tuple[float, float]:  # fmt: skip
    """`sweep.follow` from node m on."""
    return follow(
        clearance, blocked, node[m, X], node[m, Y], node[m, YAW], word, a, b, c, setting[TURN], setting[HALF_LENGTH],
        setting[HALF_WIDTH], setting[SWEEP], setting[WISH : WISH + 6], guide, low, high,
    )  # fmt: skip


@kernel(inline=True)
def _grow_greedily(
    tree: int, x: float, y: float, yaw: float, node: Floats, link: Links, counter: Ints, setting: Floats, clearance: Floats,
    blocked: Counts, guide: Floats, low: Floats, high: Floats,
) -> tuple[int, int]:  # fmt: skip
    """Haste before the first path: nodes a step apart along the curve to a pose as far as it is free; returns as `_extend`."""
    m, word, a, b, c = _nearest(tree, x, y, yaw, node, counter, setting[TURN])
    length = a + b + c
    if length < SAME:
        return REACHED, m
    status, gone = TRAPPED, 0.0
    while gone < length - SAME and not _full(node, counter):
        to = gone + setting[STEP]
        if to > length - 0.5 * setting[STEP]:
            to = length
        p, q, r = piece(a, b, c, gone, to)
        free, cost = _edge(m, word, p, q, r, node, clearance, blocked, setting, guide, low, high)
        if free < np.inf:
            return status, m if status != TRAPPED else -1
        nx, ny, nyaw = onward(node[m, X], node[m, Y], node[m, YAW], TURNS[word, 0], p, setting[TURN])
        nx, ny, nyaw = onward(nx, ny, nyaw, TURNS[word, 1], q, setting[TURN])
        nx, ny, nyaw = onward(nx, ny, nyaw, TURNS[word, 2], r, setting[TURN])
        if to == length:
            nx, ny, nyaw = x, y, yaw
        new = _insert(tree, nx, ny, nyaw, node, link, counter)
        _hang(m, new, cost, word, p, q, r, node, link)
        m, gone, status = new, to, ADVANCED
    return (REACHED if gone >= length - SAME else status), m


@kernel(inline=True)
def _cheapest_parent(
    tree: int, parent: int, x: float, y: float, yaw: float, word: int, a: float, b: float, c: float, edge: float, count: int,
    near: Ints, node: Floats, clearance: Floats, blocked: Counts, setting: Floats, guide: Floats, low: Floats, high: Floats,
) -> tuple[int, int, float, float, float, float]:  # fmt: skip
    """Algorithm 4: the near node by which a pose costs least, the curve from there, and what it costs."""
    best = node[parent, COST] + edge
    for k in range(count):
        m = near[k]
        if m == parent:
            continue
        dx, dy = x - node[m, X], y - node[m, Y]
        if node[m, COST] + np.sqrt(dx * dx + dy * dy) >= best - GAIN:
            continue
        w, p, q, r = shortest(node[m, X], node[m, Y], node[m, YAW], x, y, yaw, setting[TURN])
        if node[m, COST] + p + q + r >= best - GAIN:
            continue
        free, cost = _edge(m, w, p, q, r, node, clearance, blocked, setting, guide, low, high)
        if free == np.inf and node[m, COST] + cost < best - GAIN:
            best, parent, word, a, b, c, edge = node[m, COST] + cost, m, w, p, q, r, cost
    return parent, word, a, b, c, edge


@kernel(inline=True)
def _extend(
    tree: int, x: float, y: float, yaw: float, ends: Floats, node: Floats, link: Links, counter: Ints, setting: Floats,
    clearance: Floats, blocked: Counts, guide: Floats, near: Ints, low: Floats, high: Floats,
) -> tuple[int, int]:  # fmt: skip
    """Algorithm 2: one step of a tree towards a pose; returns what came of it, and the node."""
    radius = setting[TURN]
    m, word, a, b, c = _nearest(tree, x, y, yaw, node, counter, radius)
    length = a + b + c
    if length < SAME:
        return REACHED, m
    status = REACHED
    if length > setting[STEP]:
        status = ADVANCED
        a, b, c = piece(a, b, c, 0.0, setting[STEP])
        x, y, yaw = onward(node[m, X], node[m, Y], node[m, YAW], TURNS[word, 0], a, radius)
        x, y, yaw = onward(x, y, yaw, TURNS[word, 1], b, radius)
        x, y, yaw = onward(x, y, yaw, TURNS[word, 2], c, radius)
    free, edge = _edge(m, word, a, b, c, node, clearance, blocked, setting, guide, low, high)
    if free < np.inf:
        return TRAPPED, -1
    first, last = _range(tree, node, counter)
    n = float(max(last - first, 2))
    reach = min(setting[GAMMA] * np.sqrt(np.sqrt(np.log(n) / n)), setting[ZETA])  # eq 10, d = 4
    count = 0
    for k in range(first, last):
        dx, dy = node[k, X] - x, node[k, Y] - y
        if dx * dx + dy * dy <= reach * reach and count < NEAR:
            near[count] = k
            count += 1
    parent, word, a, b, c, edge = _cheapest_parent(
        tree, m, x, y, yaw, word, a, b, c, edge, count, near, node, clearance, blocked, setting, guide, low, high
    )  # fmt: skip
    cost = node[parent, COST] + edge
    rest = np.sqrt((x - ends[1 - tree, 0]) ** 2 + (y - ends[1 - tree, 1]) ** 2)
    if cost + rest >= setting[BOUND]:  # infinite unless informed
        return TRAPPED, -1
    new = _insert(tree, x, y, yaw, node, link, counter)
    _hang(parent, new, edge, word, a, b, c, node, link)
    for k in range(count):  # Algorithm 5
        m = near[k]
        dx, dy = node[m, X] - x, node[m, Y] - y
        if m == parent or cost + np.sqrt(dx * dx + dy * dy) >= node[m, COST] - GAIN:
            continue
        w, p, q, r = shortest(x, y, yaw, node[m, X], node[m, Y], node[m, YAW], radius)
        if cost + p + q + r >= node[m, COST] - GAIN:
            continue
        free, price = _edge(new, w, p, q, r, node, clearance, blocked, setting, guide, low, high)
        if free == np.inf and cost + price < node[m, COST] - GAIN:
            release(m, link)
            _hang(new, m, price, w, p, q, r, node, link)
            propagate(m, node, link, counter, setting)
    return status, new


@kernel(inline=True)
def _connect(
    tree: int, x: float, y: float, yaw: float, ends: Floats, node: Floats, link: Links, counter: Ints, setting: Floats,
    clearance: Floats, blocked: Counts, guide: Floats, near: Ints, low: Floats, high: Floats,
) -> tuple[int, int]:  # fmt: skip
    """Algorithm 3: extend a tree towards a pose, a new node of the other one, until it is there or trapped."""
    status, m = ADVANCED, -1
    while status == ADVANCED and not _full(node, counter):
        status, m = _extend(
            tree, x, y, yaw, ends, node, link, counter, setting, clearance, blocked, guide, near, low, high
        )  # fmt: skip
    return status, m


@kernel(F2, OUT2, OUTLINK2, OUTI1)
def plant(ends: Floats, node: Floats, link: Links, counter: Ints) -> None:
    """Put the two roots, start and goal `ends` (2, 3) [cells, rad], into an empty pool (counters zero)."""
    for tree in range(2):
        root = _insert(tree, ends[tree, 0], ends[tree, 1], ends[tree, 2] + tree * np.pi, node, link, counter)
        node[root, COST], node[root, EDGE] = 0.0, 0.0


@kernel(I, F2, N2, F2, I1, F2, F2, OUT2, OUTLINK2, OUTI1, OUT1, RandomState)
def grow(  # noqa: PLR0912
    iterations: int, clearance: Floats, blocked: Counts, ends: Floats, free_cells: Ints, about: Floats, guide: Floats,
    node: Floats, link: Links, counter: Ints, setting: Floats, random: Random,
) -> None:  # fmt: skip
    """Algorithm 1 for at most `iterations`; returns early at the first path, and when the pool is full.

    Args:
        iterations: how many samples to draw; the very first is the other tree's root: the direct curve.
        clearance: (H, W) cells.
        blocked: (H, W + 1) from `blocked_before`.
        ends: (2, 3) start and goal.
        free_cells: flat indices of the cells to sample from.
        about: (G, 3) poses of a path to sample about; none: everywhere.
        guide: (G, 3) poses of the line to keep to, see `sweep.follow`.
        node: the trees; this and what follows is changed in place.
        link: as above.
        counter: as in `tree_nodes`.
        setting: as above, and those of this module.
        random: (1,) state of the generator.
    """
    rows = scratch_rows(setting[HALF_LENGTH], setting[HALF_WIDTH], setting[SWEEP])
    low, high = np.empty(rows), np.empty(rows)
    near = np.empty(NEAR, dtype=np.int64)
    for _ in range(iterations):
        if _full(node, counter):
            return
        tree = counter[ACTIVE]
        if counter[ITERATION] == 0:
            x, y, yaw = ends[1 - tree, 0], ends[1 - tree, 1], ends[1 - tree, 2]
        else:
            x, y, yaw = _sample(ends, free_cells, about, clearance, blocked, setting, random, low, high)
        counter[ITERATION] += 1
        counter[ACTIVE] = 1 - tree
        yaw += tree * np.pi
        known, m = setting[BEST], -1
        if setting[GREEDY] > 0.0 and known == np.inf:
            status, new = _grow_greedily(
                tree, x, y, yaw, node, link, counter, setting, clearance, blocked, guide, low, high
            )  # fmt: skip
            if new >= 0:
                status, m = _grow_greedily(
                    1 - tree, node[new, X], node[new, Y], node[new, YAW] + np.pi, node, link, counter, setting, clearance,
                    blocked, guide, low, high,
                )  # fmt: skip
        else:
            status, new = _extend(
                tree, x, y, yaw, ends, node, link, counter, setting, clearance, blocked, guide, near, low, high
            )  # fmt: skip
            if new >= 0:
                status, m = _connect(
                    1 - tree, node[new, X], node[new, Y], node[new, YAW] + np.pi, ends, node, link, counter, setting, clearance,
                    blocked, guide, near, low, high,
                )  # fmt: skip
        if new < 0:
            continue
        if status == REACHED:
            link[new, PARTNER], link[m, PARTNER] = m, new
            settle(new, node, link, counter, setting)
        if setting[BEST] < known:
            if setting[INFORMED] > 0.0:
                setting[BOUND] = min(setting[BOUND], setting[BEST])
            if known == np.inf:
                return
