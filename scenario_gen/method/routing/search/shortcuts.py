# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Shorter paths: string pulling for straight lines, random shortcuts for Dubins curves.

String pulling has three moves. Each keeps the path free (exact edge checks) and shortens it by the
triangle inequality: remove a vertex; slide it along one of its edges as far as its other neighbour
sees it; cut its corner parallel to the line between its neighbours. The path is taut when none of
them helps.
"""

import itertools

import numpy as np

from scenario_gen.method.routing.search.dubins import dubins_poses, Pose
from scenario_gen.method.routing.search.steering import costs_per_length, steering_cost
from scenario_gen.method.routing.search.sweep import Scene
from scenario_gen.numerics import Floats, wrap_angle
from scenario_gen.numerics.kernels import F, F2, I, kernel, OUT2
from scenario_gen.numerics.loops import copy_to
from scenario_gen.numerics.plane import edge_lengths
from scenario_gen.roads import segment_free

BISECTIONS_COUNT = 14  # of an edge, per pass; later passes refine
MIN_CUT_SHARE = 1e-3  # of a corner
MIN_SHORTENING_CELLS = 1e-7  # of a pass
MIN_SAVING_CELLS = 1e-3  # of a shortcut
CORNER_MARGIN_CELLS = 1e-7  # added to a disc, so that rounding touches no corner
PASSES_COUNT = 30


@kernel(inline=True)
def _sees(clearance: Floats, path: Floats, a: int, x: float, y: float, radius: float) -> bool:
    """Whether the straight line from vertex a to (x, y) is free."""
    return bool(segment_free(clearance, path[a, 0], path[a, 1], x, y, radius))


@kernel(inline=True)
def _slide(clearance: Floats, path: Floats, a: int, v: int, b: int, radius: float) -> float:
    """Move vertex v along its edge to vertex b, as far as vertex a sees it; return the share."""
    vx, vy = path[v, 0], path[v, 1]
    dx, dy = path[b, 0] - vx, path[b, 1] - vy
    seen, hidden = 0.0, 1.0
    for _ in range(BISECTIONS_COUNT):
        middle = 0.5 * (seen + hidden)
        if _sees(clearance, path, a, vx + middle * dx, vy + middle * dy, radius):
            seen = middle
        else:
            hidden = middle
    path[v, 0] = vx + seen * dx
    path[v, 1] = vy + seen * dy
    return seen


@kernel(inline=True)
def _cut(clearance: Floats, path: Floats, v: int, n: int, radius: float) -> int:
    """Cut the corner at vertex v as far as the cut is free; return the number of vertices."""
    vx, vy = path[v, 0], path[v, 1]
    ax, ay = path[v - 1, 0] - vx, path[v - 1, 1] - vy
    bx, by = path[v + 1, 0] - vx, path[v + 1, 1] - vy
    free, blocked = 0.0, 1.0
    for _ in range(BISECTIONS_COUNT):
        cut = 0.5 * (free + blocked)
        if segment_free(
            clearance, vx + cut * ax, vy + cut * ay, vx + cut * bx, vy + cut * by, radius
        ):
            free = cut
        else:
            blocked = cut
    if free < MIN_CUT_SHARE or n == path.shape[0]:
        return n
    for k in range(n, v + 1, -1):
        copy_to(path[k], path[k - 1])
    path[v, 0], path[v, 1] = vx + free * ax, vy + free * ay
    path[v + 1, 0], path[v + 1, 1] = vx + free * bx, vy + free * by
    return n + 1


@kernel(inline=True)
def _remove_vertices(clearance: Floats, path: Floats, n: int, radius: float) -> int:
    """Go straight from each vertex to the farthest one that it sees, found by doubling."""
    kept, i = 1, 0
    while i < n - 1:
        farthest, stride = i + 1, 2
        while stride >= 1:
            j = farthest + stride
            if j < n and _sees(clearance, path, i, path[j, 0], path[j, 1], radius):
                farthest, stride = j, 2 * stride
            else:
                stride //= 2
        i = farthest
        copy_to(path[kept], path[i])  # and vertex i is still there: kept <= i
        kept += 1
    return kept


@kernel(inline=True)
def _length(path: Floats, n: int) -> float:
    total = 0.0
    for k in range(1, n):
        total += np.hypot(path[k, 0] - path[k - 1, 0], path[k, 1] - path[k - 1, 1])
    return total


@kernel(F2, I, F, I, OUT2, on_demand=True)
def pull_string(clearance: Floats, n: int, radius: float, passes: int, path: Floats) -> int:
    """Shorten the first `n` vertices of `path` (m, 2) [cells] in place; m - n have room for cuts.

    Returns:
        The number of vertices. The first and last are unchanged; every edge is free for the disc.
    """
    for _ in range(passes):
        n = _remove_vertices(clearance, path, n, radius)
        before = _length(path, n)
        v = 1
        while v < n - 1:
            slid = _slide(clearance, path, v - 1, v, v + 1, radius)
            slid += _slide(clearance, path, v + 1, v, v - 1, radius)
            grown = n if slid > 0.0 else _cut(clearance, path, v, n, radius)
            v += 1 + grown - n
            n = grown
        if before - _length(path, n) < MIN_SHORTENING_CELLS:
            break
    return n


def string_pulled(
    clearance: Floats, path: Floats, radius: float, passes: int = PASSES_COUNT
) -> Floats:
    """Return a path (P, 2), shortened by string pulling for a disc of `radius`; in cells."""
    vertices = np.empty((2 * len(path) + 32, 2))
    vertices[: len(path)] = path
    count = pull_string(clearance, len(path), radius + CORNER_MARGIN_CELLS, passes, vertices)
    return vertices[:count].copy()


def dense_path(chain: Floats, radius: float, spacing: float) -> Floats:
    """Return poses (P, 3) along the Dubins curves through a chain of poses (k, 3); in cells."""
    pieces = [chain[:1]]
    for start, end in itertools.pairwise(chain):
        pieces.append(dubins_poses(start, end, radius, spacing)[1:])
        pieces[-1][-1:] = end
    return np.concatenate(pieces)


def shortened(
    path: Floats, attempts: int, spacing: float, scene: Scene, rng: np.random.Generator
) -> tuple[Floats, float]:
    """Put cheaper Dubins curves between random poses of a path (P, 3); return it and its cost.

    The first attempt joins start and goal. All is in cells.

    Source: shortcuts as in Geraerts & Overmars 2007, with Dubins curves.
    """
    radius, costs = scene.body.turn_radius, _costs(path, scene)
    for attempt in range(attempts):
        i, j = sorted(rng.integers(len(path), size=2).tolist())
        if attempt == 0:
            i, j = 0, len(path) - 1
        if j - i < 2:
            continue
        cost = steering_cost(Pose(*path[i]), Pose(*path[j]), scene)
        if cost > costs[i:j].sum() - MIN_SAVING_CELLS:
            continue
        piece = dense_path(path[[i, j]], radius, spacing)
        path = np.concatenate((path[:i], piece, path[j + 1 :]))
        costs = np.concatenate((costs[:i], _costs(piece, scene), costs[j:]))
    return path, float(costs.sum())


def _costs(path: Floats, scene: Scene) -> Floats:
    """Return the cost (P - 1,) of each piece, an arc or a straight line, of a free path (P, 3)."""
    per_length = np.empty(len(path) - 1)
    costs_per_length(path[1:], scene, per_length)
    half_turn = 0.5 * wrap_angle(np.diff(path[:, 2]))
    return per_length * edge_lengths(path[:, :2]) / np.sinc(half_turn / np.pi)
