# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Separation of vehicles that are too close to each other in a recording or on a road."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import ahead_and_left, Floats, frozen
from scenario_gen.numerics.boxes import footprint_gaps
from scenario_gen.numerics.curve import Curve
from scenario_gen.situation.tracks import Track
from scenario_gen.types import Encounter, Note, NoteKind, together

LENGTHWISE_WEIGHT = 0.3  # how readily a vehicle is moved along its path
GAP_TOLERANCE_M = 1e-3
MIN_MOBILITY_RATIO = 1e-6  # below it, no allowed shift widens a gap
RECORDED_CLEARANCE_M = 0.5  # between footprints
RECORDED_MAX_SHIFT_M = 3.0
REPORTED_SMOOTHING_M = 1.0


@dataclass(frozen=True, eq=False)
class Separation:
    """Tracks that keep their distance.

    Attributes:
        tracks: N tracks.
        moved: (N,) metres by which each was shifted.
        notes: one per shifted vehicle.
    """

    tracks: tuple[Track, ...]
    moved: Floats
    notes: tuple[Note, ...]


class _Gap(NamedTuple):
    """The least gap [m] of a pair, its sample, and the axis (2,) from the second to the first."""

    size: float
    pair: tuple[int, int]
    sample: int
    axis: Floats


def smallest_gaps(tracks: Sequence[Track]) -> Floats:
    """(N, N) smallest gap [m] of each pair; infinite on the diagonal."""
    gaps = np.full((len(tracks), len(tracks)), np.inf)
    poses = [track.poses for track in tracks]
    for i, j in combinations(range(len(tracks)), 2):
        gaps[i, j] = gaps[j, i] = _least_gap(tracks, poses, (j, i)).size
    return gaps


def separate(
    tracks: Sequence[Track], clearance: float, max_shift: float, *, sideways: float = 1.0
) -> Separation:
    """Shift whole paths so that footprints are always at least `clearance` [m] apart.

    Pairs that are too close are corrected in turn at their worst instant, along the axis on which
    they overlap least, shared by both vehicles. A shift applies to the whole time.

    Args:
        tracks: N tracks on one clock.
        clearance: metres.
        max_shift: metres; larger shifts are refused.
        sideways: how readily a path is shifted across itself (0: never); along itself it is 0.3.

    Raises:
        RefusedError: no shift up to `max_shift` suffices.
    """
    mobility = np.array([LENGTHWISE_WEIGHT, sideways])
    shift = np.zeros((len(tracks), 2))  # along, to the left
    recorded = [track.poses for track in tracks]
    poses = list(recorded)
    pairs = _near_pairs(tracks, recorded, clearance + 2.0 * max_shift)
    gaps: dict[tuple[int, int], _Gap] = {}
    for _ in range(400):
        changed = [pair for pair in pairs if pair not in gaps]
        gaps |= {pair: _least_gap(tracks, poses, pair) for pair in changed}
        worst = min(gaps.values(), key=lambda gap: gap.size, default=None)
        if worst is None or worst.size >= clearance - GAP_TOLERANCE_M:
            return _separation(tracks, shift)
        fault = _too_close(tracks, worst, clearance, max_shift)
        change = _correction(worst, poses, clearance, mobility)
        if change is None:
            break
        shift[list(worst.pair)] += change
        if np.hypot(*shift.T).max() > max_shift:
            break
        poses = _with_shifted(tracks, poses, shift, worst.pair)
        gaps = _without_pair(gaps, worst.pair)
    raise RefusedError(fault)


def _separation(tracks: Sequence[Track], shift: Floats) -> Separation:
    """Return the shifted tracks, with their distances and notes."""
    placed = tuple(_shifted(track, shift[k]) for k, track in enumerate(tracks))
    return Separation(placed, frozen(np.hypot(*shift.T)), _shift_notes(tracks, shift))


def _with_shifted(
    tracks: Sequence[Track], poses: Sequence[Floats], shift: Floats, pair: tuple[int, int]
) -> list[Floats]:
    """Return all poses, newly computed for two shifted tracks."""
    return [
        _shifted(track, shift[k]).poses if k in pair else poses[k]
        for k, track in enumerate(tracks)
    ]


def _without_pair(
    gaps: Mapping[tuple[int, int], _Gap], moved: tuple[int, int]
) -> dict[tuple[int, int], _Gap]:
    """Return the gaps that do not change when two vehicles are moved."""
    return {pair: gap for pair, gap in gaps.items() if not set(pair) & set(moved)}


