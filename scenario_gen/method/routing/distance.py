# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How far two polylines are apart."""

import numpy as np

from scenario_gen.numerics import Floats
from scenario_gen.numerics.kernels import F2, kernel, OUT1


def farthest(points: Floats, path: Floats) -> float:
    """Largest distance [m] between two polylines (M, 2 or more), from a point of either to the other; NaN: there is no path."""
    if not len(path):
        return float("nan")
    line, other = points[:, :2], path[:, :2]
    return max(float(distances_to_line(line, other).max()), float(distances_to_line(other, line).max()))


def distances_to_line(points: Floats, line: Floats) -> Floats:
    """Distance (M,) [m] of points (M, 2) to a polyline (P, 2)."""
    out = np.empty(len(points))
    _distances(points, line, out)
    return out


@kernel(F2, F2, OUT1)
def _distances(points: Floats, line: Floats, out: Floats) -> None:
    """Write the distance of each point (M, 2) to the polyline (P, 2) to `out` (M,)."""
    for m in range(points.shape[0]):
        dx, dy = points[m, 0] - line[0, 0], points[m, 1] - line[0, 1]
        least = dx * dx + dy * dy
        for k in range(line.shape[0] - 1):
            ex, ey = line[k + 1, 0] - line[k, 0], line[k + 1, 1] - line[k, 1]
            rx, ry = points[m, 0] - line[k, 0], points[m, 1] - line[k, 1]
            along = min(max((rx * ex + ry * ey) / max(ex * ex + ey * ey, 1e-12), 0.0), 1.0)
            ox, oy = rx - along * ex, ry - along * ey
            least = min(least, ox * ox + oy * oy)
        out[m] = np.sqrt(least)
