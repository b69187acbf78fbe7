# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Two oriented footprints, at many instants at once: their distance, and the time until they meet."""

import numpy as np

from scenario_gen.method.evaluation.motion import Motion
from scenario_gen.numerics import exact, Floats
from scenario_gen.types import once_per_object, Vehicle

STILL = 1e-6  # m/s; what closes more slowly does not close: rounding alone makes equal velocities differ


@once_per_object
def footprint_distance(motion: Motion, a: int, b: int) -> Floats:
    """Return the distance (T,) in metres between the footprints of vehicles a and b; 0 where they overlap.

    Two convex shapes that do not overlap are nearest at a corner of one of them.
    """
    first, second = motion.vehicles[a], motion.vehicles[b]
    centre, heading = motion.position, motion.heading
    nearest = np.minimum(
        _corner_distance(centre[a], heading[a], first, _corners(centre[b], heading[b], second)),
        _corner_distance(centre[b], heading[b], second, _corners(centre[a], heading[a], first)),
    )
    offset, reach, _ = _separation(motion, a, b)
    overlap = (np.abs(offset) < reach).all(axis=0)
    return np.where(overlap, 0.0, nearest)


def time_to_collision(motion: Motion, a: int, b: int) -> Floats:
    """Return the time (T,) in seconds until footprints a and b touch if both keep their velocity; inf if never.

    Source: Hayward 1972.

    Exact for footprints that do not turn: on each of the four separating axes they overlap during one interval of time,
    and they touch when all four intervals have begun and none has ended.
    """
    offset, reach, closing = _separation(motion, a, b)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        enters, leaves = (-reach - offset) / closing, (reach - offset) / closing
    still = np.abs(closing) < STILL
    apart = np.abs(offset) >= reach
    begin = np.where(still, np.where(apart, np.inf, -np.inf), np.minimum(enters, leaves)).max(axis=0)
    end = np.where(still, np.where(apart, -np.inf, np.inf), np.maximum(enters, leaves)).min(axis=0)
    return np.where((begin < end) & (end > 0.0), np.maximum(begin, 0.0), np.inf)


@once_per_object
def _separation(motion: Motion, a: int, b: int) -> tuple[Floats, Floats, Floats]:
    """Project b relative to a on the four separating axes: offset, summed half extents, closing speed; (4, T) each."""
    heading = motion.heading
    axes = np.stack([heading[a], heading[a] + np.pi / 2, heading[b], heading[b] + np.pi / 2])
    direction = np.stack([exact.cos(axes), exact.sin(axes)], axis=-1)  # (4, T, 2)
    velocity = motion.speed[..., None] * np.stack([exact.cos(heading), exact.sin(heading)], axis=-1)
    offset = ((motion.position[b] - motion.position[a]) * direction).sum(axis=-1)
    closing = ((velocity[b] - velocity[a]) * direction).sum(axis=-1)
    reach = np.zeros_like(offset)
    for vehicle, angle in ((motion.vehicles[a], heading[a]), (motion.vehicles[b], heading[b])):
        turned = axes - angle
        reach += 0.5 * vehicle.length * np.abs(exact.cos(turned)) + 0.5 * vehicle.width * np.abs(exact.sin(turned))
    return offset, reach, closing


def _corners(centre: Floats, heading: Floats, vehicle: Vehicle) -> Floats:
    """Return the corners (4, T, 2) of footprints at centres (T, 2) with headings (T,)."""
    x = 0.5 * vehicle.length * np.array([1.0, 1.0, -1.0, -1.0])[:, None]
    y = 0.5 * vehicle.width * np.array([1.0, -1.0, -1.0, 1.0])[:, None]
    c, s = exact.cos(heading), exact.sin(heading)
    return centre + np.stack([x * c - y * s, x * s + y * c], axis=-1)


def _corner_distance(centre: Floats, heading: Floats, vehicle: Vehicle, points: Floats) -> Floats:
    """Return the least distance (T,) from points (4, T, 2) to a footprint; 0 for a point inside."""
    offset = points - centre
    c, s = exact.cos(heading), exact.sin(heading)
    along = np.abs(offset[..., 0] * c + offset[..., 1] * s) - 0.5 * vehicle.length
    across = np.abs(offset[..., 1] * c - offset[..., 0] * s) - 0.5 * vehicle.width
    return np.asarray(exact.hypot(np.maximum(along, 0.0), np.maximum(across, 0.0)).min(axis=0))
