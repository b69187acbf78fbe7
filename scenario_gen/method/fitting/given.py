# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Start and goal given: by the template's own frame, or by the user (eqs 7-9, put right)."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.method.fitting.config import FittingConfig
from scenario_gen.method.fitting.finish import STAND_SPEED
from scenario_gen.method.fitting.placement import (
    check_scale,
    has_room,
    max_repair,
    Placement,
    share_with_room,
)
from scenario_gen.numerics import Floats, frozen
from scenario_gen.numerics.curve import Curve
from scenario_gen.numerics.plane import place
from scenario_gen.roads import draw_route
from scenario_gen.situation import Situation, Track
from scenario_gen.types import (
    Encounter,
    Note,
    NoteKind,
    Road,
)


def place_in_own_frame(situation: Situation, road: Road, config: FittingConfig) -> Placement:
    """Leave the template where it was recorded (only pulled apart where the record has vehicles overlap).

    Raises:
        RefusedError: a sampled pose is farther than `max_move` from the nearest with room.
    """
    separation = situation.separation
    max_repair(
        [track for track in separation.tracks if share_with_room(road, track) < 1.0],
        road,
        config.max_move,
    )
    notes = (Note.of(NoteKind.AT_HOME, road=road.name), *separation.notes)
    return replace(
        Placement.of(separation.tracks, 1.0, notes), moved=separation.moved, at_home=True
    )


def share_at_home(tracks: Sequence[Track], road: Road) -> float:
    """The share of sampled footprints that have room on a road where they were recorded, 0 to 1."""
    return float(np.mean([share_with_room(road, track) for track in tracks]))


_CHORD = 2.0  # metres: a shorter one gives no direction (eq 8) and no scale (eq 9)
_SAME_PLACE = 0.5  # metres
_TURN = np.radians(50.0)  # a drawn route may turn by this much more or less than the template


def place_given(
    situation: Situation,
    road: Road,
    config: FittingConfig,
    starts: Floats | None,
    goals: Floats | None,
    base: Placement | None = None,
) -> tuple[Placement, Floats]:
    """Map every vehicle's start to the given start and its end to the given goal.

    Where a route of line, arc and line can be drawn between the two, eq 9 is taken along it (one-dimensional: the
    template's arc lengths times s); elsewhere it is the similarity of the plane. A vehicle whose chord is too short for
    that takes rotation and scale from all vehicles together (Umeyama 1991).

    With `base` a row of NaN is not given: it is as `base` has it, and a vehicle of which neither start nor goal is given
    keeps its path there. A speed that is NaN is the template's.

    Returns:
        The placement, and (N, 2, 4) the start and end states, what was missing filled in; NaN for a vehicle left to `base`.

    Raises:
        InputError: shapes disagree with the encounter, or a value is not finite.
        RefusedError: a scale is out of range, or a vehicle that waits throughout is asked to move.
    """
    encounter, tracks = situation.encounter, situation.tracks
    states = np.stack(
        (
            _states("starts", starts, encounter, 0, base),
            _states("goals", goals, encounter, -1, base),
        ),
        axis=1,
    )
    has_state = np.asarray(np.isfinite(states[..., 0]))
    ends = (
        states
        if base is None
        else np.where(has_state[..., None], states, _ends_of(base, encounter))
    )
    given = np.where(np.any(has_state, axis=1, keepdims=True)[..., None], ends, np.nan)
    joint = _joint_similarity(tracks, ends)
    rows, notes = [], []
    for n, track in enumerate(tracks):
        if base is not None and not has_state[n].any():
            rows.append((base.tracks[n], base.scale[n], base.moved[n]))
            continue
        placed, scale, how = _place(track, ends[n], joint, road, config)
        rows.append((placed, scale, 0.0))
        which = "start and goal" if has_state[n].all() else "start" if has_state[n, 0] else "goal"
        notes.append(
            Note.of(NoteKind.STATE_GIVEN, vehicle=track.vehicle.id, states=which, method=how)
        )
    on_road, scales, moves = zip(*rows, strict=True)
    notes = [*(() if base is None else base.notes), *notes]
    return Placement(on_road, frozen(scales), frozen(moves), tuple(notes)), given


def _ends_of(base: Placement, encounter: Encounter) -> Floats:
    """(N, 2, 4) start and end states of a placement."""
    poses = np.stack([track.poses[[0, -1]] for track in base.tracks])
    speed = encounter.speed[:, [0, -1]] * base.scale[:, None]
    return np.concatenate((poses, np.where(speed < STAND_SPEED, 0.0, speed)[..., None]), axis=-1)


