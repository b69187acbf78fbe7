# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The path through two trees of poses, piece by piece, and made shorter."""

import numpy as np

from scenario_gen.method.routing.search.dubins import onward, shortest, TURNS
from scenario_gen.method.routing.search.pose_tree import (  # fmt: skip
    HALF_LENGTH,
    HALF_WIDTH,
    LENGTH,
    PART_A,
    PART_B,
    PART_C,
    SAME,
    SWEEP,
    TURN,
    WISH,
    WORD,
    YAW,
)
from scenario_gen.method.routing.search.sweep import follow, scratch_rows
from scenario_gen.method.routing.search.tree_nodes import BOUND, CONNECTION, LINK2, Links, NODES_A, PARENT, PARTNER, X, Y
from scenario_gen.method.routing.search.tree_samples import Random, RandomState, uniform
from scenario_gen.numerics import Counts, Floats, Ints
from scenario_gen.numerics.kernels import F, F2, I, I1, kernel, N2, OUT1, OUT2


@kernel(inline=True)
def _lay(
    x: float, y: float, yaw: float, word: int, a: float, b: float, c: float, radius: float, spacing: float, path: Floats, k: int
) -> int:
    """Write pieces of a curve, at most `spacing` long each, to path[k:]; how many are there now (path's length: no room)."""
    for part in range(3):
        length = a if part == 0 else b if part == 1 else c
        turn = TURNS[word, part]
        if length < SAME:
            continue
        steps = int(np.ceil(length / spacing))
        h = length / steps
        for _ in range(steps):
            if k >= path.shape[0]:
                return k
            x, y, yaw = onward(x, y, yaw, turn, h, radius)
            path[k, 0], path[k, 1], path[k, 2], path[k, 3], path[k, 4] = x, y, yaw, turn / radius, h
            k += 1
    return k


@kernel(F2, LINK2, I1, F, F, OUT2)
def trace(node: Floats, link: Links, counter: Ints, radius: float, spacing: float, path: Floats) -> int:
    """Write the best path into `path` (p, 5): poses x, y, yaw, and curvature and length of the piece that leads to each.

    Args:
        node: the trees.
        link: likewise.
        counter: likewise.
        radius: of the arcs [cells].
        spacing: longest piece [cells].
        path: the answer.

    Returns:
        How many poses there are; where that is not less than `path` can hold, there are more.
    """
    meeting = np.int64(counter[CONNECTION])
    ours = meeting if meeting < counter[NODES_A] else np.int64(link[meeting, PARTNER])
    theirs = np.int64(link[ours, PARTNER])
    chain = np.empty(counter[NODES_A] + 1, dtype=np.int64)
    count = 0
    while ours >= 0:
        chain[count] = ours
        count += 1
        ours = np.int64(link[ours, PARENT])
    root = chain[count - 1]
    path[0, 0], path[0, 1], path[0, 2], path[0, 3], path[0, 4] = node[root, X], node[root, Y], node[root, YAW], 0.0, 0.0
    k = 1
    for step in range(count - 2, -1, -1):
        m, above = chain[step], chain[step + 1]
        word = int(node[m, WORD])
        a, b, c = node[m, PART_A], node[m, PART_B], node[m, PART_C]
        k = _lay(node[above, X], node[above, Y], node[above, YAW], word, a, b, c, radius, spacing, path, k)
    while link[theirs, PARENT] >= 0:  # driven the other way round: the last part first, left stays left
        above = np.int64(link[theirs, PARENT])
        word = int(node[theirs, WORD])
        a, b, c = node[theirs, PART_A], node[theirs, PART_B], node[theirs, PART_C]
        x, y, yaw = node[theirs, X], node[theirs, Y], node[theirs, YAW] + np.pi
        for part in range(2, -1, -1):
            length = a if part == 0 else b if part == 1 else c
            turn = -TURNS[word, part]
            if length < SAME:
                continue
            steps = int(np.ceil(length / spacing))
            for _ in range(steps):
                if k >= path.shape[0]:
                    return k
                x, y, yaw = onward(x, y, yaw, turn, length / steps, radius)
                path[k, 0], path[k, 1], path[k, 2], path[k, 3], path[k, 4] = x, y, yaw, turn / radius, length / steps
                k += 1
        theirs = above
    return k


