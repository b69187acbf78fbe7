# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""From a placement to a fit: anchors at the changepoints, repaired where they have no room, and the requested states."""

from itertools import pairwise

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.fitting.config import FittingConfig
from scenario_gen.method.fitting.kept import find_losses
from scenario_gen.method.fitting.placement import Placement
from scenario_gen.numerics import Bools, Floats, frozen_ints, Ints, runs
from scenario_gen.roads import ground_for, nearest_pose_with_room
from scenario_gen.situation import manoeuvre_of, Situation, Track, turn_of
from scenario_gen.types import (
    BoundaryStates,
    Fit,
    FittedVehicle,
    Note,
    NoteKind,
    Road,
    Segmentation,
)

_STAND_LENGTH = 0.5  # metres
_PATH_STEP = 0.5  # metres between two poses of a fitted path
STAND_SPEED = 0.3  # m/s: slower is standing


def finish(
    situation: Situation,
    segmentation: Segmentation,
    road: Road,
    placement: Placement,
    config: FittingConfig,
    given: Floats | None = None,
) -> Fit:
    """Read the anchors off a placement; `given` (N, 2, 4) are start and end states to be met exactly, if any; NaN: not given.

    Source: eq 9.

    Raises:
        RefusedError: an anchor is farther than `max_move` from the nearest pose with room.
    """
    encounter, tracks = situation.encounter, situation.tracks
    last = encounter.speed.shape[1] - 1
    index = frozen_ints(np.concatenate(([0], segmentation.changepoints, [last])))
    notes = list(placement.notes)
    fitted, states = [], []
    for i, track in enumerate(placement.tracks):
        stands = _stands(track, index)
        progress = _snapped(track, index, stands)
        anchors = track.curve.at(progress)
        ground = ground_for(road, track.vehicle)
        given_ends = np.zeros(2, dtype=np.bool_) if given is None else np.isfinite(given[i, :, 0])
        if given is not None and given_ends[0]:
            anchors[progress == progress[0]] = given[i, 0, :3]
        if given is not None and given_ends[1] and not track.still:
            anchors[progress == progress[-1]] = given[i, 1, :3]
        anchors, moved, moves = _repaired(
            ground, track, anchors, progress, [float(t) for t in index * encounter.dt], config
        )
        notes += moves
        moved = moved + placement.moved[i]
        if moved.max() > config.max_move:
            raise RefusedError(
                f"vehicle {track.vehicle.id} would be moved by {moved.max():.2f} m in all, to be clear of others and on road "
                f"{road.name}; accepted is {config.max_move:g} m"
            )
        turned = turn_of(tracks[i]), turn_of(track)
        scale = float(placement.scale[i])
        manoeuvre = "wait" if track.still else manoeuvre_of(turned[1])
        fitted.append(
            FittedVehicle(anchors, moved, stands, scale, manoeuvre, turned, _path(track))
        )
        ends = encounter.speed[i, [0, last]] * placement.scale[i]
        ends = np.where(ends < STAND_SPEED, 0.0, ends)
        if given is not None:
            ends = np.where(given_ends, given[i, :, 3], ends)
        ends = np.where(track.still, 0.0, ends)
        states.append(np.column_stack((anchors[[0, -1]], ends)))
    requested = BoundaryStates(
        start=np.stack([s[0] for s in states]), end=np.stack([s[1] for s in states])
    )
    lost = (*find_losses(tracks, placement.tracks), *placement.unused)
    return Fit(encounter.vehicles, tuple(fitted), index, requested, tuple(notes), lost)


def _path(track: Track) -> Floats:
    """(M, 3) the placed path from start to end."""
    if track.still:
        return track.curve.points[:1]
    first, last = float(track.progress[0]), float(track.progress[-1])
    return track.curve.at(
        np.linspace(first, last, max(int(np.ceil((last - first) / _PATH_STEP)), 1) + 1)
    )


def _stands(track: Track, index: Ints) -> Bools:
    """(K + 1,) primitives in which the vehicle stands: slow throughout, and hardly any path."""
    if track.still:
        return np.ones(len(index) - 1, dtype=np.bool_)
    pieces = list(pairwise(index))
    driven = np.array([track.progress[b] - track.progress[a] for a, b in pieces])
    fastest = np.array([track.speed[a : b + 1].max() for a, b in pieces])
    stands = (driven < _STAND_LENGTH) & (fastest < STAND_SPEED) | (driven < 1e-3)
    if stands.all():  # it does move, if only little by little
        stands[int(np.argmax(driven))] = False
    return np.asarray(stands)


def _snapped(track: Track, index: Ints, stands: Bools) -> Floats:
    """(K + 2,) progress at the anchors; the two ends of a dwell are one place, and start and end stay where they are."""
    progress = track.progress[index].copy()
    for first, last in runs(stands):
        progress[first : last + 1] = (
            progress[last] if last == len(stands) and first > 0 else progress[first]
        )
    return progress


def _repaired(
    road: Road,
    track: Track,
    anchors: Floats,
    progress: Floats,
    times: list[float],
    config: FittingConfig,
) -> tuple[Floats, Floats, list[Note]]:
    """Anchors (K + 2, 3), how far each was moved (K + 2,), and notes on it."""
    anchors = anchors.copy()
    moved = np.zeros(len(anchors))
    notes = []
    for k in range(len(anchors)):
        if k and progress[k] == progress[k - 1]:
            anchors[k], moved[k] = anchors[k - 1], moved[k - 1]
            continue
        vehicle = track.vehicle
        what = (
            "start"
            if k == 0
            else "end"
            if k == len(anchors) - 1
            else f"changepoint at {times[k]:.1f} s"
        )
        answer = nearest_pose_with_room(
            road, anchors[k], vehicle.length, vehicle.width, config.max_move
        )
        if answer is None:
            x, y = anchors[k, :2]
            raise RefusedError(
                f"vehicle {vehicle.id}: its {what} (x {x:.1f}, y {y:.1f}) is more than {config.max_move:g} m from the nearest "
                f"pose with room on road {road.name}"
            )
        anchors[k], moved[k] = answer
        if moved[k] > 0.0:
            notes.append(
                Note.of(NoteKind.ANCHOR_MOVED, vehicle=vehicle.id, anchor=what, distance=moved[k])
            )
    return anchors, moved, notes
