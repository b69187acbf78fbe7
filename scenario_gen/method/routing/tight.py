# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Where a road is too tight for a vehicle, in words."""

import numpy as np

from scenario_gen.numerics import Floats, wrap_angle
from scenario_gen.numerics.plane import edge_lengths
from scenario_gen.roads import footprint_fits
from scenario_gen.types import Road, Vehicle

_STEPS = 4  # of a path, over which its bending is seen
_SHORTEST_M = 0.3  # of so many steps
_BENT = 0.02  # 1/m: a lane that bends less is straight


def too_tight(road: Road, vehicle: Vehicle, path: Floats, limit: float) -> str:
    """Say where a vehicle's path (M, 3) x, y [m], yaw [rad] bends more than it can turn, or than the road is wide for.

    Args:
        road: where the vehicle may be.
        vehicle: its type and size.
        path: as it was fitted to the road.
        limit: curvature [1/m] with which it is planned to turn.

    Returns:
        A clause with the sharpest bend, what the vehicle needs, and what helps; "" where the road is not too tight.
    """
    if len(path) <= _STEPS:
        return ""
    reach = np.cumsum(np.concatenate(([0.0], edge_lengths(path[:, :2]))))
    driven = np.maximum(reach[_STEPS:] - reach[:-_STEPS], _SHORTEST_M)
    bend, middle = (
        np.abs(wrap_angle(path[_STEPS:, 2] - path[:-_STEPS, 2])) / driven,
        path[_STEPS // 2 :][: len(driven)],
    )
    needs = f"it turns with at most {limit:.3f} 1/m ({1.0 / limit:.1f} m)"
    if bend.max() <= limit:
        bend = np.where(footprint_fits(road, middle, vehicle.length, vehicle.width), 0.0, bend)
        needs = "there its footprint reaches beyond the road"
        if bend.max() < _BENT:
            return ""
    k = int(np.argmax(bend))
    return (
        f"the road is too tight for a {vehicle.type} of {vehicle.length:g} m by {vehicle.width:g} m: at ({middle[k, 0]:.1f}, "
        f"{middle[k, 1]:.1f}) m its lanes bend with {bend[k]:.3f} 1/m (radius {1.0 / bend[k]:.1f} m), and {needs}; choose "
        "another road, or leave it out (log.vehicles)"
    )


def off_road(road: Road, vehicle: Vehicle, path: Floats) -> str:
    """Where the fitted path (M, 3) of a vehicle leaves the road; what to do where it does not."""
    off = path[~footprint_fits(road, path, vehicle.length, vehicle.width)]
    if not len(off):
        return "; planning.iterations allows more"
    x, y = off[len(off) // 2, :2]
    return f"; where the recording was placed its footprint leaves the road, at {x:.2f}, {y:.2f} m: no search mends that"