def _states(
    name: str, given: Floats | None, encounter: Encounter, sample: int, base: Placement | None
) -> Floats:
    """(N, 4) given states; a missing speed is the template's, a row that is left to `base` is NaN."""
    n = len(encounter.vehicles)
    if given is None:
        raise InputError(f"{name} is missing; give both starts and goals, or neither")
    array = np.asarray(given, dtype=np.float64)
    if array.ndim != 2 or array.shape[0] != n or array.shape[1] not in (3, 4):
        raise InputError(
            f"{name} has shape {array.shape}; one row of x, y, yaw and optionally speed per vehicle ({n}) is needed"
        )
    left = np.isnan(array).all(axis=1) if base is not None else np.zeros(n, dtype=np.bool_)
    speed = np.where(encounter.speed[:, sample] < STAND_SPEED, 0.0, encounter.speed[:, sample])
    if array.shape[1] == 3:
        array = np.column_stack((array, speed))
    elif base is not None:
        array = np.column_stack(
            (array[:, :3], np.where(np.isnan(array[:, 3]), speed, array[:, 3]))
        )
    if not np.isfinite(array[~left]).all() or (array[~left, 3] < 0.0).any():
        raise InputError(f"{name} holds a value that is not finite, or a negative speed")
    array[left] = np.nan
    return array


def _joint_similarity(tracks: tuple[Track, ...], states: Floats) -> tuple[float, float]:
    """Rotation [rad] and scale of the least-squares similarity (det R = +1) from all starts and ends to the given ones."""
    source = np.concatenate([track.poses[[0, -1]] for track in tracks])
    target = states.reshape(-1, 4)
    u, v = source[:, :2] - source[:, :2].mean(axis=0), target[:, :2] - target[:, :2].mean(axis=0)
    if all(track.still for track in tracks) or (np.square(u)).sum() < 1e-6:
        off = target[:, 2] - source[:, 2]
        return float(np.arctan2(np.sin(off).sum(), np.cos(off).sum())), 1.0
    sine, cosine = float((u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]).sum()), float((u * v).sum())
    return float(np.arctan2(sine, cosine)), float(np.hypot(sine, cosine) / (np.square(u)).sum())


def _place(
    track: Track, ends: Floats, joint: tuple[float, float], road: Road, config: FittingConfig
) -> tuple[Track, float, str]:
    vehicle = track.vehicle
    start, goal = ends[0], ends[1]
    v = goal[:2] - start[:2]
    if track.still:
        if np.hypot(*v) > _SAME_PLACE:
            raise RefusedError(
                f"vehicle {vehicle.id} waits throughout the recording, but its start and goal are {np.hypot(*v):.1f} m apart"
            )
        ahead = start[:3] + np.array([np.cos(start[2]), np.sin(start[2]), 0.0])
        return replace(track, curve=Curve(np.array([start[:3], ahead]))), 1.0, "a wait"

    template_turn = float(track.curve.points[-1, 2] - track.curve.points[0, 2])
    route = draw_route(start[:3], goal[:3], partial(has_room, road, vehicle))
    if (
        route is not None
        and abs(float(route.points[-1, 2] - route.points[0, 2]) - template_turn) < _TURN
    ):
        scale = route.length / track.travelled
        if config.accepts(scale):
            placed = replace(
                track,
                curve=route.cut(0.0, route.length, 0.25),
                progress=frozen(scale * track.progress),
            )
            return placed, scale, f"along a drawn route (s = {scale:.2f})"
    u = (track.poses[-1] - track.poses[0])[:2]
    if np.hypot(*u) < _CHORD:
        (turn, scale), how = joint, "rotation and scale from all vehicles"
    else:
        turn = float(np.arctan2(u[0] * v[1] - u[1] * v[0], u @ v))  # eq 8a
        scale, how = float(np.hypot(*v) / np.hypot(*u)), "similarity"
    check_scale(
        scale,
        f"vehicle {vehicle.id} (recorded chord {np.hypot(*u):.1f} m, requested {np.hypot(*v):.1f} m)",
        config,
    )
    points = track.curve.points.copy()
    points[:, :2] = place(
        np.array([*start[:2], turn]), *(scale * (points[:, :2] - points[0, :2]).T)
    )  # eqs 8b, 9
    share = track.curve.station / track.curve.length
    points[:, :2] += share[:, None] * (goal[:2] - points[-1, :2])  # zero but for short chords
    curve = Curve.through(points[:, :2])
    progress = np.interp(track.progress / track.curve.length, share, curve.station)
    return (
        replace(track, curve=curve, progress=frozen(progress)),
        scale,
        f"{how} (s = {scale:.2f}, {np.degrees(turn):.0f}°)",
    )
