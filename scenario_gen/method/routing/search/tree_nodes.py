# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The trees' memory: nodes in buckets, looked up by place, hung under parents, moved when buckets are halved.

Lengths are in cells. Both trees share one pool of nodes. A node lives in a *chunk* of 32 that belongs to one tree and one
square bucket, so that looking for neighbours reads memory in order; the bucket's side is halved as the trees grow.

    node   (n, 4)  x, y, cost from the root, length of the edge to the parent
    link   (n, 5)  parent, first child, next sibling, previous sibling, the node at the same place in the other tree; -1: none
    chunk  (m, 2)  next chunk of the bucket or -1, nodes in it
    head   (2, b)  first chunk of every bucket of every tree, or -1
"""

from numba import types
import numpy as np
from numpy.typing import NDArray

from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.kernels import F2, I, I2, kernel, OUT1, OUT2, OUTI1, OUTI2

CHUNK = 32
NEAR = 2048  # scratch for a near set; what exceeds it is left out
X, Y, COST, EDGE = 0, 1, 2, 3
PARENT, CHILD, NEXT, PREVIOUS, PARTNER = 0, 1, 2, 3, 4
# `counter`, whole numbers that change: nodes per tree, chunks, the tree to extend next, iterations, history, connection node,
# samples drawn ahead and how many of them are used
NODES_A, NODES_B, CHUNKS, ACTIVE, ITERATION, HISTORY, CONNECTION, DRAWN, USED = 0, 1, 2, 3, 4, 5, 6, 7, 8
COUNTERS = 9
# `setting`, what steers the search: disc radius, step, gamma and zeta of eq 10, bucket side, length of the best path known
# from elsewhere (it bounds the informed set), length of the trees' own best path, 1 to extend greedily before the
# first path, 1 to let edges skip visible ancestors, share of samples beside obstacles' corners, 1 to leave out what cannot
# better the path known
RADIUS, STEP, GAMMA, ZETA, SIDE, BOUND, BEST, GREEDY, SKIP, CORNERS, INFORMED = 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10

Links = NDArray[np.int32]
LINK2 = types.Array(types.int32, 2, "C", readonly=True)
OUTLINK2 = types.Array(types.int32, 2, "C", readonly=False)


@kernel(inline=True)
def nearest_node(tree: int, x: float, y: float, node: Floats, chunk: Ints, head: Ints, side: float, columns: int) -> int:
    """The tree's node nearest to (x, y): rings of buckets outward, until no nearer one is possible.

    In cells, arrays as in the module's docstring.
    """
    rows = head.shape[1] // columns
    row, column = int(y / side), int(x / side)
    border = min(x - column * side, (column + 1) * side - x, y - row * side, (row + 1) * side - y)
    best, nearest = np.inf, -1
    ring = 0
    while True:
        for i in range(max(row - ring, 0), min(row + ring, rows - 1) + 1):
            stride = 1 if abs(i - row) == ring else max(2 * ring, 1)
            for j in range(column - ring, column + ring + 1, stride):
                if j < 0 or j >= columns:
                    continue
                k = head[tree, i * columns + j]
                while k >= 0:
                    for m in range(k * CHUNK, k * CHUNK + chunk[k, 1]):
                        dx, dy = node[m, X] - x, node[m, Y] - y
                        square = dx * dx + dy * dy
                        if square < best:
                            best, nearest = square, m
                    k = chunk[k, 0]
        reach = max(ring * side + border, 0.0)
        if best <= reach * reach or ring > rows + columns:
            return nearest
        ring += 1


@kernel(inline=True)
def near_nodes(
    tree: int, x: float, y: float, reach: float, node: Floats, chunk: Ints, head: Ints, side: float, columns: int,
    near: Ints, gap: Floats,
) -> int:  # fmt: skip
    """All nodes of the tree within `reach` of (x, y): ids into `near`, distances [cells] into `gap`, both (NEAR,).

    Source: the near set of Algorithm 2, its radius by eq 10.

    Returns how many.
    """
    rows = head.shape[1] // columns
    count = 0
    for i in range(max(int((y - reach) / side), 0), min(int((y + reach) / side), rows - 1) + 1):
        for j in range(max(int((x - reach) / side), 0), min(int((x + reach) / side), columns - 1) + 1):
            k = head[tree, i * columns + j]
            while k >= 0:
                for m in range(k * CHUNK, k * CHUNK + chunk[k, 1]):
                    dx, dy = node[m, X] - x, node[m, Y] - y
                    square = dx * dx + dy * dy
                    if square <= reach * reach and count < NEAR:
                        near[count], gap[count] = m, np.sqrt(square)
                        count += 1
                k = chunk[k, 0]
    return count


@kernel(inline=True)
def insert(
    tree: int, x: float, y: float, node: Floats, link: Links, chunk: Ints, head: Ints, counter: Ints, side: float, columns: int
) -> int:
    """Put a bare node into its bucket and return its id; in cells, arrays as in the module's docstring."""
    bucket = int(y / side) * columns + int(x / side)
    k = head[tree, bucket]
    if k < 0 or chunk[k, 1] == CHUNK:
        k = counter[CHUNKS]
        counter[CHUNKS] += 1
        chunk[k, 0], chunk[k, 1] = head[tree, bucket], 0
        head[tree, bucket] = k
    m = int(k * CHUNK + chunk[k, 1])
    chunk[k, 1] += 1
    counter[tree] += 1
    node[m, X], node[m, Y] = x, y
    for which in range(5):
        link[m, which] = -1
    return m


