# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A template along one road, in path coordinates: a reference line, and every vehicle's station, offset and lanes.

Vehicles that follow, meet or pass each other on one road, however it winds, are compared on *one* line. So the gaps
between them survive when the line is laid out straight.
"""

from dataclasses import dataclass, replace

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import Bools, Floats, frozen, frozen_ints, Ints, wrap_angle
from scenario_gen.numerics.curve import Curve
from scenario_gen.situation.manoeuvre import turn_of
from scenario_gen.situation.tracks import smoothing_spline, Track

_ALONG = np.radians(50.0)  # a vehicle along the road is never turned from it by more
_SAME_LANE = 1.75  # metres of offset within which two vehicles may share a lane
_LANE_CHANGE = 2.1  # metres of offset between start and end that make a lane change
_LINE_WAVELENGTH = 20.0  # metres: the reference line is smoothed over this wavelength
_ROAD_WAVELENGTH = 60.0  # metres: and as the line of a road over this one
_STRAIGHT = np.radians(10.0)  # a template in which nobody turns by more is one of a straight road
_STATION_WAVELENGTH = 150.0  # metres: what projection adds is smoothed over this wavelength
_MAX_SHIFT = 30.0  # metres between oncoming vehicles on the widest road
_OVERLAP = 0.5  # metres by which two footprints in one lane may overlap lengthwise in a record, which is no exacter
_SWERVE = 1.5  # metres by which a vehicle that comes back leaves its lane, at least
_MOST_BETWEEN = 4  # lanes left free between oncoming vehicles, at most


@dataclass(frozen=True, eq=False)
class FrenetTracks:
    """N tracks in the coordinates of one reference line.

    Attributes:
        line: the reference line.
        direction: (N,) +1 for vehicles that drive along it, -1 against it.
        station: (N, T) metres along the line.
        offset: (N, T) metres to the left of the line.
        lane: (N, 2) lane at the start and at the end, counted per direction from the driver's left, 0 is the leftmost.
        change: (N, T) how much of the lane change is done, 0 to 1; 0 for a vehicle that keeps its lane.
        swerve: (N, T) metres to the driver's left of its lane for a vehicle that leaves it and comes back, round another one say;
            0 for one that does not.
        lanes: lanes per direction that the template needs.
        between: (2,) lanes along and against the line that are left free between oncoming vehicles, to be as far apart as
            they are; a road that has not got them can do without.
    """

    line: Curve
    direction: Ints
    station: Floats
    offset: Floats
    lane: Ints
    change: Floats
    swerve: Floats
    lanes: int
    between: tuple[int, int] = (0, 0)

    def span(self, tracks: tuple[Track, ...]) -> tuple[float, float]:
        """The lowest and highest station [m] that a footprint reaches."""
        half = np.array([[track.vehicle.length / 2.0] for track in tracks])
        return float((self.station - half).min()), float((self.station + half).max())

    def spread(self) -> "FrenetTracks":
        """The same with the lanes between oncoming vehicles counted."""
        ahead, against = self.between
        lane = self.lane + np.where(self.direction[:, None] > 0, ahead, against)
        return replace(self, lane=frozen_ints(lane), lanes=int(lane.max()) + 1, between=(0, 0))


@dataclass(frozen=True, eq=False)
class MainLine:
    """The line of the road that a template drives along, as a road of its own would have it: straight, or with its bends.

    Attributes:
        shape: the line over the stations that the template uses, footprints included.
        station: (S,) stations of the template's reference line, ascending, and
        at: (S,) the arc lengths [m] on `shape` at them.
    """

    shape: Curve
    station: Floats
    at: Floats

    @property
    def straight(self) -> bool:
        """True if it does not bend."""
        return len(self.shape.points) == 2


def main_line(frenet: FrenetTracks, tracks: tuple[Track, ...]) -> MainLine:
    """The line along which a road for the template is drawn, and on which the template is placed again.

    It is straight where no vehicle turns by more than 10°; else the reference line without its wiggles.
    """
    low, high = frenet.span(tracks)
    if max(abs(turn_of(track)) for track in tracks) <= _STRAIGHT:
        shape = Curve(np.array([[0.0, 0.0, 0.0], [high - low, 0.0, 0.0]]))
        return MainLine(shape, frozen([low, high]), frozen([0.0, high - low]))
    line = frenet.line.cut(low, high, 1.0)
    grid, smooth = smoothing_spline(line.station, line.points[:, :2], _ROAD_WAVELENGTH)
    shape = Curve.through(smooth)
    scale = (high - low) / line.length
    return MainLine(shape, frozen(low + scale * grid), frozen(shape.station))


def to_frenet(tracks: tuple[Track, ...]) -> FrenetTracks:
    """Express tracks in path coordinates.

    Source: Frenet coordinates of traffic (Werling et al. 2010).

    Raises:
        RefusedError: a vehicle turns as at a junction, or crosses the others' road.
    """
    for track in tracks:
        if track.makes_u_turn or track.turns:
            turn = np.degrees(track.turning(30.0))
            raise RefusedError(
                f"vehicle {track.vehicle.id} turns {'left' if turn > 0 else 'right'} by {abs(turn):.0f}° within 30 m: "
                f"that is a junction's manoeuvre, not one along a road"
            )
    lines = [_reference_line(tracks, base) for base in _reference_candidates(tracks)]
    line, direction = min(lines, key=lambda pair: _cost_of_line(tracks, pair[0]))
    station, offset = (
        np.empty((len(tracks), len(tracks[0].progress))),
        np.empty((len(tracks), len(tracks[0].progress))),
    )
    for i, track in enumerate(tracks):
        poses = track.poses
        station[i], offset[i] = line.project(poses[:, :2])
        station[i] = _smoothed_station(track, station[i] * direction[i]) * direction[i]
        turned = np.abs(
            wrap_angle(
                poses[:, 2] - line.at(station[i])[:, 2] + (np.pi if direction[i] < 0 else 0.0)
            )
        )
        if turned.max() > _ALONG:
            raise RefusedError(
                f"vehicle {track.vehicle.id} lies across the others' road (turned from it by {np.degrees(turned.max()):.0f}°): "
                f"this recording needs a junction"
            )
    lane, change, swerve, lanes = _lanes(tracks, direction, station, offset)
    between = _between(direction, offset)
    return FrenetTracks(
        line, frozen_ints(direction), frozen(station), frozen(offset), frozen_ints(lane), frozen(change), frozen(swerve), lanes,
        between,
    )  # fmt: skip


def _smoothed_station(track: Track, along: Floats) -> Floats:
    """Stations that advance as the vehicle's own path does.

    What projection adds to the distance driven (bends, offsets, noise of either path) is taken only as far as it changes
    slowly; so speeds along the line are the recorded ones.
    """
    if track.still:
        return np.full_like(along, along.mean())
    grid, extra = smoothing_spline(
        track.progress, (along - track.progress)[:, None], _STATION_WAVELENGTH
    )
    return np.maximum.accumulate(track.progress + np.interp(track.progress, grid, extra[:, 0]))


def _reference_candidates(tracks: tuple[Track, ...]) -> list[int]:
    """Vehicles whose path could be the reference: long enough, the longest first."""
    order = sorted(range(len(tracks)), key=lambda i: -tracks[i].travelled)
    return [i for i in order if tracks[i].travelled >= tracks[order[0]].travelled / 2.0]


def _cost_of_line(tracks: tuple[Track, ...], line: Curve) -> tuple[int, float]:
    """How many vehicles change lanes as seen from a line, and how much the line itself turns, per metre.

    Seen from the path of a vehicle that changes lanes, all others seem to do so.
    """
    changes = 0
    for track in tracks:
        _, offset = line.project(track.poses[:: max(len(track.progress) // 20, 1), :2])
        changes += bool(abs(offset[-2:].mean() - offset[:2].mean()) > _LANE_CHANGE)
    return changes, round(float(np.abs(np.diff(line.points[:, 2])).sum() / line.length), 6)


def _reference_line(tracks: tuple[Track, ...], base: int) -> tuple[Curve, Ints]:
    """One vehicle's path, extended at both ends by the parts of the others that reach beyond it."""
    order = [
        base,
        *sorted((i for i in range(len(tracks)) if i != base), key=lambda i: -tracks[i].travelled),
    ]
    line = tracks[base].curve
    direction = np.ones(len(tracks), dtype=np.int64)
    for i in order[1:]:
        curve = tracks[i].curve
        station, _ = line.project(curve.points[:, :2])
        against = np.cos(curve.points[:, 2] - line.at(station)[:, 2]).mean() < 0.0
        direction[i] = -1 if against else 1
        if not tracks[i].still:
            line = _extended(line, curve.reversed() if against else curve)
    _, smooth = smoothing_spline(line.station, line.points[:, :2], _LINE_WAVELENGTH)
    return Curve.through(smooth), direction


