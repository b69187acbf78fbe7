# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Algorithms 1-5 of the paper's appendix as kernels: two rapidly-exploring trees that rewire, meet, and go on.

Lengths are in cells. Both trees share one pool of nodes. A node lives in a *chunk* of 32 that belongs to one tree and one
square bucket, so that looking for neighbours reads memory in order; the bucket's side is halved as the trees grow.

    node   (n, 4)  x, y, cost from the root, length of the edge to the parent
    link   (n, 5)  parent, first child, next sibling, previous sibling, the node at the same place in the other tree; -1: none
    chunk  (m, 2)  next chunk of the bucket or -1, nodes in it
    head   (2, b)  first chunk of every bucket of every tree, or -1
"""

from numba import types
import numpy as np

from scenario_gen.arrays import Floats, Ints
from scenario_gen.kernels import F2, I, I1, I2, kernel, OUT1, OUT2, OUTI1, OUTI2
from scenario_gen.roads.clearance import segment_free

CHUNK = 32
NEAR = 2048  # scratch for a near set; what exceeds it is left out
X, Y, COST, EDGE = 0, 1, 2, 3
PARENT, CHILD, NEXT, PREVIOUS, PARTNER = 0, 1, 2, 3, 4
# `counter`, whole numbers that change: nodes per tree, chunks, the tree to extend next, iterations, history, meeting node
NODES_A, NODES_B, CHUNKS, ACTIVE, ITERATION, HISTORY, MEETING = 0, 1, 2, 3, 4, 5, 6
# `setting`, what steers the search: disc radius, step, gamma and zeta of eq 10, bucket side, length of the best path known
# from elsewhere (it bounds the informed set), length of the trees' own best path, 1 to extend greedily before the
# first path, 1 to let edges skip ancestors in sight, share of samples beside obstacles' corners
RADIUS, STEP, GAMMA, ZETA, SIDE, BOUND, BEST, GREEDY, SKIP, CORNERS = 0, 1, 2, 3, 4, 5, 6, 7, 8, 9
TRAPPED, ADVANCED, REACHED = 0, 1, 2

RandomState = types.Array(types.uint64, 1, "C")


@kernel(inline=True)
def uniform(state: "np.typing.NDArray[np.uint64]") -> float:
    """A number in [0, 1) from SplitMix64 (Steele, Lea & Flood 2014); advances `state` (1,)."""
    state[0] += np.uint64(0x9E3779B97F4A7C15)
    z = state[0]
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return float((z ^ (z >> np.uint64(31))) >> np.uint64(11)) * 2.0**-53


@kernel(inline=True)
def _bucket(x: float, y: float, side: float, columns: int) -> int:
    return int(y / side) * columns + int(x / side)


@kernel(inline=True)
def _nearest(tree: int, x: float, y: float, node: Floats, chunk: Ints, head: Ints, side: float, columns: int) -> int:
    """The tree's node nearest to (x, y): rings of buckets outward, until no nearer one is possible."""
    rows = head.shape[1] // columns
    row, column = int(y / side), int(x / side)
    border = min(x - column * side, (column + 1) * side - x, y - row * side, (row + 1) * side - y)
    best, found = np.inf, -1
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
                            best, found = square, m
                    k = chunk[k, 0]
        reach = max(ring * side + border, 0.0)
        if best <= reach * reach or ring > rows + columns:
            return found
        ring += 1


@kernel(inline=True)
def _near(
    tree: int, x: float, y: float, reach: float, node: Floats, chunk: Ints, head: Ints, side: float, columns: int,
    near: Ints, gap: Floats,
) -> int:  # fmt: skip
    """All nodes of the tree within `reach` of (x, y): ids into `near`, distances into `gap`; returns how many."""
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
def _insert(
    tree: int, x: float, y: float, node: Floats, link: Ints, chunk: Ints, head: Ints, counter: Ints, side: float, columns: int
) -> int:
    """Put a bare node into its bucket and return its id."""
    bucket = _bucket(x, y, side, columns)
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
def _adopt(parent: int, m: int, edge: float, node: Floats, link: Ints) -> None:
    """Hang node m under `parent`."""
    link[m, PARENT], link[m, NEXT], link[m, PREVIOUS] = parent, link[parent, CHILD], -1
    if link[parent, CHILD] >= 0:
        link[link[parent, CHILD], PREVIOUS] = m
    link[parent, CHILD] = m
    node[m, EDGE] = edge
    node[m, COST] = node[parent, COST] + edge


