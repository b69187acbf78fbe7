# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Placements of a recording on a road: by similarity, scale, motion and room."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.fitting.config import FittingConfig
from scenario_gen.numerics import Bools, Floats, frozen, place
from scenario_gen.numerics.curve import Curve
from scenario_gen.roads import draw_route, has_room, max_repair, share_with_room
from scenario_gen.situation import Separation, Situation, Track
from scenario_gen.types import Encounter, Loss, Note, NoteKind, Road

STANDING_SPEED_MPS = 0.3
"""A slower vehicle stands."""


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

    @classmethod
    def separated(cls, separation: Separation, scale: float, notes: Iterable[Note]) -> "Placement":
        """Return the placement of tracks that were shifted apart."""
        placed = cls.of(separation.tracks, scale, (*notes, *separation.notes))
        return replace(placed, moved=separation.moved)


_MIN_CHORD_M = 2.0  # a shorter one has no direction (eq 8) and no scale (eq 9)
_MAX_WAITING_MOVE_M = 0.5  # between start and goal of a vehicle that waits throughout
_MAX_TURN_ERROR_RAD = np.radians(50.0)  # of a drawn route


def place_in_own_frame(situation: Situation, road: Road, config: FittingConfig) -> Placement:
    """Return the recording where it was recorded; vehicles that overlap are separated.

    Raises:
        RefusedError: a sampled pose is farther than `max_move` from the nearest one with room.
    """
    separation = situation.separation
    off_road = [track for track in separation.tracks if share_with_room(road, track) < 1.0]
    max_repair(off_road, road, config.max_move)
    notes = [Note.of(NoteKind.AT_HOME, road=road.name)]
    return replace(Placement.separated(separation, 1.0, notes), at_home=True)


def place_given(
    situation: Situation,
    road: Road,
    config: FittingConfig,
    starts: Floats,
    goals: Floats,
    base: Placement | None = None,
) -> tuple[Placement, Floats]:
    """Map every vehicle's start to the given start, and its end to the given goal.

    If a route of line, arc and line can be drawn between the two, eq 9 applies along it: the
    recorded arc lengths times s. Otherwise it is the similarity of the plane. A vehicle with too
    short a chord is turned as its start is, with s = 1.

    Args:
        situation: of the recording.
        road: the target.
        config: which scales are accepted.
        starts: (N, 4) x, y [m], yaw [rad], speed [m/s]; a speed that is NaN is the recorded one.
        goals: the same for the end.
        base: another placement. With it, a row of NaN means the state there; a vehicle without a
            given state keeps its path there.

    Returns:
        The placement, and (N, 2, 4) the start and end states; NaN for vehicles as in `base`.

    Raises:
        RefusedError: a scale is out of range, or a vehicle that waits throughout is asked to move.
    """
    encounter, tracks = situation.encounter, situation.tracks
    ends = np.stack((starts, goals), axis=1)
    is_given: Bools = np.isfinite(ends[..., 0])
    ends[..., 3] = np.where(np.isnan(ends[..., 3]), end_speeds(encounter), ends[..., 3])
    if base is not None:
        poses = np.stack([track.poses[[0, -1]] for track in base.tracks])
        speed = end_speeds(encounter, base.scale[:, None])
        base_ends = np.concatenate((poses, speed[..., None]), axis=-1)
        ends = np.where(is_given[..., None], ends, base_ends)
    placed: list[Track] = []
    scale, moved = np.ones(len(tracks)), np.zeros(len(tracks))
    notes = [] if base is None else list(base.notes)
    for n, track in enumerate(tracks):
        if base is not None and not is_given[n].any():
            placed.append(base.tracks[n])
            scale[n], moved[n] = base.scale[n], base.moved[n]
            continue
        placed_track, scale[n], method = _placed(track, ends[n], road, config)
        placed.append(placed_track)
        notes.append(_note(track, is_given[n], method))
    given = np.where(np.any(is_given, axis=1, keepdims=True)[..., None], ends, np.nan)
    return Placement(tuple(placed), frozen(scale), frozen(moved), tuple(notes)), given


