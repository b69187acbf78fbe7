# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Distances of polylines: how far a route is from the fitted path."""

import numpy as np
import shapely

from scenario_gen.numerics import Floats


def farthest(points: Floats, path: Floats) -> float:
    """Largest distance [m] between two polylines (M, 2 or more), from a point of either to the other; NaN: there is no path."""
    if not len(path):
        return float("nan")
    line, other = points[:, :2], path[:, :2]
    return max(
        float(distances_to_line(line, other).max()), float(distances_to_line(other, line).max())
    )


def distances_to_line(points: Floats, line: Floats) -> Floats:
    """Distance (M,) [m] of points (M, 2 or more) to a polyline (P, 2 or more)."""
    corners = line[:, :2] if len(line) > 1 else np.repeat(line[:, :2], 2, axis=0)
    return np.asarray(
        shapely.distance(shapely.points(points[:, :2]), shapely.linestrings(corners))
    )