@kernel(inline=True)
def _release(m: int, link: Ints) -> None:
    """Take node m from its parent."""
    before, after = link[m, PREVIOUS], link[m, NEXT]
    if before >= 0:
        link[before, NEXT] = after
    else:
        link[link[m, PARENT], CHILD] = after
    if after >= 0:
        link[after, PREVIOUS] = before


@kernel(inline=True)
def _settle(m: int, node: Floats, link: Ints, counter: Ints, setting: Floats) -> None:
    """If node m is where the trees meet, see whether the path through it is the best so far."""
    partner = link[m, PARTNER]
    if partner >= 0 and node[m, COST] + node[partner, COST] < setting[BEST]:
        setting[BEST] = node[m, COST] + node[partner, COST]
        counter[MEETING] = m


@kernel(inline=True)
def _propagate(top: int, node: Floats, link: Ints, counter: Ints, setting: Floats) -> None:
    """Pass a lower cost on to all below node `top`: a walk through the subtree that needs no stack."""
    m = top
    _settle(m, node, link, counter, setting)
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
        _settle(m, node, link, counter, setting)


@kernel(inline=True)
def _ancestor_in_sight(parent: int, x: float, y: float, clearance: Floats, node: Floats, link: Ints, radius: float) -> int:
    """The farthest of the parent's ancestors, one after the other, that still sees (x, y): as Quick-RRT* (Jeong et al. 2019)."""
    above = link[parent, PARENT]
    while above >= 0 and segment_free(clearance, node[above, X], node[above, Y], x, y, radius):
        parent, above = above, link[above, PARENT]
    return parent


@kernel(inline=True)
def _extend(  # noqa: PLR0912
    tree: int, qx: float, qy: float, ends: Floats, clearance: Floats, node: Floats, link: Ints, chunk: Ints, head: Ints,
    counter: Ints, setting: Floats, columns: int, near: Ints, gap: Floats,
) -> tuple[int, int]:  # fmt: skip
    """Algorithm 2: one step of a tree towards (qx, qy); returns what came of it, and the node."""
    side, radius = setting[SIDE], setting[RADIUS]
    nearest = _nearest(tree, qx, qy, node, chunk, head, side, columns)
    nx, ny = node[nearest, X], node[nearest, Y]
    distance = np.sqrt((qx - nx) * (qx - nx) + (qy - ny) * (qy - ny))
    if distance < 1e-9:
        return REACHED, nearest
    status, x, y, edge = REACHED, qx, qy, distance
    if distance > setting[STEP]:
        status, edge = ADVANCED, setting[STEP]
        x, y = nx + (qx - nx) * edge / distance, ny + (qy - ny) * edge / distance
    from_root = np.sqrt((x - ends[tree, 0]) ** 2 + (y - ends[tree, 1]) ** 2)
    to_go = np.sqrt((x - ends[1 - tree, 0]) ** 2 + (y - ends[1 - tree, 1]) ** 2)
    if from_root + to_go >= setting[BOUND] or not segment_free(clearance, nx, ny, x, y, radius):
        return TRAPPED, -1
    n = float(max(counter[tree], 2))
    reach = min(setting[GAMMA] * np.sqrt(np.log(n) / n), setting[ZETA])  # eq 10 with exponent 1/d, d = 2
    if setting[GREEDY] > 0.0 and setting[BEST] == np.inf:
        reach = 0.0  # haste first: what was not rewired now is later
    count = _near(tree, x, y, reach, node, chunk, head, side, columns, near, gap)
    parent, cost = nearest, node[nearest, COST] + edge
    while True:  # Algorithm 4: the cheapest near node with a free edge, cheapest first
        candidate, cheapest = -1, cost
        for k in range(count):
            if near[k] >= 0 and node[near[k], COST] + gap[k] < cheapest:
                candidate, cheapest = k, node[near[k], COST] + gap[k]
        if candidate < 0:
            break
        m = near[candidate]
        if segment_free(clearance, node[m, X], node[m, Y], x, y, radius):
            parent, cost, edge = m, cheapest, gap[candidate]
            break
        near[candidate] = -1  # no edge: not for rewiring either
    if setting[SKIP] > 0.0 and setting[BEST] < np.inf:
        parent = _ancestor_in_sight(parent, x, y, clearance, node, link, radius)
        edge = np.sqrt((x - node[parent, X]) ** 2 + (y - node[parent, Y]) ** 2)
        cost = node[parent, COST] + edge
    if cost + to_go >= setting[BEST]:
        return TRAPPED, -1
    new = _insert(tree, x, y, node, link, chunk, head, counter, side, columns)
    _adopt(parent, new, edge, node, link)
    for k in range(count):  # Algorithm 5
        m = near[k]
        if m < 0 or m == parent or cost + gap[k] >= node[m, COST] - 1e-9:
            continue
        if segment_free(clearance, node[m, X], node[m, Y], x, y, radius):
            above, length = new, gap[k]
            if setting[SKIP] > 0.0 and setting[BEST] < np.inf:
                above = _ancestor_in_sight(new, node[m, X], node[m, Y], clearance, node, link, radius)
                length = np.sqrt((node[m, X] - node[above, X]) ** 2 + (node[m, Y] - node[above, Y]) ** 2)
            _release(m, link)
            _adopt(above, m, length, node, link)
            _propagate(m, node, link, counter, setting)
    return status, new


