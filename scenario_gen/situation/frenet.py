# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""An encounter along one road in path coordinates: a reference line, stations, offsets and lanes.

Vehicles that follow, meet or pass each other on one road are compared on one line, even if it
bends. The gaps between them are therefore preserved when the line is straightened.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import Bools, Floats, frozen, frozen_ints, Ints, wrap_angle
from scenario_gen.numerics.curve import Curve
from scenario_gen.situation.tracks import Track, turn_of, TURN_WINDOW_M
from scenario_gen.smoothing.path import smoothing_spline

MAX_ROAD_ANGLE_RAD = np.radians(50.0)  # between a vehicle and the road that it drives along
SAME_LANE_M = 1.75  # difference of offsets of vehicles in one lane
LANE_CHANGE_M = 2.1  # difference of offsets at start and end
LINE_WAVELENGTH_M = 20.0  # that the smoothing of the reference line halves
ROAD_WAVELENGTH_M = 60.0  # and that of the road that is drawn along it
STATION_WAVELENGTH_M = 150.0  # and that of the difference between station and distance driven
STRAIGHT_ROAD_RAD = np.radians(10.0)  # turn of every vehicle on a straight road
MAX_FIT_OFFSET_M = 30.0  # between oncoming vehicles on the widest road
QUEUE_OVERLAP_M = 0.5  # by which recorded footprints in one lane may overlap
MIN_SWERVE_M = 1.5  # by which a vehicle leaves its lane and returns
MAX_FREE_LANES_COUNT = 4  # between oncoming vehicles

_Slot = tuple[int, int]  # a vehicle, and 0 or 1: its first or its last lane


