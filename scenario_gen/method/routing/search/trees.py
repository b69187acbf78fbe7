# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A tree of the search: nodes linked to parent and children, and looked up by position in buckets.

Lengths are in cells. The tree of the goal grows backwards: its poses are turned by half a circle,
so that an edge away from its root is driven towards the goal, and the same code serves both trees.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenario_gen.method.routing.search.dubins import length_of, POSE, Pose
from scenario_gen.method.routing.search.sweep import Body, distance, steer
from scenario_gen.numerics import Ints
from scenario_gen.numerics.kernels import F, kernel, named, OUTI1, OUTI2
from scenario_gen.numerics.numba_import import numba

NODE = np.dtype(
    [
        ("x", np.float64),
        ("y", np.float64),
        ("yaw", np.float64),
        ("cost", np.float64),  # from the root
        ("edge_cost", np.float64),  # of the edge from the parent
        ("parent", np.int32),  # this and the following: a node, or -1
        ("first_child", np.int32),
        ("next_sibling", np.int32),
        ("previous_sibling", np.int32),
        ("next_in_bucket", np.int32),
    ]
)
NEIGHBOUR = np.dtype([("node", np.int64), ("distance", np.float64)])
Records = NDArray[np.void]
MAX_NEAR_COUNT = 2048  # nodes of a near set; the others are ignored


class Tree(NamedTuple):
    """One of the two trees.

    Attributes:
        root: its first node.
        goal: the root of the other tree, in this tree's direction.
        node: (n,) of `NODE`, with room for more nodes.
        size: (1,) number of nodes.
        bucket: (rows, columns) first node of each bucket, or -1.
        near: (MAX_NEAR_COUNT,) of `NEIGHBOUR`, scratch.
        side: of a bucket.
    """

    root: Pose
    goal: Pose
    node: Records
    size: Ints
    bucket: Ints
    near: Records
    side: float


TREE = named(
    Tree,
    POSE,
    POSE,
    numba.types.Array(numba.from_dtype(NODE), 1, "C"),
    OUTI1,
    OUTI2,
    numba.types.Array(numba.from_dtype(NEIGHBOUR), 1, "C"),
    F,
)


@kernel(inline=True, forced=True)
def pose_of(tree: Tree, m: int) -> Pose:
    """Return the pose of node m."""
    node = tree.node[m]
    return Pose(node.x, node.y, node.yaw)


@kernel(inline=True, forced=True)
def has_room(tree: Tree) -> bool:
    """Whether another node can be added."""
    return bool(tree.size[0] < tree.node.shape[0])


@kernel(inline=True, forced=True)
def _nearest_in_bucket(
    tree: Tree, i: int, j: int, pose: Pose, body: Body, best: float, nearest: int
) -> tuple[float, int]:
    """Return the shortest edge from a node of a bucket, or the best one known so far."""
    m = tree.bucket[i, j] if 0 <= j < tree.bucket.shape[1] else -1
    while m >= 0:
        start = pose_of(tree, m)
        length = distance(start, pose)
        if length < best and body.turn_radius > 0.0:
            length = length_of(steer(start, pose, body))
        if length < best:
            best, nearest = length, m
        m = tree.node[m].next_in_bucket
    return best, nearest


@kernel(inline=True, forced=True)
def nearest_node(tree: Tree, pose: Pose, body: Body) -> int:
    """Return the node with the shortest edge to a pose: rings of buckets, until none is nearer."""
    rows, columns = tree.bucket.shape
    row, column = int(pose.y / tree.side), int(pose.x / tree.side)
    best, nearest = np.inf, -1
    for ring in range(rows + columns):
        for i in range(max(row - ring, 0), min(row + ring, rows - 1) + 1):
            stride = 1 if abs(i - row) == ring else 2 * ring
            for j in range(column - ring, column + ring + 1, stride):
                best, nearest = _nearest_in_bucket(tree, i, j, pose, body, best, nearest)
        if best <= ring * tree.side:
            break
    return nearest