@kernel(inline=True)
def _in_cell(cells: Ints, width: int, random: "np.typing.NDArray[np.uint64]") -> tuple[float, float]:
    """A point of one of the cells (flat indices), uniformly."""
    cell = cells[int(uniform(random) * cells.size)]
    return cell % width + uniform(random), cell // width + uniform(random)


@kernel(inline=True)
def _detour(ends: Floats, x: float, y: float) -> float:
    """The least length of a path from start to goal by way of (x, y)."""
    from_start = np.sqrt((x - ends[0, 0]) ** 2 + (y - ends[0, 1]) ** 2)
    to_goal = np.sqrt((x - ends[1, 0]) ** 2 + (y - ends[1, 1]) ** 2)
    return float(from_start + to_goal)


@kernel(inline=True)
def _sample(
    ends: Floats, free_cells: Ints, corner_cells: Ints, clearance: Floats, bound: float, corners: float,
    random: "np.typing.NDArray[np.uint64]",
) -> tuple[float, float]:  # fmt: skip
    """A point of the component, uniformly; once a path of length `bound` is known, of the ellipse that can better it.

    From then on a share of the samples lies in the cells diagonally before obstacles' convex corners: where shortest paths bend.
    """
    if corner_cells.size > 0 and corners > 0.0 and bound < np.inf and uniform(random) < corners:
        for _ in range(20):
            x, y = _in_cell(corner_cells, clearance.shape[1], random)
            if _detour(ends, x, y) < bound:
                return x, y
    height, width = clearance.shape
    dx, dy = ends[1, 0] - ends[0, 0], ends[1, 1] - ends[0, 1]
    straight = np.sqrt(dx * dx + dy * dy)
    major = 0.5 * bound
    minor = 0.5 * np.sqrt(max(bound * bound - straight * straight, 0.0)) if bound < np.inf else np.inf
    small = np.pi * major * minor < free_cells.size
    x, y = ends[1, 0], ends[1, 1]
    for _ in range(100):
        if small:  # Gammell, Srinivasa & Barfoot 2014: sample the ellipse directly
            angle, r = 2.0 * np.pi * uniform(random), np.sqrt(uniform(random))
            u, v = major * r * np.cos(angle), minor * r * np.sin(angle)
            c, s = (dx / straight, dy / straight) if straight > 0.0 else (1.0, 0.0)
            x = 0.5 * (ends[0, 0] + ends[1, 0]) + c * u - s * v
            y = 0.5 * (ends[0, 1] + ends[1, 1]) + s * u + c * v
            i, j = int(np.floor(y)), int(np.floor(x))
            if 0 <= i < height and 0 <= j < width and clearance[i, j] > 0.0:
                break
        else:
            x, y = _in_cell(free_cells, width, random)
            if _detour(ends, x, y) < bound:
                break
    return x, y


