# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Distances between polylines: how far a route is from the fitted path."""

import numpy as np
import shapely

from scenario_gen.numerics import Floats


def max_distance(line: Floats, other: Floats) -> float:
    """Return the Hausdorff distance [m] of two polylines' points; NaN if `other` is empty."""
    if not len(other):
        return float("nan")
    return float(max(distances_to_line(line, other).max(), distances_to_line(other, line).max()))


def distances_to_line(points: Floats, line: Floats) -> Floats:
    """Return the distances (M,) [m] from points (M, 2 or more) to a polyline (P, 2 or more)."""
    corners = line[:, :2] if len(line) > 1 else np.repeat(line[:, :2], 2, axis=0)
    return np.asarray(
        shapely.distance(shapely.points(points[:, :2]), shapely.linestrings(corners))
    )