def separate_recorded(tracks: Sequence[Track]) -> Separation:
    """Separate the cleaned tracks of a recording where its vehicles overlap.

    Raises:
        RefusedError: shifts of up to 3 m do not separate them.
    """
    separation = separate(tracks, RECORDED_CLEARANCE_M, RECORDED_MAX_SHIFT_M)
    notes = [
        Note.of(NoteKind.SMOOTHED, vehicle=track.vehicle.id, distance=track.deviation)
        for track in tracks
        if track.deviation > REPORTED_SMOOTHING_M
    ]
    return replace(separation, notes=(*notes, *separation.notes))


def least_gaps(encounter: Encounter) -> Floats:
    """Return the least gap (N,) [m] of each vehicle to any other.

    It is negative if they overlap, and inf if no other vehicle is present together with it.
    """
    poses, vehicles = encounter.poses, encounter.vehicles
    least = np.full(len(vehicles), np.inf)
    for a, b in combinations(range(len(vehicles)), 2):
        common = together(encounter.present, a, b)
        if common.stop > common.start:
            gap, _ = footprint_gaps(
                vehicles[a].half, poses[a, common], vehicles[b].half, poses[b, common]
            )
            least[[a, b]] = np.minimum(least[[a, b]], float(gap.min()))
    return frozen(least)


def _near_pairs(
    tracks: Sequence[Track], poses: Sequence[Floats], room: float
) -> list[tuple[int, int]]:
    """Pairs (i, j), j < i, whose footprints may come within `room` [m] of each other."""
    diagonal = [float(np.hypot(track.vehicle.length, track.vehicle.width)) for track in tracks]
    pairs = []
    for i in range(len(tracks)):
        for j in range(i):
            both = tracks[i].is_present & tracks[j].is_present
            reach = (diagonal[i] + diagonal[j]) / 2.0
            if both.any() and np.hypot(*(poses[i] - poses[j])[both, :2].T).min() < room + reach:
                pairs.append((i, j))
    return pairs


def _least_gap(tracks: Sequence[Track], poses: Sequence[Floats], pair: tuple[int, int]) -> _Gap:
    i, j = pair
    gap, axis = footprint_gaps(tracks[i].vehicle.half, poses[i], tracks[j].vehicle.half, poses[j])
    gap = np.where(tracks[i].is_present & tracks[j].is_present, gap, np.inf)
    sample = int(np.argmin(gap))
    return _Gap(float(gap[sample]), pair, sample, axis[sample])


def _correction(
    gap: _Gap, poses: Sequence[Floats], clearance: float, mobility: Floats
) -> Floats | None:
    """The shift (2, 2) of a pair along and across its paths that widens a gap, or None."""
    i, j = gap.pair
    levers = np.array(
        [
            ahead_and_left(axis, poses[k][gap.sample, 2])
            for k, axis in ((i, gap.axis), (j, -gap.axis))
        ]
    )
    power = (mobility * np.square(levers)).sum()
    if power < MIN_MOBILITY_RATIO:
        return None
    return np.asarray((clearance - gap.size) / power * mobility * levers)


def _shifted(track: Track, shift: Floats) -> Track:
    """Return a track that is moved forward by shift[0] and to the left by shift[1] [m]."""
    if not shift.any():
        return track
    curve, progress = track.curve, track.progress
    if abs(shift[0]) > 0.0:
        step = 1.0 if track.still else 0.5
        lane = track.lane or curve
        start = float(lane.project(curve.points[:1, :2])[0][0]) + shift[0]
        curve = lane.cut(start, start + max(curve.length, step), step)
    if abs(shift[1]) > 0.0:
        parallel = Curve(curve.at_offset(curve.station, shift[1]))
        progress = np.interp(progress, curve.station, parallel.station)
        curve = parallel
    return replace(track, curve=curve, progress=frozen(progress))


def _shift_notes(tracks: Sequence[Track], shift: Floats) -> tuple[Note, ...]:
    """Return one note per shifted vehicle."""
    before = smallest_gaps(tracks).min(axis=1)
    return tuple(
        Note.of(
            NoteKind.SEPARATED,
            vehicle=track.vehicle.id,
            gap=before[k],
            sideways=abs(shift[k, 1]),
            side="left" if shift[k, 1] > 0.0 else "right",
            along=abs(shift[k, 0]),
            direction="forward" if shift[k, 0] > 0.0 else "back",
        )
        for k, track in enumerate(tracks)
        if np.hypot(*shift[k]) > GAP_TOLERANCE_M
    )


def _too_close(tracks: Sequence[Track], gap: _Gap, clearance: float, max_shift: float) -> str:
    first, second = (tracks[k].vehicle.id for k in gap.pair)
    fault = f"come within {gap.size:.2f} m of each other"
    if gap.size < 0.0:
        fault = f"overlap by {-gap.size:.2f} m"
    return (
        f"vehicles {first} and {second} {fault}; shifting their paths by up to {max_shift:.1f} m"
        f" does not separate them by {clearance:.2f} m"
    )