@dataclass(frozen=True, eq=False)
class FrenetTracks:
    """N tracks in the coordinates of one reference line.

    Attributes:
        line: the reference line.
        direction: (N,) +1 for vehicles that drive along it, -1 against it.
        station: (N, T) metres along the line.
        offset: (N, T) metres to the left of the line.
        lane: (N, 2) lane at the start and at the end, per direction; 0 is the driver's leftmost.
        change: (N, T) progress of the lane change, 0 to 1; 0 without a lane change.
        swerve: (N, T) metres to the driver's left of its lane, for a vehicle that leaves the lane
            and returns; else 0.
        lanes: lanes per direction that the encounter needs.
        between: (2,) free lanes along and against the line between oncoming vehicles; a road
            without them is possible.
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
        """Return the lowest and highest station [m] of all footprints."""
        half = np.array([[track.vehicle.rear] for track in tracks])
        return float((self.station - half).min()), float((self.station + half).max())

    def spread(self) -> "FrenetTracks":
        """Return the tracks with the lanes between oncoming vehicles counted."""
        ahead, against = self.between
        lane = self.lane + np.where(self.direction[:, None] > 0, ahead, against)
        return replace(self, lane=frozen_ints(lane), lanes=int(lane.max()) + 1, between=(0, 0))


@dataclass(frozen=True, eq=False)
class MainLine:
    """The line of a road that is drawn for an encounter: straight, or with its bends.

    Attributes:
        shape: the line over the used stations, footprints included.
        station: (S,) stations of the reference line, ascending.
        at: (S,) the arc lengths [m] on `shape` at these stations.
    """

    shape: Curve
    station: Floats
    at: Floats

    @property
    def straight(self) -> bool:
        """True if it does not bend."""
        return len(self.shape.points) == 2


def main_line(frenet: FrenetTracks, tracks: tuple[Track, ...]) -> MainLine:
    """Return the line along which a road is drawn, and on which the encounter is placed again.

    It is straight if no vehicle turns by more than 10°, else the smoothed reference line.
    """
    low, high = frenet.span(tracks)
    if max(abs(turn_of(track)) for track in tracks) <= STRAIGHT_ROAD_RAD:
        shape = Curve(np.array([[0.0, 0.0, 0.0], [high - low, 0.0, 0.0]]))
        return MainLine(shape, frozen([low, high]), frozen([0.0, high - low]))
    line = frenet.line.cut(low, high, 1.0)
    grid, smooth = smoothing_spline(line.station, line.points[:, :2], ROAD_WAVELENGTH_M)
    shape = Curve.through(smooth)
    scale = (high - low) / line.length
    return MainLine(shape, frozen(low + scale * grid), frozen(shape.station))


@lru_cache(maxsize=4)  # the road and the placing ask for the same ones
def to_frenet(tracks: tuple[Track, ...]) -> FrenetTracks:
    """Return tracks in path coordinates.

    Source: Frenet coordinates of traffic (Werling et al. 2010).

    Raises:
        RefusedError: a vehicle turns as at a junction, or crosses the road of the others.
    """
    for track in tracks:
        if track.makes_u_turn or track.turns:
            turn = np.degrees(track.turning(TURN_WINDOW_M))
            side = "left" if turn > 0 else "right"
            raise RefusedError(
                f"vehicle {track.vehicle.id} turns {side} by {abs(turn):.0f}° within"
                f" {TURN_WINDOW_M:.0f} m: this needs a junction, not one road"
            )
    lines = [_reference_line(tracks, base) for base in _reference_candidates(tracks)]
    line, direction = min(lines, key=lambda pair: _cost_of_line(tracks, pair[0]))
    station = np.empty((len(tracks), len(tracks[0].progress)))
    offset = np.empty_like(station)
    for i, track in enumerate(tracks):
        poses = track.poses
        station[i], offset[i] = line.project(poses[:, :2])
        station[i] = _smoothed_station(track, station[i] * direction[i]) * direction[i]
        along = line.at(station[i])[:, 2] + (np.pi if direction[i] < 0 else 0.0)
        turned = np.abs(wrap_angle(poses[:, 2] - along)).max()
        if turned > MAX_ROAD_ANGLE_RAD:
            raise RefusedError(
                f"vehicle {track.vehicle.id} lies across the others' road (turned from it by"
                f" {np.degrees(turned):.0f}°): this recording needs a junction"
            )
    lateral = _lateral_motion(direction, offset)
    lane = _lanes(tracks, direction, station, lateral)
    return FrenetTracks(
        line=line,
        direction=frozen_ints(direction),
        station=frozen(station),
        offset=frozen(offset),
        lane=frozen_ints(lane),
        change=frozen(lateral.change),
        swerve=frozen(lateral.swerve),
        lanes=int(lane.max()) + 1,
        between=_free_lanes(direction, offset),
    )


def _smoothed_station(track: Track, along: Floats) -> Floats:
    """Stations that advance as the vehicle's path does.

    The difference between station and distance driven (bends, offsets, noise) counts only as far
    as it changes slowly, so speeds along the line are the recorded ones.
    """
    if track.still:
        return np.full_like(along, along.mean())
    grid, extra = smoothing_spline(
        track.progress, (along - track.progress)[:, None], STATION_WAVELENGTH_M
    )
    return np.maximum.accumulate(track.progress + np.interp(track.progress, grid, extra[:, 0]))


def _reference_candidates(tracks: tuple[Track, ...]) -> list[int]:
    """Vehicles whose path is long enough to be the reference, the longest first."""
    order = sorted(range(len(tracks)), key=lambda i: -tracks[i].travelled)
    return [i for i in order if tracks[i].travelled >= tracks[order[0]].travelled / 2.0]


def _cost_of_line(tracks: tuple[Track, ...], line: Curve) -> tuple[int, float]:
    """How many vehicles change lanes relative to a line, and how much the line turns per metre.

    Relative to the path of a vehicle that changes lanes, all others seem to do so.
    """
    changes = 0
    for track in tracks:
        _, offset = line.project(track.poses[:: max(len(track.progress) // 20, 1), :2])
        changes += bool(abs(offset[-2:].mean() - offset[:2].mean()) > LANE_CHANGE_M)
    return changes, round(float(np.abs(np.diff(line.points[:, 2])).sum() / line.length), 6)


def _reference_line(tracks: tuple[Track, ...], base: int) -> tuple[Curve, Ints]:
    """One vehicle's path, extended by the paths of the others, and the directions (N,)."""
    others = [i for i in range(len(tracks)) if i != base]
    line = tracks[base].curve
    direction = np.ones(len(tracks), dtype=np.int64)
    for i in sorted(others, key=lambda i: -tracks[i].travelled):
        curve = tracks[i].curve
        station, _ = line.project(curve.points[:, :2])
        against = np.cos(curve.points[:, 2] - line.at(station)[:, 2]).mean() < 0.0
        direction[i] = -1 if against else 1
        if not tracks[i].still:
            line = _extended(line, curve.reversed() if against else curve)
    _, smooth = smoothing_spline(line.station, line.points[:, :2], LINE_WAVELENGTH_M)
    return Curve.through(smooth), direction


def _extended(line: Curve, other: Curve) -> Curve:
    """Extend a line by the parts of another curve beyond its ends, shifted sideways to fit."""
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
    shift = offset if abs(offset) < MAX_FIT_OFFSET_M else 0.0
    normal = np.column_stack((np.sin(curve.points[rows, 2]), -np.cos(curve.points[rows, 2])))
    return np.asarray(curve.points[rows, :2] + shift * normal)


class _LateralMotion(NamedTuple):
    """Lateral motion, in metres to the driver's right.

    Attributes:
        ends: (N, 2) offset of the lane at the start and at the end.
        changes: (N,) whether a vehicle changes lanes.
        change: (N, T) progress of the lane change.
        swerve: (N, T) metres to the driver's left of the lane.
    """

    ends: Floats
    changes: Bools
    change: Floats
    swerve: Floats


