# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The template on its own ground, pulled apart where a record (or a road) has vehicles too close."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import Floats, frozen
from scenario_gen.numerics.boxes import footprint_gaps
from scenario_gen.numerics.curve import Curve
from scenario_gen.numerics.plane import ahead_and_left
from scenario_gen.situation.tracks import Track
from scenario_gen.types import (
    Encounter,
    Note,
    NoteKind,
    together,
)

_ROUNDS = 400
_ALONG = 0.3  # how readily a vehicle is set forward or back on its path


@dataclass(frozen=True, eq=False)
class Separation:
    """Tracks that keep their distance.

    Attributes:
        tracks: N tracks.
        moved: (N,) metres each was shifted, 0 where it was left alone.
        notes: one per shifted vehicle.
    """

    tracks: tuple[Track, ...]
    moved: Floats
    notes: tuple[Note, ...]


def smallest_gaps(tracks: Sequence[Track]) -> Floats:
    """(N, N) smallest gap [m] of each pair over the whole time; infinite on the diagonal."""
    gaps = np.full((len(tracks), len(tracks)), np.inf)
    poses = [track.poses for track in tracks]
    for i in range(len(tracks)):
        for j in range(i):
            gaps[i, j] = gaps[j, i] = _least_gap(tracks, poses, i, j).size
    return gaps


def separate(
    tracks: Sequence[Track], clearance: float, max_shift: float, *, sideways: float = 1.0
) -> Separation:
    """Shift whole paths so that footprints stay `clearance` [m] apart at all times.

    Pairs that are too close are corrected in turn at their worst instant, along the axis on which they overlap least, shared
    between both vehicles; one shift per vehicle serves the whole time.

    Args:
        tracks: N tracks on one clock.
        clearance: metres.
        max_shift: metres beyond which it is refused.
        sideways: how readily a path is shifted across itself (0: never), where setting forward or back counts `_ALONG`.

    Raises:
        RefusedError: no shift up to `max_shift` does it.
    """
    n = len(tracks)
    shift = np.zeros((n, 2))  # along, sideways
    base = [track.poses for track in tracks]
    poses = list(base)
    ease = np.array([_ALONG, sideways])
    pairs = _near_pairs(tracks, base, clearance + 2.0 * max_shift)
    known: dict[tuple[int, int], _Gap] = {}
    for _ in range(_ROUNDS):
        known |= {pair: _least_gap(tracks, poses, *pair) for pair in pairs if pair not in known}
        worst = min(
            known.values(), key=lambda gap: gap.size, default=_Gap(np.inf, (0, 0), 0, np.zeros(2))
        )
        if worst.size >= clearance - 1e-3:
            break
        i, j = worst.pair
        levers = np.array(
            [
                ahead_and_left(axis, poses[k][worst.sample, 2])
                for k, axis in ((i, worst.axis), (j, -worst.axis))
            ]
        )
        power = (ease * np.square(levers)).sum()
        if power >= 1e-6:
            shift[[i, j]] += (clearance - worst.size) / power * ease * levers
        if power < 1e-6 or np.hypot(*shift.T).max() > max_shift:
            raise RefusedError(_too_close(tracks, worst, clearance, max_shift))
        for k in (i, j):
            poses[k] = _place(tracks[k], shift[k]).poses
        known = {pair: gap for pair, gap in known.items() if i not in pair and j not in pair}
    else:
        raise RefusedError(_too_close(tracks, worst, clearance, max_shift))
    moved = np.hypot(*shift.T)
    before = smallest_gaps(tracks).min(axis=1)
    notes = tuple(
        Note.of(
            NoteKind.SEPARATED,
            vehicle=tracks[k].vehicle.id,
            gap=before[k],
            sideways=abs(shift[k, 1]),
            side="left" if shift[k, 1] > 0.0 else "right",
            along=abs(shift[k, 0]),
            direction="forward" if shift[k, 0] > 0.0 else "back",
        )
        for k in range(n)
        if moved[k] > 1e-3
    )
    return Separation(tuple(_place(tracks[k], shift[k]) for k in range(n)), frozen(moved), notes)


