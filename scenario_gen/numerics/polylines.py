# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Searches on polylines, compiled: the nearest edge to a position, and the edges that cross.

A distance from an edge excludes all further edges up to some arc length, because the line cannot
come nearer faster than its arc length grows.
"""

import math

from scenario_gen.numerics.arrays import Floats
from scenario_gen.numerics.kernels import F, F1, F2, kernel, OUT2

_ROUNDING_M = 1e-6  # of arc lengths and distances, so that it excludes no edge


@kernel(F2, F2, F1, F1, F2, OUT2)
def project_positions(
    line: Floats,
    direction: Floats,
    length: Floats,
    station: Floats,
    positions: Floats,
    out: Floats,
) -> None:
    """Fill `out` (P, 2) with stations and offsets to the left [m] of positions (P, 2) [m].

    Of several nearest edges, the first one counts.

    Args:
        line: (M + 1, 2) [m].
        direction: (M, 2) unit vectors of its edges.
        length: (M,) [m] of its edges.
        station: (M + 1,) arc lengths [m] of its points.
        positions: the places to project.
        out: the result.
    """
    nearest = 0
    for i in range(len(positions)):
        x, y = positions[i, 0], positions[i, 1]
        along, left, best = _on_edge(line[nearest], direction[nearest], length[nearest], x, y)
        edge = 0
        while edge < len(length):
            projection = _on_edge(line[edge], direction[edge], length[edge], x, y)
            gap = projection[2]
            if gap < best or (gap == best and edge < nearest):
                nearest = edge
                along, left, best = projection
            edge = _next_edge(station, edge, station[edge + 1] + gap - best)
        out[i, 0] = station[nearest] + along
        out[i, 1] = math.copysign(best, left) if left != 0.0 else 0.0


@kernel(inline=True)
def _on_edge(
    start: Floats, direction: Floats, length: float, x: float, y: float
) -> tuple[float, float, float]:
    """Return the station on an edge, the distance to the left of its line, and from it [m]."""
    dx, dy = x - start[0], y - start[1]
    along = min(max(dx * direction[0] + dy * direction[1], 0.0), length)
    across = dx - along * direction[0]
    over = dy - along * direction[1]
    left = direction[0] * dy - direction[1] * dx
    return along, left, math.sqrt(across * across + over * over)


@kernel(inline=True)
def _next_edge(station: Floats, edge: int, reach: float) -> int:
    """Return the first later edge that does not end before an arc length [m]."""
    edge += 1
    while edge < len(station) - 1 and station[edge + 1] < reach - _ROUNDING_M:
        edge += 1
    return edge


@kernel(F2, F1, F2, F1, F, OUT2)
def fill_crossings(
    first: Floats,
    first_station: Floats,
    second: Floats,
    second_station: Floats,
    min_sine: float,
    out: Floats,
) -> int:
    """Fill `out` (K, 2) with the arc lengths [m] at which two polylines (M, 2) [m] cross.

    They are in the order of the edges; `min_sine` is that of the smallest angle. Returns the
    number of crossings; if it exceeds K, the last ones replace the first.
    """
    count = 0
    for i in range(len(first) - 1):
        ux, uy = first[i + 1, 0] - first[i, 0], first[i + 1, 1] - first[i, 1]
        length = math.hypot(ux, uy)
        j = 0
        while j < len(second) - 1:
            wx, wy = second[j, 0] - first[i, 0], second[j, 1] - first[i, 1]
            vx, vy = second[j + 1, 0] - second[j, 0], second[j + 1, 1] - second[j, 1]
            cross = ux * vy - uy * vx
            t = (wx * vy - wy * vx) / cross
            s = (wx * uy - wy * ux) / cross
            is_steep = abs(cross) >= min_sine * (length * math.hypot(vx, vy))
            if is_steep and 0.0 <= t < 1.0 and 0.0 <= s < 1.0:
                station = first_station[i] + t * (first_station[i + 1] - first_station[i])
                other = second_station[j] + s * (second_station[j + 1] - second_station[j])
                out[count % len(out), 0], out[count % len(out), 1] = station, other
                count += 1
            j = _next_edge(second_station, j, second_station[j] + math.hypot(wx, wy) - length)
    return count