def _lateral_motion(direction: Ints, offset: Floats) -> _LateralMotion:
    """Separate lane changes and swerves."""
    right = -direction[:, None] * offset
    count = offset.shape[1]
    span = max(count // 10, 1)
    ends = np.column_stack((right[:, :span].mean(axis=1), right[:, -span:].mean(axis=1)))
    changes = np.abs(ends[:, 1] - ends[:, 0]) > LANE_CHANGE_M
    into = _into_oncoming(direction, -direction[:, None] * ends) & changes[:, None]
    ends = np.where(into, ends[:, ::-1], ends)  # the oncoming lane is not a lane of its own
    changes &= ~into.any(axis=1)

    line = ends[:, :1] + (ends[:, 1:] - ends[:, :1]) * np.linspace(0.0, 1.0, count)
    swerve = line - right
    swerve[changes | (np.abs(swerve).max(axis=1) < MIN_SWERVE_M)] = 0.0
    swerves = swerve.any(axis=1)
    ends[~changes & swerves] = ends[~changes & swerves].mean(axis=1)[:, None]
    ends[~changes & ~swerves] = right[~changes & ~swerves].mean(axis=1)[:, None]
    change = np.zeros_like(offset)
    for i in np.flatnonzero(changes):
        done = np.clip((right[i] - ends[i, 0]) / (ends[i, 1] - ends[i, 0]), 0.0, 1.0)
        change[i] = np.maximum.accumulate(done)
    return _LateralMotion(ends, changes, change, swerve)


def _lanes(
    tracks: tuple[Track, ...], direction: Ints, station: Floats, lateral: _LateralMotion
) -> Ints:
    """(N, 2) lanes of each direction by clustering offsets, from the driver's left."""
    in_first = lateral.change < 0.5
    in_last = (lateral.change >= 0.5) | ~lateral.changes[:, None]
    is_in_lane = np.stack((in_first, in_last), axis=1)
    is_in_lane &= np.stack([track.is_present for track in tracks])[:, None]
    is_in_lane &= (np.abs(lateral.swerve) < MIN_SWERVE_M / 2.0)[:, None]
    swerves = np.asarray(lateral.swerve.any(axis=1))

    def conflicts(slot: _Slot, other: _Slot) -> bool:
        if slot[0] == other[0]:
            return False
        rows = is_in_lane[slot] & is_in_lane[other]
        passing = bool(swerves[slot[0]] or swerves[other[0]])
        return _side_by_side(tracks, station, (slot[0], other[0]), rows, passing=passing)

    lane = np.zeros((len(tracks), 2), dtype=np.int64)
    for sign in (1, -1):
        members = np.flatnonzero(direction == sign).tolist()
        slots = [(i, k) for i in members for k in (0, 1) if k == 0 or lateral.changes[i]]
        slots.sort(key=lambda slot: (lateral.ends[slot], slot))
        numbers = _number_lanes(slots, lateral.ends, conflicts)
        for slot, number in zip(slots, numbers, strict=True):
            lane[slot] = number
            if not lateral.changes[slot[0]]:
                lane[slot[0], 1] = number
    return lane


def _number_lanes(
    slots: Sequence[_Slot], offset: Floats, conflicts: Callable[[_Slot, _Slot], bool]
) -> list[int]:
    """Return the lane of each slot.

    A new lane begins at a gap between offsets, or if two vehicles cannot share a lane.

    Args:
        slots: sorted by offset.
        offset: (N, 2) of each slot [m].
        conflicts: whether two slots cannot share a lane.
    """
    numbers = []
    number = 0
    cluster: list[_Slot] = []
    for slot in slots:
        if cluster:
            gap = float(offset[slot]) - float(np.mean([offset[other] for other in cluster]))
            if gap > SAME_LANE_M or any(conflicts(slot, other) for other in cluster):
                number += max(1, round(gap / (2.0 * SAME_LANE_M)))
                cluster = []
        cluster.append(slot)
        numbers.append(number)
    return numbers


def _into_oncoming(direction: Ints, ends: Floats) -> Bools:
    """(N, 2) whether a vehicle starts or ends at an offset (N, 2) [m] of oncoming traffic."""
    oncoming = direction[:, None] != direction
    stays = np.abs(ends[:, 1] - ends[:, 0]) < SAME_LANE_M
    near = np.abs(ends[:, :, None] - ends.mean(axis=1)) < SAME_LANE_M
    return np.asarray((near & (oncoming & stays)[:, None, :]).any(axis=2))


def _free_lanes(direction: Ints, offset: Floats) -> tuple[int, int]:
    """Free lanes along and against the line between oncoming vehicles."""
    mean = offset.mean(axis=1)
    if (direction > 0).all() or (direction < 0).all():
        return 0, 0
    gap = float(mean[direction < 0].min() - mean[direction > 0].max())
    free = min(max(round(gap / (2.0 * SAME_LANE_M)) - 1, 0), MAX_FREE_LANES_COUNT)
    return (free + 1) // 2, free // 2


def _side_by_side(
    tracks: tuple[Track, ...],
    station: Floats,
    pair: tuple[int, int],
    rows: Bools,
    *,
    passing: bool,
) -> bool:
    """Whether two vehicles cannot share a lane at these samples (T,).

    They are side by side, or one overtakes the other without leaving the lane (`passing`).
    """
    if not rows.any():
        return False
    i, j = pair
    reach = (tracks[i].vehicle.length + tracks[j].vehicle.length) / 2.0 - QUEUE_OVERLAP_M
    ahead = (station[i] - station[j])[rows]
    overtakes = not passing and np.sign(ahead[0]) != np.sign(ahead[-1])
    return bool((np.abs(ahead) < reach).any() or overtakes)