def _near_pairs(
    tracks: Sequence[Track], poses: Sequence[Floats], room: float
) -> list[tuple[int, int]]:
    """Pairs (i, j), j < i, that are there together, and whose footprints come within `room` [m] of each other at most."""
    diagonal = [float(np.hypot(track.vehicle.length, track.vehicle.width)) for track in tracks]
    pairs = []
    for i in range(len(tracks)):
        for j in range(i):
            both = tracks[i].there & tracks[j].there
            reach = (diagonal[i] + diagonal[j]) / 2.0
            if both.any() and np.hypot(*(poses[i] - poses[j])[both, :2].T).min() < room + reach:
                pairs.append((i, j))
    return pairs


class _Gap(NamedTuple):
    """The least gap [m] of a pair of vehicles while both are there, the sample of it, and the axis (2,) from the second one."""

    size: float
    pair: tuple[int, int]
    sample: int
    axis: Floats


def _least_gap(tracks: Sequence[Track], poses: Sequence[Floats], i: int, j: int) -> _Gap:
    gap, axis = footprint_gaps(tracks[i].vehicle.half, poses[i], tracks[j].vehicle.half, poses[j])
    gap = np.where(tracks[i].there & tracks[j].there, gap, np.inf)
    at = int(np.argmin(gap))
    return _Gap(float(gap[at]), (i, j), at, axis[at])


def _place(track: Track, shift: Floats) -> Track:
    """`track` set forward by shift[0] and to the left by shift[1] metres."""
    if not shift.any():
        return track
    curve, progress = track.curve, track.progress
    if abs(shift[0]) > 0.0:
        step = 1.0 if track.still else 0.5
        curve = curve.cut(shift[0], shift[0] + max(curve.length, step), step)
    if abs(shift[1]) > 0.0:
        beside = Curve(curve.beside(curve.station, shift[1]))
        progress = np.interp(progress, curve.station, beside.station)
        curve = beside
    return replace(track, curve=curve, progress=frozen(progress))


def _too_close(tracks: Sequence[Track], gap: _Gap, clearance: float, max_shift: float) -> str:
    first, second = (tracks[k].vehicle.id for k in gap.pair)
    how = (
        f"overlap by {-gap.size:.2f} m"
        if gap.size < 0.0
        else f"come within {gap.size:.2f} m of each other"
    )
    return (
        f"vehicles {first} and {second} {how} and cannot be kept {clearance:.2f} m apart by shifting their paths up to "
        f"{max_shift:.1f} m"
    )


OWN_CLEARANCE = 0.5  # metres between footprints
OWN_MAX_SHIFT = 3.0


def separate_recorded(tracks: Sequence[Track]) -> Separation:
    """Separate the cleaned tracks of a recording where its vehicles overlap.

    Raises:
        RefusedError: they overlap so far that shifts of up to 3 m do not separate them.
    """
    separation = separate(tracks, OWN_CLEARANCE, OWN_MAX_SHIFT)
    notes = [
        Note.of(NoteKind.SMOOTHED, vehicle=track.vehicle.id, distance=track.deviation)
        for track in tracks
        if track.deviation > 1.0
    ]
    return replace(separation, notes=(*notes, *separation.notes))


def least_gaps(encounter: Encounter) -> Floats:
    """Return the least gap (N,) [m] of each vehicle to any other, negative if they overlap; inf if it is never beside one."""
    poses = np.concatenate([encounter.position, encounter.heading[..., None]], axis=-1)
    half, least = [vehicle.half for vehicle in encounter.vehicles], np.full(len(poses), np.inf)
    for a, b in combinations(range(len(poses)), 2):
        common = together(encounter.present, a, b)
        if common.stop > common.start:
            gap, _ = footprint_gaps(half[a], poses[a, common], half[b], poses[b, common])
            least[[a, b]] = np.minimum(least[[a, b]], float(gap.min()))
    return frozen(least)
