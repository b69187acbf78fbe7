# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""String pulling: the path shortened, without jumping over an obstacle's corner by more than rounding.

Three moves, each of which keeps the path free (exact edge checks) and makes it shorter by the triangle inequality: leave a
vertex out; slide it along one of its edges as far as its other neighbour can see; cut its corner parallel to the line
between its neighbours. Where none helps the string is string_pulled.
"""

import numpy as np

from scenario_gen.numerics import Floats
from scenario_gen.numerics.kernels import F, F2, I, kernel, OUT2
from scenario_gen.roads import segment_free

BISECTIONS = 14  # of an edge, per pass; later passes refine


@kernel(inline=True)
def _slide(clearance: Floats, path: Floats, a: int, v: int, b: int, radius: float) -> bool:
    """Move vertex v along its edge to b, as far as vertex a sees it; whether it moved."""
    ax, ay, vx, vy = path[a, 0], path[a, 1], path[v, 0], path[v, 1]
    dx, dy = path[b, 0] - vx, path[b, 1] - vy
    seen, hidden = 0.0, 1.0
    for _ in range(BISECTIONS):
        middle = 0.5 * (seen + hidden)
        if segment_free(clearance, ax, ay, vx + middle * dx, vy + middle * dy, radius):
            seen = middle
        else:
            hidden = middle
    path[v, 0], path[v, 1] = vx + seen * dx, vy + seen * dy
    return seen > 0.0


@kernel(inline=True)
def _leave_out(clearance: Floats, path: Floats, n: int, radius: float) -> int:
    """From each vertex on, go straight to the farthest later vertex that can be seen (found by doubling); new length."""
    kept, i = 1, 0
    while i < n - 1:
        farthest, stride = i + 1, 2
        while stride >= 1:
            j = farthest + stride
            if j < n and segment_free(
                clearance, path[i, 0], path[i, 1], path[j, 0], path[j, 1], radius
            ):
                farthest, stride = j, 2 * stride
            else:
                stride //= 2
        i = farthest
        path[kept, 0], path[kept, 1] = path[i, 0], path[i, 1]
        # vertex i now lives at `kept` too, but is read at i until the next move: i >= kept
        kept += 1
    return kept


@kernel(F2, I, F, I, OUT2)
def pull_string(clearance: Floats, n: int, radius: float, passes: int, path: Floats) -> int:
    """String pulling: shorten the first `n` vertices of `path` (m, 2) [cells] in place; m - n vertices of room for cuts.

    Returns:
        The number of vertices now. The first and last are unchanged, and every edge is free for the disc.
    """
    n = _leave_out(clearance, path, n, radius)
    for _ in range(passes):
        shorter = 0.0
        v = 1
        while v < n - 1:
            ax, ay, vx, vy, bx, by = (
                path[v - 1, 0],
                path[v - 1, 1],
                path[v, 0],
                path[v, 1],
                path[v + 1, 0],
                path[v + 1, 1],
            )
            before = np.hypot(vx - ax, vy - ay) + np.hypot(bx - vx, by - vy)
            if segment_free(clearance, ax, ay, bx, by, radius):
                for k in range(v, n - 1):
                    path[k, 0], path[k, 1] = path[k + 1, 0], path[k + 1, 1]
                n -= 1
                shorter += before - np.hypot(bx - ax, by - ay)
                continue
            moved = _slide(clearance, path, v - 1, v, v + 1, radius)
            moved |= _slide(clearance, path, v + 1, v, v - 1, radius)
            after = np.hypot(path[v, 0] - ax, path[v, 1] - ay) + np.hypot(
                bx - path[v, 0], by - path[v, 1]
            )
            if before - after < 1e-6 * before and n < path.shape[0]:
                vx, vy = path[v, 0], path[v, 1]
                free, blocked = 0.0, 1.0
                for _ in range(BISECTIONS):
                    cut = 0.5 * (free + blocked)
                    if segment_free(
                        clearance,
                        vx + cut * (ax - vx),
                        vy + cut * (ay - vy),
                        vx + cut * (bx - vx),
                        vy + cut * (by - vy),
                        radius,
                    ):
                        free = cut
                    else:
                        blocked = cut
                if free > 1e-3:
                    for k in range(n, v + 1, -1):
                        path[k, 0], path[k, 1] = path[k - 1, 0], path[k - 1, 1]
                    n += 1
                    path[v, 0], path[v, 1] = vx + free * (ax - vx), vy + free * (ay - vy)
                    path[v + 1, 0], path[v + 1, 1] = vx + free * (bx - vx), vy + free * (by - vy)
                    v += 1
                    saved = (
                        np.hypot(ax - vx, ay - vy)
                        + np.hypot(bx - vx, by - vy)
                        - np.hypot(bx - ax, by - ay)
                    )
                    after -= free * saved
            shorter += before - after
            v += 1
        if shorter < 1e-7:
            break
    return n