@kernel(inline=True)
def _prices(
    path: Floats, first: int, last: int, clearance: Floats, blocked: Counts, setting: Floats, guide: Floats, price: Floats,
    low: Floats, high: Floats,
) -> None:  # fmt: skip
    """Fill price[first:last], the cost of the piece that leads to each pose of a path."""
    for k in range(first, last):
        word = 1 if path[k, 3] < 0.0 else 0
        a, b = (0.0, path[k, 4]) if path[k, 3] == 0.0 else (path[k, 4], 0.0)
        _, price[k] = follow(
            clearance, blocked, path[k - 1, 0], path[k - 1, 1], path[k - 1, 2], word, a, b, 0.0, setting[TURN],
            setting[HALF_LENGTH], setting[HALF_WIDTH], setting[SWEEP], setting[WISH : WISH + 6], guide, low, high,
        )  # fmt: skip


@kernel(I, I, F, F2, N2, F2, OUT1, RandomState, OUT2)
def shorten(  # noqa: PLR0912
    n: int, tries: int, spacing: float, clearance: Floats, blocked: Counts, guide: Floats, setting: Floats, random: Random,
    path: Floats,
) -> int:  # fmt: skip
    """Put shorter curves between poses of a path, chosen at random; string pulling for cars.

    Source: shortcuts as in Geraerts & Overmars 2007, with Dubins curves.

    Args:
        n: poses of the path.
        tries: pairs of poses that are tried.
        spacing: longest piece [cells].
        clearance: see `grow`.
        blocked: likewise.
        guide: likewise.
        setting: likewise; setting[BOUND] becomes the path's cost if that is less.
        random: likewise.
        path: (p, 5) as `trace` writes it, changed in place; p - n poses of room.

    Returns:
        The number of poses now.
    """
    rows = scratch_rows(setting[HALF_LENGTH], setting[HALF_WIDTH], setting[SWEEP])
    low, high = np.empty(rows), np.empty(rows)
    price, fresh = np.zeros(path.shape[0]), np.empty_like(path)
    radius = setting[TURN]
    _prices(path, 1, n, clearance, blocked, setting, guide, price, low, high)
    for attempt in range(tries):
        i, j = int(uniform(random) * n), int(uniform(random) * n)
        if attempt == 0:
            i, j = 0, n - 1
        if i > j:
            i, j = j, i
        if j - i < 2:
            continue
        old = 0.0
        for k in range(i + 1, j + 1):
            old += price[k]
        word, a, b, c = shortest(path[i, 0], path[i, 1], path[i, 2], path[j, 0], path[j, 1], path[j, 2], radius)
        if a + b + c >= old - 1e-3:
            continue
        free, cost = follow(
            clearance, blocked, path[i, 0], path[i, 1], path[i, 2], word, a, b, c, radius, setting[HALF_LENGTH],
            setting[HALF_WIDTH], setting[SWEEP], setting[WISH : WISH + 6], guide, low, high,
        )  # fmt: skip
        if free < np.inf or cost >= old - 1e-3:
            continue
        count = _lay(path[i, 0], path[i, 1], path[i, 2], word, a, b, c, radius, spacing, fresh, 0)
        grown = count - (j - i)
        if count >= fresh.shape[0] or n + grown > path.shape[0]:
            continue
        fresh[count - 1, :3] = path[j, :3]
        if grown > 0:
            for k in range(n - 1, j, -1):
                path[k + grown], price[k + grown] = path[k], price[k]
        elif grown < 0:
            for k in range(j + 1, n):
                path[k + grown], price[k + grown] = path[k], price[k]
        for k in range(count):
            path[i + 1 + k] = fresh[k]
        n += grown
        _prices(path, i + 1, i + 1 + count, clearance, blocked, setting, guide, price, low, high)
    total = 0.0
    for k in range(1, n):
        total += price[k]
    setting[BOUND] = min(setting[BOUND], total)
    setting[LENGTH] = total
    return n
