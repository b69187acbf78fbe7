# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The placement of a recording on a road: its motion there, its scale, and its room."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.fitting.config import FittingConfig
from scenario_gen.numerics import Floats, frozen
from scenario_gen.roads import footprint_fits, ground_for, nearest_pose_with_room
from scenario_gen.situation import separate, smallest_gaps, Track
from scenario_gen.types import Loss, Note, Road, Vehicle

TRIED_SCALES_RATIO = (1.0, 0.9, 1.1, 0.8, 1.2)
"""The scales that are tried, the best first."""
STANDING_SPEED_MPS = 0.3
"""A slower vehicle stands."""
_MAX_REPORTED_DISTANCE_M = 12.0  # to a pose with room
_MIN_CLEARANCE_M = 0.1  # between fitted footprints, if the recorded ones are as near
_SIDEWAYS_SHARE = 0.1  # of a shift, if moving vehicles along their lanes is not enough


@dataclass(frozen=True, eq=False)
class Placement:
    """The motion of N vehicles on the road. It has no changepoints, so its ends are independent.

    Attributes:
        tracks: paths on the road, and the progress along them at each recorded sample.
        scale: (N,) s of eq 9.
        moved: (N,) [m] by which whole paths were shifted to separate vehicles.
        notes: on decisions.
        unused: arms of the road without vehicles.
        at_home: whether it is in the recording's own frame.
    """

    tracks: tuple[Track, ...]
    scale: Floats
    moved: Floats
    notes: tuple[Note, ...]
    unused: tuple[Loss, ...] = ()
    at_home: bool = False

    @classmethod
    def of(cls, tracks: tuple[Track, ...], scale: float, notes: Iterable[Note]) -> "Placement":
        """Return the placement of tracks with one scale s of eq 9, none of them shifted."""
        scales = frozen(np.full(len(tracks), scale))
        return cls(tracks, scales, frozen(np.zeros(len(tracks))), tuple(notes))


def check_scale(scale: float, subject: str, config: FittingConfig) -> None:
    """Raise RefusedError if a scale is too far from one.

    Source: s of eq 9.
    """
    if not config.accepts(scale):
        raise RefusedError(
            f"{subject} would need scale {scale:.2f}; accepted is {config.scale_low:g} to "
            f"{config.scale_high:g} (scale shrinks gaps but not cars)"
        )


def separated(
    placement: Placement,
    config: FittingConfig,
    *,
    sideways: float,
    recorded: Sequence[Track] = (),
) -> Placement:
    """Shift vehicles that are too near to each other on this road, as little as possible.

    Args:
        placement: where they are.
        config: the clearance, and how far vehicles may be moved.
        sideways: the share of a shift that may be across a path, 0 to 1.
        recorded: the recorded tracks; if these are nearer to each other than `clearance`, so may
            the placed ones be.

    Raises:
        RefusedError: no shift up to `max_move` suffices.
    """
    clearance = config.clearance
    if recorded:
        gap = float(smallest_gaps(recorded).min())
        clearance = min(clearance, max(gap, _MIN_CLEARANCE_M))
    try:
        separation = separate(placement.tracks, clearance, config.max_move, sideways=sideways)
    except RefusedError:
        if sideways > 0.0:
            raise
        separation = separate(
            placement.tracks, clearance, config.max_move, sideways=_SIDEWAYS_SHARE
        )
    return replace(
        placement,
        tracks=separation.tracks,
        moved=placement.moved + separation.moved,
        notes=(*placement.notes, *separation.notes),
    )


def has_room(road: Road, vehicle: Vehicle, poses: Floats) -> bool:
    """Return whether a vehicle's footprint has room at all poses (M, 3)."""
    ground = ground_for(road, vehicle)
    return bool(footprint_fits(ground, poses, vehicle.length, vehicle.width).all())


def share_with_room(road: Road, track: Track, every: int = 5) -> float:
    """Return the share of a track's samples at which its footprint has room.

    Every n-th sample and the last one are looked at.
    """
    poses = np.concatenate((track.poses[:-1:every], track.poses[-1:]))
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
