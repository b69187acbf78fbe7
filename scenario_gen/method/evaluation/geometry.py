# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Two oriented footprints, at many instants at once: their distance, and the time until they meet."""

import numpy as np

from scenario_gen.method.evaluation.motion import Motion
from scenario_gen.numerics import exact, Floats
from scenario_gen.types import once_per_object, Vehicle

STILL = 1e-6  # m/s; what closes more slowly does not close: rounding alone makes equal velocities differ


def footprint_distance(motion: Motion, a: int, b: int) -> Floats:
    """Return the distance (T,) in metres between the footprints of vehicles a and b; 0 where they overlap."""
    return _nearness(motion, a, b)[0]


def time_to_collision(motion: Motion, a: int, b: int) -> Floats:
    """Return the time (T,) in seconds until footprints a and b touch if both keep their velocity; inf if never.

    Source: Hayward 1972.
    """
    return _nearness(motion, a, b)[1]


@once_per_object
def _nearness(motion: Motion, a: int, b: int) -> tuple[Floats, Floats]:
    """Distance [m] and time to collision [s], (T,) each."""
    separation = _separation(motion, a, b)
    return _distance(motion, a, b, separation), _time_to_collision(*separation)


@once_per_object
def _directions(motion: Motion) -> Floats:
    """(N, T, 2) unit vectors along the headings."""
    return np.stack([exact.cos(motion.heading), exact.sin(motion.heading)], axis=-1)


def _distance(motion: Motion, a: int, b: int, separation: tuple[Floats, Floats, Floats]) -> Floats:
    """Two convex shapes that do not overlap are nearest at a corner of one of them."""
    first, second = motion.vehicles[a], motion.vehicles[b]
    centre, ahead = motion.position, _directions(motion)
    nearest = np.minimum(
        _corner_distance(centre[a], ahead[a], first, _corners(centre[b], ahead[b], second)),
        _corner_distance(centre[b], ahead[b], second, _corners(centre[a], ahead[a], first)),
    )
    offset, reach, _ = separation
    overlap = (np.abs(offset) < reach).all(axis=0)
    return np.where(overlap, 0.0, nearest)


def _time_to_collision(offset: Floats, reach: Floats, closing: Floats) -> Floats:
    """Return the time (T,) [s] until two footprints touch; offset, reach and closing speed as of `_separation`.

    Exact for footprints that do not turn: on each of the four separating axes they overlap during one interval of time,
    and they touch when all four intervals have begun and none has ended.
    """
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        enters, leaves = (-reach - offset) / closing, (reach - offset) / closing
    still = np.abs(closing) < STILL
    apart = np.abs(offset) >= reach
    begin = np.where(still, np.where(apart, np.inf, -np.inf), np.minimum(enters, leaves)).max(axis=0)
    end = np.where(still, np.where(apart, -np.inf, np.inf), np.maximum(enters, leaves)).min(axis=0)
    return np.where((begin < end) & (end > 0.0), np.maximum(begin, 0.0), np.inf)


def _separation(motion: Motion, a: int, b: int) -> tuple[Floats, Floats, Floats]:
    """Project b relative to a on the four separating axes, along and across a, along and across b.

    Returns:
        Offset [m], summed half extents [m] and closing speed [m/s]; (4, T) each.
    """
    ahead = _directions(motion)
    axes = np.stack([ahead[a], _left(ahead[a]), ahead[b], _left(ahead[b])])
    offset = ((motion.position[b] - motion.position[a]) * axes).sum(axis=-1)
    velocity = motion.speed[b, :, None] * ahead[b] - motion.speed[a, :, None] * ahead[a]
    closing = (velocity * axes).sum(axis=-1)
    alike, askew = (np.abs((ahead[a] * other).sum(axis=-1)) for other in (ahead[b], _left(ahead[b])))
    (la, wa), (lb, wb) = ((0.5 * vehicle.length, 0.5 * vehicle.width) for vehicle in (motion.vehicles[a], motion.vehicles[b]))
    reach = np.stack(
        [
            la + lb * alike + wb * askew,
            wa + lb * askew + wb * alike,
            lb + la * alike + wa * askew,
            wb + la * askew + wa * alike,
        ]
    )
    return offset, reach, closing


def _left(ahead: Floats) -> Floats:
    """Return vectors (..., 2) turned by 90° to the left."""
    return np.stack([-ahead[..., 1], ahead[..., 0]], axis=-1)


def _corners(centre: Floats, ahead: Floats, vehicle: Vehicle) -> Floats:
    """Return the corners (4, T, 2) of footprints at centres (T, 2) with directions (T, 2)."""
    x = 0.5 * vehicle.length * np.array([1.0, 1.0, -1.0, -1.0])[:, None, None]
    y = 0.5 * vehicle.width * np.array([1.0, -1.0, -1.0, 1.0])[:, None, None]
    return np.asarray(centre + x * ahead + y * _left(ahead))


def _corner_distance(centre: Floats, ahead: Floats, vehicle: Vehicle, points: Floats) -> Floats:
    """Return the least distance (T,) from points (4, T, 2) to a footprint; 0 for a point inside."""
    offset = points - centre
    c, s = ahead[:, 0], ahead[:, 1]
    along = np.abs(offset[..., 0] * c + offset[..., 1] * s) - 0.5 * vehicle.length
    across = np.abs(offset[..., 1] * c - offset[..., 0] * s) - 0.5 * vehicle.width
    return np.asarray(exact.hypot(np.maximum(along, 0.0), np.maximum(across, 0.0)).min(axis=0))