@kernel(inline=True)
def adopt(parent: int, m: int, edge: float, node: Floats, link: Links) -> None:
    """Hang node m under `parent`, `edge` cells away; arrays as in the module's docstring."""
    link[m, PARENT], link[m, NEXT], link[m, PREVIOUS] = parent, link[parent, CHILD], -1
    if link[parent, CHILD] >= 0:
        link[link[parent, CHILD], PREVIOUS] = m
    link[parent, CHILD] = m
    node[m, EDGE] = edge
    node[m, COST] = node[parent, COST] + edge


@kernel(inline=True)
def release(m: int, link: Links) -> None:
    """Take node m from its parent."""
    before, after = link[m, PREVIOUS], link[m, NEXT]
    if before >= 0:
        link[before, NEXT] = after
    else:
        link[link[m, PARENT], CHILD] = after
    if after >= 0:
        link[after, PREVIOUS] = before


@kernel(inline=True)
def settle(m: int, node: Floats, link: Links, counter: Ints, setting: Floats) -> None:
    """If node m is where the trees meet, see if the path through it is the best so far.

    Source: Algorithm 1, line 7.

    In cells, arrays as in the module's docstring.
    """
    partner = link[m, PARTNER]
    if partner >= 0 and node[m, COST] + node[partner, COST] < setting[BEST]:
        setting[BEST] = node[m, COST] + node[partner, COST]
        counter[CONNECTION] = m


@kernel(inline=True)
def propagate(top: int, node: Floats, link: Links, counter: Ints, setting: Floats) -> None:
    """Pass a lower cost on to all below node `top`: a walk through the subtree that needs no stack.

    Source: Algorithm 5, whose lower cost holds for the whole subtree.

    In cells, arrays as in the module's docstring.
    """
    m = top
    settle(m, node, link, counter, setting)
    while True:
        if link[m, CHILD] >= 0:
            m = link[m, CHILD]
        else:
            while m != top and link[m, NEXT] < 0:
                m = link[m, PARENT]
            if m == top:
                return
            m = link[m, NEXT]
        node[m, COST] = node[link[m, PARENT], COST] + node[m, EDGE]
        settle(m, node, link, counter, setting)


@kernel(F2, I, OUT2, OUTLINK2, OUTI2, OUTI2, OUTI1, OUT1)
def plant(ends: Floats, columns: int, node: Floats, link: Links, chunk: Ints, head: Ints, counter: Ints, setting: Floats) -> None:
    """Put the two roots `ends` (2, 2) [cells] into an empty pool (head all -1, counters zero)."""
    for tree in range(2):
        root = insert(tree, ends[tree, 0], ends[tree, 1], node, link, chunk, head, counter, setting[SIDE], columns)
        node[root, COST], node[root, EDGE] = 0.0, 0.0


@kernel(F2, F2, LINK2, I, OUT2)
def trace(ends: Floats, node: Floats, link: Links, connection: int, path: Floats) -> int:
    """Write the places from the first root by way of the connection node to the other root into `path` (p, 2) [cells].

    Returns:
        How many there are; where that is more than `path` can hold, nothing is written.
    """
    length = np.zeros(2, dtype=np.int64)
    first = 0
    for half in range(2):
        m = np.int64(connection if half == 0 else link[connection, PARTNER])
        while m >= 0:
            length[half] += 1
            if link[m, PARENT] < 0 and node[m, X] == ends[0, 0] and node[m, Y] == ends[0, 1]:
                first = half
            m = np.int64(link[m, PARENT])
    count = length[0] + length[1] - 1
    if count <= path.shape[0]:
        for half in range(2):
            m = np.int64(connection if half == 0 else link[connection, PARTNER])
            at, stride = (length[first] - 1, -1) if half == first else (length[first] - 1, 1)
            while m >= 0:
                path[at, 0], path[at, 1] = node[m, X], node[m, Y]
                at += stride
                m = np.int64(link[m, PARENT])
    return int(count)


@kernel(F2, LINK2, I2, I2, I, OUT2, OUTLINK2, OUTI2, OUTI2, OUTI1, OUT1)
def transplant(
    old_node: Floats, old_link: Links, old_chunk: Ints, old_head: Ints, columns: int,
    node: Floats, link: Links, chunk: Ints, head: Ints, counter: Ints, setting: Floats,
) -> None:  # fmt: skip
    """Move the trees into an empty pool with buckets of setting[SIDE]; neighbours stay so in memory.

    In cells, arrays as in the module's docstring.
    """
    moved = np.full(old_node.shape[0], -1, dtype=np.int32)
    counter[NODES_A], counter[NODES_B], counter[CHUNKS] = 0, 0, 0
    for tree in range(2):
        for bucket in range(old_head.shape[1]):
            k = old_head[tree, bucket]
            while k >= 0:
                for m in range(k * CHUNK, k * CHUNK + old_chunk[k, 1]):
                    new = insert(tree, old_node[m, X], old_node[m, Y], node, link, chunk, head, counter, setting[SIDE], columns)
                    node[new, COST], node[new, EDGE] = old_node[m, COST], old_node[m, EDGE]
                    moved[m] = new
                k = old_chunk[k, 0]
    for m in range(old_node.shape[0]):
        if moved[m] >= 0:
            for which in range(5):
                other = old_link[m, which]
                link[moved[m], which] = moved[other] if other >= 0 else -1
    if counter[CONNECTION] >= 0:
        counter[CONNECTION] = moved[counter[CONNECTION]]