@kernel(inline=True, forced=True)
def _near_in_bucket(tree: Tree, i: int, j: int, pose: Pose, radius: float, count: int) -> int:
    """Append the nodes of a bucket within `radius` to the near set; return its size."""
    m = tree.bucket[i, j]
    while m >= 0:
        gap = distance(pose_of(tree, m), pose)
        if gap <= radius and count < MAX_NEAR_COUNT:
            tree.near[count].node = m
            tree.near[count].distance = gap
            count += 1
        m = tree.node[m].next_in_bucket
    return count


@kernel(inline=True, forced=True)
def near_nodes(tree: Tree, pose: Pose, radius: float) -> int:
    """Write the nodes within `radius` of a pose to `tree.near`, and return their number.

    Source: the near set of Algorithm 2; its radius is that of eq 10.
    """
    side = tree.side
    last_row, last_column = tree.bucket.shape[0] - 1, tree.bucket.shape[1] - 1
    first_column = max(int((pose.x - radius) / side), 0)
    count = 0
    for i in range(
        max(int((pose.y - radius) / side), 0), min(int((pose.y + radius) / side), last_row) + 1
    ):
        for j in range(first_column, min(int((pose.x + radius) / side), last_column) + 1):
            count = _near_in_bucket(tree, i, j, pose, radius, count)
    return count


@kernel(inline=True, forced=True)
def _put_in_bucket(tree: Tree, m: int) -> None:
    node = tree.node[m]
    i, j = int(node.y / tree.side), int(node.x / tree.side)
    tree.node[m].next_in_bucket = tree.bucket[i, j]
    tree.bucket[i, j] = m


@kernel(TREE, on_demand=True)
def fill_buckets(tree: Tree) -> None:
    """Put all nodes into empty buckets."""
    for m in range(tree.size[0]):
        _put_in_bucket(tree, m)


@kernel(inline=True, forced=True)
def attach(tree: Tree, m: int, parent: int, cost: float) -> None:
    """Make node m a child of `parent`, by an edge of this cost."""
    node, child = tree.node, tree.node[parent].first_child
    node[m].parent = parent
    node[m].next_sibling = child
    node[m].previous_sibling = -1
    if child >= 0:
        node[child].previous_sibling = m
    node[parent].first_child = m
    node[m].edge_cost = cost
    node[m].cost = node[parent].cost + cost


@kernel(inline=True, forced=True)
def detach(tree: Tree, m: int) -> None:
    """Remove node m from the children of its parent."""
    node = tree.node
    before, after = node[m].previous_sibling, node[m].next_sibling
    if before >= 0:
        node[before].next_sibling = after
    else:
        node[node[m].parent].first_child = after
    if after >= 0:
        node[after].previous_sibling = before


@kernel(inline=True, forced=True)
def add_node(tree: Tree, pose: Pose, parent: int, cost: float) -> int:
    """Add a node as a child of `parent`, by an edge of this cost, and return it."""
    m = int(tree.size[0])
    tree.size[0] += 1
    tree.node[m].x = pose.x
    tree.node[m].y = pose.y
    tree.node[m].yaw = pose.yaw
    tree.node[m].first_child = -1
    attach(tree, m, parent, cost)
    _put_in_bucket(tree, m)
    return m


@kernel(inline=True, forced=True)
def propagate_cost(tree: Tree, top: int) -> None:
    """Update the costs below node `top`: a walk through the subtree that needs no stack.

    Source: Algorithm 5, whose lower cost holds for the whole subtree.
    """
    node, m = tree.node, top
    while True:
        if node[m].first_child >= 0:
            m = int(node[m].first_child)
        else:
            while m != top and node[m].next_sibling < 0:
                m = int(node[m].parent)
            if m == top:
                return
            m = int(node[m].next_sibling)
        node[m].cost = node[node[m].parent].cost + node[m].edge_cost
