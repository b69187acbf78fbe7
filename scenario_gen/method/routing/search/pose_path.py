# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The path through two trees of poses, piece by piece, and made shorter."""

import numpy as np

from scenario_gen.method.routing.search.dubins import (
    Curve,
    length_of,
    LSL,
    onward,
    part_of,
    Pose,
    REVERSED,
    RSR,
    shortest,
    TURNS,
)
from scenario_gen.method.routing.search.growth import SAME
from scenario_gen.method.routing.search.sweep import CAR_SCENE, follow, Scene
from scenario_gen.method.routing.search.tree import edge_to, pose_of
from scenario_gen.method.routing.search.tree_samples import STATES, States, uniform
from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.kernels import F, F2, I, I1, kernel, OUT2

WORTHWHILE = 1e-3  # [cells] that a shortcut must save


@kernel(inline=True)
def _at(path: Floats, k: int) -> Pose:
    """Pose k of a path."""
    return Pose(path[k, 0], path[k, 1], path[k, 2])


@kernel(inline=True)
def _lay(pose: Pose, curve: Curve, radius: float, spacing: float, path: Floats, k: int) -> int:
    """Write pieces of a curve, at most `spacing` long each, to path[k:]; how many are there now (path's length: no room)."""
    for part in range(3):
        length, turn = part_of(curve, part), TURNS[curve.word, part]
        if length < SAME:
            continue
        steps = int(np.ceil(length / spacing))
        h = length / steps
        for _ in range(steps):
            if k >= path.shape[0]:
                return k
            pose = onward(pose, turn, h, radius)
            path[k, 0], path[k, 1], path[k, 2] = pose
            path[k, 3], path[k, 4] = turn / radius, h
            k += 1
    return k


@kernel(I1, I1, F2, F, F, OUT2)
def trace(
    ours: Ints, theirs: Ints, node: Floats, radius: float, spacing: float, path: Floats
) -> int:
    """Write a path into `path` (p, 5): poses x, y, yaw, and curvature and length of the piece that leads to each.

    Args:
        ours: (a,) ids of nodes from the start's root to where the trees meet.
        theirs: (b,) from there to the goal's root.
        node: see `Tree`.
        radius: of the arcs [cells].
        spacing: longest piece [cells].
        path: the answer.

    Returns:
        How many poses there are; where that is not less than `path` can hold, there are more.
    """
    path[0, 0], path[0, 1], path[0, 2] = pose_of(ours[0], node)
    path[0, 3], path[0, 4] = 0.0, 0.0
    k = 1
    for n in range(1, ours.size):
        k = _lay(pose_of(ours[n - 1], node), edge_to(ours[n], node), radius, spacing, path, k)
    for m in theirs[:-1]:
        pose, edge = pose_of(m, node), edge_to(m, node)
        back = Curve(REVERSED[edge.word], edge.c, edge.b, edge.a)
        k = _lay(Pose(pose.x, pose.y, pose.yaw + np.pi), back, radius, spacing, path, k)
    return k


@kernel(inline=True)
def _price_pieces(path: Floats, first: int, last: int, scene: Scene, paid: Floats) -> None:
    """Fill paid[first:last], the cost of the piece that leads to each pose of a path."""
    for k in range(first, last):
        word = RSR if path[k, 3] < 0.0 else LSL
        a, b = (0.0, path[k, 4]) if path[k, 3] == 0.0 else (path[k, 4], 0.0)
        _, paid[k] = follow(_at(path, k - 1), Curve(word, a, b, 0.0), scene.body, scene)


@kernel(inline=True)
def _shift(rows: Floats, first: int, last: int, by: int) -> None:
    """Move rows[first:last] by so many places."""
    if by > 0:
        for k in range(last - 1, first - 1, -1):
            rows[k + by] = rows[k]
    elif by < 0:
        for k in range(first, last):
            rows[k + by] = rows[k]


@kernel(I, I, F, CAR_SCENE, STATES, OUT2)
def shorten(
    n: int, tries: int, spacing: float, scene: Scene, state: States, path: Floats
) -> tuple[int, float]:
    """Put shorter curves between poses of a path, chosen at random; string pulling for cars.

    Source: shortcuts as in Geraerts & Overmars 2007, with Dubins curves.

    Args:
        n: poses of the path.
        tries: pairs of poses that are tried.
        spacing: longest piece [cells].
        scene: what it is checked against.
        state: (1,) of the trees, whose generator is used.
        path: (p, 5) as `trace` writes it, changed in place; p - n poses of room.

    Returns:
        The number of poses now, and the path's cost.
    """
    paid, fresh, radius = np.zeros(path.shape[0]), np.empty_like(path), scene.body.turn
    _price_pieces(path, 1, n, scene, paid)
    for attempt in range(tries):
        i, j = int(uniform(state) * n), int(uniform(state) * n)
        if attempt == 0:
            i, j = 0, n - 1
        if i > j:
            i, j = j, i
        if j - i < 2:
            continue
        old = paid[i + 1 : j + 1].sum()
        edge = shortest(_at(path, i), _at(path, j), radius)
        if length_of(edge) >= old - WORTHWHILE:
            continue
        free, cost = follow(_at(path, i), edge, scene.body, scene)
        if not free or cost >= old - WORTHWHILE:
            continue
        count = _lay(_at(path, i), edge, radius, spacing, fresh, 0)
        grown = count - (j - i)
        if count >= fresh.shape[0] or n + grown > path.shape[0]:
            continue
        fresh[count - 1, :3] = path[j, :3]
        _shift(path, j + 1, n, grown)
        _shift(paid, j + 1, n, grown)
        path[i + 1 : i + 1 + count] = fresh[:count]
        n += grown
        _price_pieces(path, i + 1, i + 1 + count, scene, paid)
    return n, paid[1:n].sum()