def _extended(line: Curve, other: Curve) -> Curve:
    """`line`, continued by what `other` (same direction) has beyond its ends, shifted sideways to fit on."""
    station, offset = line.project(other.points[:, :2])
    after = np.flatnonzero(station > line.length + 1.0)
    before = np.flatnonzero(station < -1.0)
    pieces = [line.points[:, :2]]
    if len(after):
        pieces.append(_shifted(other, after, float(offset[after[0]])))
    if len(before):
        pieces.insert(0, _shifted(other, before, float(offset[before[-1]])))
    if len(pieces) == 1:
        return line
    joined = Curve.through(np.vstack(pieces))
    return Curve.through(joined.cut(0.0, joined.length, 2.0).points[:, :2])


def _shifted(curve: Curve, rows: Ints, offset: float) -> Floats:
    shift = (
        offset if abs(offset) < _MAX_SHIFT else 0.0
    )  # farther apart there is nothing to fit on to
    normal = np.column_stack((np.sin(curve.points[rows, 2]), -np.cos(curve.points[rows, 2])))
    return np.asarray(curve.points[rows, :2] + shift * normal)


def _lanes(
    tracks: tuple[Track, ...], direction: Ints, station: Floats, offset: Floats
) -> tuple[Ints, Floats, Floats, int]:
    """Lanes of each direction by clustering offsets, from the driver's left; lane changes, swerves, how many lanes."""
    right = -direction[:, None] * offset
    span = max(offset.shape[1] // 10, 1)
    ends = np.column_stack((right[:, :span].mean(axis=1), right[:, -span:].mean(axis=1)))
    changes = np.abs(ends[:, 1] - ends[:, 0]) > _LANE_CHANGE
    into = _into_oncoming(direction, -direction[:, None] * ends) & changes[:, None]
    ends = np.where(
        into, ends[:, ::-1], ends
    )  # who ends in the oncoming lane has not changed to a lane of its own direction
    changes &= ~into.any(axis=1)
    swerve = (
        ends[:, :1] + (ends[:, 1:] - ends[:, :1]) * np.linspace(0.0, 1.0, offset.shape[1]) - right
    )
    swerve[changes | (np.abs(swerve).max(axis=1) < _SWERVE)] = 0.0
    swerves = swerve.any(axis=1)
    ends[~changes & swerves] = ends[~changes & swerves].mean(axis=1)[:, None]
    ends[~changes & ~swerves] = right[~changes & ~swerves].mean(axis=1)[:, None]
    change = np.zeros_like(offset)
    for i in np.flatnonzero(changes):
        done = np.clip((right[i] - ends[i, 0]) / (ends[i, 1] - ends[i, 0]), 0.0, 1.0)
        change[i] = np.maximum.accumulate(done)
    there = np.stack(
        (change < 0.5, (change >= 0.5) | ~changes[:, None]), axis=1
    )  # when each is in its first, in its last lane
    there &= (
        np.stack([track.is_present for track in tracks])[:, None]
        & (np.abs(swerve) < _SWERVE / 2.0)[:, None]
    )
    lane = np.zeros((len(tracks), 2), dtype=np.int64)
    for sign in (1, -1):
        members = np.flatnonzero(direction == sign)
        slots = sorted(
            (float(ends[i, k]), int(i), k) for i in members for k in (0, 1) if k == 0 or changes[i]
        )
        current = 0
        values: list[float] = []
        held: list[tuple[int, int]] = []
        for value, j, k in slots:
            apart = bool(values) and value - float(np.mean(values)) > _SAME_LANE
            if apart or any(
                _beside(
                    tracks,
                    station,
                    j,
                    other,
                    there[j, k] & there[other, m],
                    passing=bool(swerves[j] or swerves[other]),
                )
                for other, m in held
                if other != j
            ):
                current += max(1, round((value - float(np.mean(values))) / (2.0 * _SAME_LANE)))
                values, held = [], []
            values.append(value)
            held.append((j, k))
            lane[j, k] = current
            if not changes[j]:
                lane[j, 1] = current
    return lane, change, swerve, int(lane.max()) + 1


def _into_oncoming(direction: Ints, ends: Floats) -> Bools:
    """(N, 2) whether a vehicle starts or ends at an offset (N, 2) [m] at which one of the other direction drives."""
    oncoming = direction[:, None] != direction
    kept = np.abs(ends[:, 1] - ends[:, 0]) < _SAME_LANE
    near = np.abs(ends[:, :, None] - ends.mean(axis=1)) < _SAME_LANE
    return np.asarray((near & (oncoming & kept)[:, None, :]).any(axis=2))


def _between(direction: Ints, offset: Floats) -> tuple[int, int]:
    """Lanes along and against the line by which oncoming vehicles are farther apart than neighbouring lanes are."""
    aside = offset.mean(axis=1)
    if (direction > 0).all() or (direction < 0).all():
        return 0, 0
    apart = float(
        aside[direction < 0].min() - aside[direction > 0].max()
    )  # of those nearest to the middle
    free = min(max(round(apart / (2.0 * _SAME_LANE)) - 1, 0), _MOST_BETWEEN)
    return (free + 1) // 2, free // 2


def _beside(
    tracks: tuple[Track, ...], station: Floats, i: int, j: int, when: Bools, *, passing: bool
) -> bool:
    """True if the two are ever side by side at these samples (T,), so that they cannot share a lane; nor if one gets past.

    With `passing` one leaves the lane to get past.
    """
    if not when.any():
        return False
    reach = (tracks[i].vehicle.length + tracks[j].vehicle.length) / 2.0 - _OVERLAP
    ahead = (station[i] - station[j])[when]
    return bool(
        (np.abs(ahead) < reach).any() or (not passing and np.sign(ahead[0]) != np.sign(ahead[-1]))
    )
