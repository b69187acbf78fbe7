# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The memory of the two trees: nodes in buckets, looked up by place, hung under parents, moved when buckets are halved.

Lengths are in cells. Both trees share one pool of nodes. A node lives in a *chunk* of 32 that belongs to one tree and one
square bucket, so that looking for neighbours reads memory in order; the bucket's side is halved as the trees grow. The tree of
the goal grows backwards: its poses are kept turned by half a circle, so that an edge from a node onwards is one that is driven
towards the goal, and one code serves both trees.
"""

from typing import NamedTuple

from numba import from_dtype, types
import numpy as np
from numpy.typing import NDArray

from scenario_gen.method.routing.search.dubins import Curve, length_of, Pose
from scenario_gen.method.routing.search.steering import sample, steer
from scenario_gen.method.routing.search.sweep import Car, Disc, Scene
from scenario_gen.method.routing.search.tree_samples import Rules, STATES, States
from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.kernels import F, I, kernel, named, OUT2, OUTI2

CHUNK = 32
AHEAD = 8  # so many nodes per sample drawn ahead: the trees' density hardly changes within a batch
NEAR = 2048  # scratch for a near set; what exceeds it is left out
LINE, CURVE = 4, 9  # columns of nodes that straight lines join, or curves
X, Y, COST, EDGE, YAW, WORD, PART_A, PART_B, PART_C = 0, 1, 2, 3, 4, 5, 6, 7, 8
PARENT, CHILD, NEXT, PREVIOUS, PARTNER = 0, 1, 2, 3, 4

NEIGHBOUR = np.dtype(
    [("id", np.int64), ("gap", np.float64), ("least", np.float64)]
)  # distance; least cost as parent

Links = NDArray[np.int32]


class Tree(NamedTuple):
    """Both trees; 0 is the start's, 1 the goal's.

    Attributes:
        node: (n, 4) x, y, cost from the root, cost of the edge from the parent; of curves (n, 9) yaw, word and parts of the edge.
        link: (n, 5) parent, first child, next sibling, previous sibling, the node at the same pose in the other tree; -1: none.
        chunk: (m, 2) next chunk of the bucket or -1, nodes in it.
        head: (2, b) first chunk of every bucket of every tree, or -1.
        state: (1,) of `STATE`.
        drawn: (a, 3) keeps the samples that large trees have drawn ahead; none: they are drawn one by one.
        near: (NEAR,) of `NEIGHBOUR`, scratch.
        side: of a bucket.
        columns: buckets side by side.
    """

    node: Floats
    link: Links
    chunk: Ints
    head: Ints
    state: States
    drawn: Floats
    near: NDArray[np.void]
    side: float
    columns: int


NEIGHBOURS = types.Array(from_dtype(NEIGHBOUR), 1, "C")
TREE = named(
    Tree, OUT2, types.Array(types.int32, 2, "C"), OUTI2, OUTI2, STATES, OUT2, NEIGHBOURS, F, I
)


@kernel(inline=True, forced=True)
def pose_of(m: int, node: Floats) -> Pose:
    """Where node m is."""
    yaw = 0.0
    if node.shape[1] > LINE:
        yaw = node[m, YAW]
    return Pose(node[m, X], node[m, Y], yaw)


@kernel(inline=True)
def edge_to(m: int, node: Floats) -> Curve:
    """The edge that leads to node m from its parent."""
    return Curve(int(node[m, WORD]), node[m, PART_A], node[m, PART_B], node[m, PART_C])


@kernel(inline=True, forced=True)
def nearest_node(root: int, pose: Pose, body: Disc | Car, tree: Tree) -> int:
    """The node of a tree with the shortest edge to a pose: rings of buckets outward, until no nearer one is possible."""
    node, chunk, head, side, columns = tree.node, tree.chunk, tree.head, tree.side, tree.columns
    rows = head.shape[1] // columns
    row, column = int(pose.y / side), int(pose.x / side)
    border = min(
        pose.x - column * side,
        (column + 1) * side - pose.x,
        pose.y - row * side,
        (row + 1) * side - pose.y,
    )
    best, nearest = np.inf, -1
    ring = 0
    while True:
        for i in range(max(row - ring, 0), min(row + ring, rows - 1) + 1):
            stride = 1 if abs(i - row) == ring else max(2 * ring, 1)
            for j in range(column - ring, column + ring + 1, stride):
                if j < 0 or j >= columns:
                    continue
                k = head[root, i * columns + j]
                while k >= 0:
                    for m in range(k * CHUNK, k * CHUNK + chunk[k, 1]):
                        dx, dy = node[m, X] - pose.x, node[m, Y] - pose.y
                        square = dx * dx + dy * dy
                        if (
                            square < best and node.shape[1] > LINE
                        ):  # no curve is shorter than the straight line
                            square = length_of(steer(pose_of(m, node), pose, body)) ** 2
                        if square < best:
                            best, nearest = square, m
                    k = chunk[k, 0]
        reach = max(ring * side + border, 0.0)
        if best <= reach * reach or ring > rows + columns:
            return nearest
        ring += 1


@kernel(inline=True, forced=True)
def near_nodes(root: int, pose: Pose, reach: float, tree: Tree) -> int:
    """All nodes of a tree within `reach` of a place: ids and distances into `tree.near`.

    Source: the near set of Algorithm 2, its radius by eq 10.

    Returns how many.
    """
    node, chunk, head, near = tree.node, tree.chunk, tree.head, tree.near
    x, y, side, columns = pose.x, pose.y, tree.side, tree.columns
    rows = head.shape[1] // columns
    count = 0
    for i in range(max(int((y - reach) / side), 0), min(int((y + reach) / side), rows - 1) + 1):
        for j in range(
            max(int((x - reach) / side), 0), min(int((x + reach) / side), columns - 1) + 1
        ):
            k = head[root, i * columns + j]
            while k >= 0:
                for m in range(k * CHUNK, k * CHUNK + chunk[k, 1]):
                    dx, dy = node[m, X] - x, node[m, Y] - y
                    square = dx * dx + dy * dy
                    if square <= reach * reach and count < NEAR:
                        near[count].id, near[count].gap = m, np.sqrt(square)
                        count += 1
                k = chunk[k, 0]
    return count


@kernel(inline=True, forced=True)
def insert(root: int, pose: Pose, tree: Tree) -> int:
    """Put a bare node into its bucket and return its id."""
    chunk, head, node, state = tree.chunk, tree.head, tree.node, tree.state[0]
    bucket = int(pose.y / tree.side) * tree.columns + int(pose.x / tree.side)
    k = head[root, bucket]
    if k < 0 or chunk[k, 1] == CHUNK:
        k = state.chunks
        state.chunks += 1
        chunk[k, 0], chunk[k, 1] = head[root, bucket], 0
    head[root, bucket] = k
    m = int(k * CHUNK + chunk[k, 1])
    chunk[k, 1] += 1
    state.nodes[root] += 1
    if node.shape[1] > LINE:
        node[m, YAW] = pose.yaw
    node[m, X], node[m, Y] = pose.x, pose.y
    for which in range(5):
        tree.link[m, which] = -1
    return m


@kernel(inline=True, forced=True)
def adopt(parent: int, m: int, edge: Curve, cost: float, node: Floats, link: Links) -> None:
    """Hang node m under `parent`, by an edge that costs `cost`."""
    link[m, PARENT], link[m, NEXT], link[m, PREVIOUS] = parent, link[parent, CHILD], -1
    if link[parent, CHILD] >= 0:
        link[link[parent, CHILD], PREVIOUS] = m
    link[parent, CHILD] = m
    if node.shape[1] > LINE:
        node[m, WORD], node[m, PART_A], node[m, PART_B], node[m, PART_C] = edge
    node[m, EDGE] = cost
    node[m, COST] = node[parent, COST] + cost


@kernel(inline=True, forced=True)
def release(m: int, link: Links) -> None:
    """Take node m from its parent."""
    before, after = link[m, PREVIOUS], link[m, NEXT]
    if before >= 0:
        link[before, NEXT] = after
    else:
        link[link[m, PARENT], CHILD] = after
    if after < 0:
        return
    link[after, PREVIOUS] = before


@kernel(inline=True, forced=True)
def settle(m: int, node: Floats, link: Links, state: States) -> None:
    """If node m is where the trees meet, see if the path through it is the best so far (Algorithm 1, line 7)."""
    partner = link[m, PARTNER]
    if partner < 0 or node[m, COST] + node[partner, COST] >= state[0].best:
        return
    state[0].best = node[m, COST] + node[partner, COST]
    state[0].connection = m


@kernel(inline=True, forced=True)
def propagate(top: int, node: Floats, link: Links, state: States) -> None:
    """Pass a lower cost on to all below node `top`: a walk through the subtree that needs no stack.

    Source: Algorithm 5, whose lower cost holds for the whole subtree.
    """
    m = top
    settle(m, node, link, state)
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
        settle(m, node, link, state)


@kernel(TREE, TREE)
def transplant(old: Tree, tree: Tree) -> None:
    """Move the trees into an empty pool; neighbours stay so in memory."""
    state = tree.state[0]
    moved = np.full(old.node.shape[0], -1, dtype=np.int32)
    state.nodes[:], state.chunks = 0, 0
    for root in range(2):
        for bucket in range(old.head.shape[1]):
            k = old.head[root, bucket]
            while k >= 0:
                for m in range(k * CHUNK, k * CHUNK + old.chunk[k, 1]):
                    moved[m] = insert(root, pose_of(m, old.node), tree)
                    tree.node[moved[m]] = old.node[m]
                k = old.chunk[k, 0]
    for m in range(old.node.shape[0]):
        if moved[m] >= 0:
            for which in range(5):
                other = old.link[m, which]
                tree.link[moved[m], which] = moved[other] if other >= 0 else -1
    state.root = moved[state.root]
    if state.connection >= 0:
        state.connection = moved[state.connection]


@kernel(inline=True)
def _draw_ahead(scene: Scene, rules: Rules, tree: Tree) -> None:
    """Fill `tree.drawn`, or a part of it, bucket by bucket.

    The same samples in another order: one after the other they need the same neighbours, which the processor's cache still has.
    """
    drawn, side = tree.drawn, tree.side
    state = tree.state[0]
    batch = min((state.nodes[0] + state.nodes[1]) // AHEAD, drawn.shape[0])
    fresh = np.empty((batch, 3))
    begin = np.zeros(tree.head.shape[1] + 1, dtype=np.int64)
    for k in range(batch):
        fresh[k, 0], fresh[k, 1], fresh[k, 2] = sample(scene.body, scene, rules, tree.state)
        begin[int(fresh[k, 1] / side) * tree.columns + int(fresh[k, 0] / side) + 1] += 1
    for b in range(begin.size - 1):
        begin[b + 1] += begin[b]
    for k in range(batch):
        b = int(fresh[k, 1] / side) * tree.columns + int(fresh[k, 0] / side)
        drawn[begin[b]] = fresh[k]
        begin[b] += 1
    state.drawn, state.used = batch, 0


@kernel(inline=True, forced=True)
def next_sample(scene: Scene, rules: Rules, tree: Tree) -> Pose:
    """The next pose to grow to."""
    drawn, state = tree.drawn, tree.state[0]
    if drawn.shape[0] == 0:
        return sample(scene.body, scene, rules, tree.state)
    while state.used == state.drawn:
        _draw_ahead(scene, rules, tree)
    k = state.used
    state.used += 1
    return Pose(drawn[k, 0], drawn[k, 1], drawn[k, 2])