@kernel(I, F2, F2, I1, I1, OUT2, OUTI2, OUTI2, OUTI2, OUTI1, OUT1, OUT2, RandomState)
def grow(
    iterations: int, clearance: Floats, ends: Floats, free_cells: Ints, corner_cells: Ints,
    node: Floats, link: Ints, chunk: Ints, head: Ints,
    counter: Ints, setting: Floats, history: Floats, random: "np.typing.NDArray[np.uint64]",
) -> None:  # fmt: skip
    """Algorithm 1 for at most `iterations`; returns early at the first path, and when the pool or the history is full.

    Args:
        iterations: how many samples to draw.
        clearance: (H, W) cells.
        ends: (2, 2) start and goal, the trees' roots.
        free_cells: flat indices of the cells to sample from.
        corner_cells: those of them that lie before convex corners of obstacles.
        node: see the module's docstring; this and the next five are changed in place.
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
            x, y = _sample(ends, free_cells, corner_cells, clearance, setting[BOUND], setting[CORNERS], random)
        counter[ITERATION] += 1
        known = setting[BEST]
        which, new, ready = tree, -1, False
        while counter[CHUNKS] + 1 < chunk.shape[0]:
            status, m = _extend(
                which, x, y, ends, clearance, node, link, chunk, head, counter, setting, columns, near, gap
            )  # fmt: skip
            if ready:  # Algorithm 3: connect the other tree to the new node
                if status == ADVANCED:
                    continue
                if status == REACHED:
                    link[new, PARTNER], link[m, PARTNER] = m, new
                    _settle(new, node, link, counter, setting)
                break
            new = m if status != TRAPPED else new
            if new < 0:
                break
            greedy = setting[GREEDY] > 0.0 and known == np.inf and status == ADVANCED
            if not greedy:
                which, x, y, ready = 1 - tree, node[new, X], node[new, Y], True
        if setting[BEST] < known:
            setting[BOUND] = min(setting[BOUND], setting[BEST])
            history[counter[HISTORY], 0], history[counter[HISTORY], 1] = counter[ITERATION], setting[BEST]
            counter[HISTORY] += 1
        counter[ACTIVE] = 1 - tree
        if known == np.inf and setting[BEST] < np.inf:
            return


@kernel(F2, I, OUT2, OUTI2, OUTI2, OUTI2, OUTI1, OUT1)
def plant(ends: Floats, columns: int, node: Floats, link: Ints, chunk: Ints, head: Ints, counter: Ints, setting: Floats) -> None:
    """Put the two roots into an empty pool (head all -1, counters zero)."""
    for tree in range(2):
        root = _insert(tree, ends[tree, 0], ends[tree, 1], node, link, chunk, head, counter, setting[SIDE], columns)
        node[root, COST], node[root, EDGE] = 0.0, 0.0


@kernel(I2, I, OUTI1)
def trace(link: Ints, m: int, branch: Ints) -> int:
    """Write node m and its ancestors into `branch`; returns how many there are (only as many as fit are written)."""
    count = 0
    while m >= 0:
        if count < branch.size:
            branch[count] = m
        count += 1
        m = link[m, PARENT]
    return count


@kernel(F2, I2, I2, I2, I, OUT2, OUTI2, OUTI2, OUTI2, OUTI1, OUT1)
def transplant(
    old_node: Floats, old_link: Ints, old_chunk: Ints, old_head: Ints, columns: int,
    node: Floats, link: Ints, chunk: Ints, head: Ints, counter: Ints, setting: Floats,
) -> None:  # fmt: skip
    """Move the trees into an empty pool with buckets of setting[SIDE]; nodes that are near each other stay so in memory."""
    moved = np.full(old_node.shape[0], -1, dtype=np.int64)
    counter[NODES_A], counter[NODES_B], counter[CHUNKS] = 0, 0, 0
    for tree in range(2):
        for bucket in range(old_head.shape[1]):
            k = old_head[tree, bucket]
            while k >= 0:
                for m in range(k * CHUNK, k * CHUNK + old_chunk[k, 1]):
                    new = _insert(tree, old_node[m, X], old_node[m, Y], node, link, chunk, head, counter, setting[SIDE], columns)
                    node[new, COST], node[new, EDGE] = old_node[m, COST], old_node[m, EDGE]
                    moved[m] = new
                k = old_chunk[k, 0]
    for m in range(old_node.shape[0]):
        if moved[m] >= 0:
            for which in range(5):
                other = old_link[m, which]
                link[moved[m], which] = moved[other] if other >= 0 else -1
    if counter[MEETING] >= 0:
        counter[MEETING] = moved[counter[MEETING]]
