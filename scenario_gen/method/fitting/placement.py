# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A placement of a template on a road: its motion there, its scale, and whether all have room."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.fitting.config import FittingConfig
from scenario_gen.numerics import Floats, frozen
from scenario_gen.roads import footprint_fits, ground_for, nearest_pose_with_room
from scenario_gen.situation import separate, smallest_gaps, Track
from scenario_gen.types import Loss, Note, Road, Vehicle

SCALES = (1.0, 0.9, 1.1, 0.8, 1.2)  # that are tried, the best first
_LOOKED = 12.0  # metres within which a pose with room is looked for, to say how far it is
_LEAST_CLEARANCE = 0.1  # metres between fitted footprints, where the template's own are as near
_RELUCTANTLY = 0.1  # how readily a vehicle leaves the middle of its lane, where setting it forward or back does not do


@dataclass(frozen=True, eq=False)
class Placement:
    """N vehicles' motion on the road. It knows nothing of changepoints, so the ends do not depend on them.

    Attributes:
        tracks: paths on the road, and the progress along them at each of the template's samples.
        scale: (N,) s of eq 9.
        moved: (N,) metres by which whole paths were shifted to keep vehicles apart.
        notes: what was decided.
        unused: arms of the road that nobody uses.
        at_home: the template is in its own frame, on the road that it was recorded on.
    """

    tracks: tuple[Track, ...]
    scale: Floats
    moved: Floats
    notes: tuple[Note, ...]
    unused: tuple[Loss, ...] = ()
    at_home: bool = False

    @classmethod
    def of(cls, tracks: tuple[Track, ...], scale: float, notes: Iterable[Note]) -> "Placement":
        """Return the placement of tracks on the road that all have one scale s of eq 9, none of them shifted."""
        return cls(
            tracks,
            frozen(np.full(len(tracks), scale)),
            frozen(np.zeros(len(tracks))),
            tuple(notes),
        )


def check_scale(scale: float, what: str, config: FittingConfig) -> None:
    """Raise RefusedError if a scale is too far from one.

    Source: s of eq 9.
    """
    if not config.accepts(scale):
        raise RefusedError(
            f"{what} would need scale {scale:.2f}; accepted is {config.scale_low:g} to {config.scale_high:g} "
            f"(scale shrinks gaps but not cars)"
        )


def separated(
    placement: Placement, config: FittingConfig, *, sideways: float, own: Sequence[Track] = ()
) -> Placement:
    """Shift vehicles that come too close on this road, as little as possible.

    Args:
        placement: where they are.
        config: how far apart they should be, and how far they may be moved.
        sideways: how readily a path is shifted across itself, 0 to 1.
        own: the template's tracks; where they are nearer to each other than `clearance`, so may these be.

    Raises:
        RefusedError: no shift up to `max_move` does it.
    """
    clearance = config.clearance
    if own:
        clearance = min(clearance, max(float(smallest_gaps(own).min()), _LEAST_CLEARANCE))
    try:
        separation = separate(placement.tracks, clearance, config.max_move, sideways=sideways)
    except RefusedError:
        if sideways > 0.0:
            raise
        separation = separate(placement.tracks, clearance, config.max_move, sideways=_RELUCTANTLY)
    return replace(
        placement,
        tracks=separation.tracks,
        moved=placement.moved + separation.moved,
        notes=(*placement.notes, *separation.notes),
    )


def has_room(road: Road, vehicle: Vehicle, poses: Floats) -> bool:
    """Whether a vehicle's footprint has room at all poses (M, 3)."""
    return bool(
        footprint_fits(ground_for(road, vehicle), poses, vehicle.length, vehicle.width).all()
    )


def share_with_room(road: Road, track: Track, every: int = 5) -> Floats:
    """Share (scalar array), 0 to 1, of the track's samples (every n-th and the last) at which its footprint has room."""
    poses = np.concatenate((track.poses[:-1:every], track.poses[-1:]))
    return np.asarray(
        footprint_fits(
            ground_for(road, track.vehicle), poses, track.vehicle.length, track.vehicle.width
        ).mean()
    )


def max_repair(tracks: Sequence[Track], road: Road, max_move: float) -> float:
    """How far [m] the worst sampled footprint (twice a second while it is there, and the ends) is from a pose with room.

    Raises:
        RefusedError: one is farther than `max_move`; the message names every such vehicle with time, place and distance, and what
            can be done.
    """
    farthest = 0.0
    astray: dict[str, str] = {}
    for track in tracks:
        first, last = track.present.tolist()
        poses, ground = track.poses, ground_for(road, track.vehicle)
        worst, at = 0.0, first
        for t in sorted({first, last, *range(first, last + 1, 5)}):
            answer = nearest_pose_with_room(
                ground, poses[t], track.vehicle.length, track.vehicle.width, max_move
            )
            if answer is None:
                answer = nearest_pose_with_room(
                    ground, poses[t], track.vehicle.length, track.vehicle.width, _LOOKED
                )
            away = np.inf if answer is None else answer[1]
            if away > worst:
                worst, at = away, t
            if worst > _LOOKED:
                break
        farthest = max(farthest, worst)
        if worst > max_move:
            far = f"{worst:.1f} m" if worst <= _LOOKED else f"more than {_LOOKED:g} m"
            x, y = poses[at, :2]
            astray[track.vehicle.id] = (
                f"vehicle {track.vehicle.id} is {far} from any pose with room at sample {at} "
                f"(x {x:.1f}, y {y:.1f})"
            )
    if astray:
        ids = ", ".join(astray)
        remedy = (
            "the map is another one, or lies elsewhere"
            if len(astray) == len(tracks) > 1
            else f"set fitting.max_move to more, mend the map there, or leave {ids} out (log.vehicles names who is kept)"
        )
        raise RefusedError(
            f"on road {road.name} {'; '.join(astray.values())}; at most {max_move:g} m is bridged; {remedy}"
        )
    return farthest