def _note(track: Track, is_given: Bools, method: str) -> Note:
    names = [name for name, given in zip(("start", "goal"), is_given, strict=True) if given]
    states = " and ".join(names)
    return Note.of(NoteKind.STATE_GIVEN, vehicle=track.vehicle.id, states=states, method=method)


def end_speeds(encounter: Encounter, scale: Floats | float = 1.0) -> Floats:
    """Return the scaled speeds (N, 2) [m/s] at both ends; 0 for vehicles that stand."""
    speed = encounter.speed[:, [0, -1]] * scale
    return np.where(speed < STANDING_SPEED_MPS, 0.0, speed)


def _placed(
    track: Track, ends: Floats, road: Road, config: FittingConfig
) -> tuple[Track, float, str]:
    """Return the track from a start to a goal, (2, 4) states, its scale, and the method."""
    if track.still:
        return _placed_wait(track, ends), 1.0, "a wait"
    route = draw_route(ends[0, :3], ends[1, :3], partial(has_room, road, track.vehicle))
    recorded_turn = track.curve.points[-1, 2] - track.curve.points[0, 2]
    if route is not None:
        turn = route.points[-1, 2] - route.points[0, 2]
        scale = route.length / track.travelled
        if abs(turn - recorded_turn) < _MAX_TURN_ERROR_RAD and config.accepts(scale):
            curve = route.cut(0.0, route.length, 0.25)
            on_route = replace(track, curve=curve, progress=frozen(scale * track.progress))
            return on_route, scale, f"along a drawn route (s = {scale:.2f})"
    return _placed_by_similarity(track, ends, config)


def _placed_wait(track: Track, ends: Floats) -> Track:
    """Return the track of a vehicle that waits throughout at a start.

    Raises:
        RefusedError: its goal is elsewhere.
    """
    start, goal = ends
    distance = float(np.hypot(*(goal[:2] - start[:2])))
    if distance > _MAX_WAITING_MOVE_M:
        raise RefusedError(
            f"vehicle {track.vehicle.id} waits throughout the recording, but its start and goal "
            f"are {distance:.1f} m from each other"
        )
    ahead = start[:3] + np.array([np.cos(start[2]), np.sin(start[2]), 0.0])
    return replace(track, curve=Curve(np.array([start[:3], ahead])))


def _placed_by_similarity(
    track: Track, ends: Floats, config: FittingConfig
) -> tuple[Track, float, str]:
    """Return the track by a similarity of the plane, its scale, and the method.

    Source: eq 8a with the sign of the angle, eqs 8b and 9; q = s R (p - p_start) + q_start.

    Raises:
        RefusedError: the scale is out of range.
    """
    start, goal = ends[:, :2]
    chord, wanted = (track.poses[-1] - track.poses[0])[:2], goal - start
    recorded, requested = float(np.hypot(*chord)), float(np.hypot(*wanted))
    method, scale, rotation = "turned as its start", 1.0, ends[0, 2] - track.poses[0, 2]
    if recorded >= _MIN_CHORD_M:
        method, scale = "similarity", requested / recorded
        rotation = np.arctan2(chord[0] * wanted[1] - chord[1] * wanted[0], chord @ wanted)
    subject = (
        f"vehicle {track.vehicle.id} (recorded chord {recorded:.1f} m, requested "
        f"{requested:.1f} m)"
    )
    if not config.accepts(scale):
        raise RefusedError(
            f"{subject} would need scale {scale:.2f}; accepted is {config.scale_low:g} to "
            f"{config.scale_high:g} (scale shrinks gaps but not cars)"
        )
    points = track.curve.points[:, :2]
    points = place(np.array([*start, rotation]), *(scale * (points - points[0])).T)
    share = track.curve.station / track.curve.length
    points += share[:, None] * (goal - points[-1])  # not zero for short chords only
    curve = Curve.through(points)
    progress = np.interp(track.progress / track.curve.length, share, curve.station)
    moved = replace(track, curve=curve, progress=frozen(progress))
    return moved, scale, f"{method} (s = {scale:.2f}, {np.degrees(rotation):.0f}°)"
