# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Whether placed vehicles have room on a road, and how far they are from it."""

from collections.abc import Sequence

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import Floats
from scenario_gen.roads.clearance import footprint_fits, nearest_pose_with_room
from scenario_gen.roads.vector.ground import ground_for
from scenario_gen.situation import Track
from scenario_gen.types import Road, Vehicle

_MAX_REPORTED_DISTANCE_M = 12.0  # to a pose with room


def has_room(road: Road, vehicle: Vehicle, poses: Floats) -> bool:
    """Return whether a vehicle's footprint has room at all poses (M, 3)."""
    ground = ground_for(road, vehicle)
    return bool(footprint_fits(ground, poses, vehicle.length, vehicle.width).all())


def share_with_room(road: Road, track: Track) -> float:
    """Return the share of a track's samples at which its footprint has room.

    Every fifth sample and the last one are looked at.
    """
    poses = np.concatenate((track.poses[:-1:5], track.poses[-1:]))
    vehicle = track.vehicle
    fits = footprint_fits(ground_for(road, vehicle), poses, vehicle.length, vehicle.width)
    return float(fits.mean())


def max_repair(tracks: Sequence[Track], road: Road, max_move: float) -> float:
    """Return how far [m] the worst sampled footprint is from a pose with room.

    Twice a second and both ends are looked at.

    Raises:
        RefusedError: one is farther than `max_move`; the message has every such vehicle with
            sample, place and distance, and a remedy.
    """
    farthest = 0.0
    off_road: dict[str, str] = {}
    for track in tracks:
        distance, sample = _worst_sample(track, road, max_move)
        farthest = max(farthest, distance)
        if distance > max_move:
            text = f"{distance:.1f} m"
            if distance > _MAX_REPORTED_DISTANCE_M:
                text = f"more than {_MAX_REPORTED_DISTANCE_M:g} m"
            x, y = track.poses[sample, :2]
            off_road[track.vehicle.id] = (
                f"vehicle {track.vehicle.id} is {text} from any pose with room at sample {sample} "
                f"(x {x:.1f}, y {y:.1f})"
            )
    if off_road:
        remedy = "the map is another one, or has another origin"
        if len(off_road) < len(tracks) or len(tracks) == 1:
            remedy = (
                "increase fitting.max_move, correct the map there, or leave out "
                f"{', '.join(off_road)} (log.vehicles names the others)"
            )
        raise RefusedError(
            f"on road {road.name} {'; '.join(off_road.values())}; fitting.max_move accepts "
            f"{max_move:g} m; {remedy}"
        )
    return farthest


def _worst_sample(track: Track, road: Road, max_move: float) -> tuple[float, int]:
    """Return the largest distance [m] of a footprint from a pose with room, and its sample.

    It is infinite beyond `_MAX_REPORTED_DISTANCE_M`.
    """
    vehicle, poses = track.vehicle, track.poses
    ground = ground_for(road, vehicle)
    first, last = track.present.tolist()
    worst, worst_sample = 0.0, first
    for sample in sorted({first, last, *range(first, last + 1, 5)}):
        distance = np.inf
        for reach in (max_move, _MAX_REPORTED_DISTANCE_M):
            nearest = nearest_pose_with_room(
                ground, poses[sample], vehicle.length, vehicle.width, reach
            )
            if nearest is not None:
                distance = nearest[1]
                break
        if distance > worst:
            worst, worst_sample = distance, sample
        if worst > _MAX_REPORTED_DISTANCE_M:
            break
    return worst, worst_sample
