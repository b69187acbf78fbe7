# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The parts of a recorded encounter that a placement loses: turns, conflicts, lanes, passings."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, permutations

import numpy as np

from scenario_gen.numerics import ahead_and_left, Bools, wrap_angle
from scenario_gen.numerics.rounding import ROUNDING_S
from scenario_gen.situation.abreast import (
    abreast_in_lane,
    MAX_CLEARANCE_CHANGE_M,
    MAX_SIDE_OFFSET_M,
    MIN_SIDE_BY_SIDE_S,
    path_offsets,
    SAME_DIRECTION_RAD,
    side_offsets,
)
from scenario_gen.situation.conflicts import track_conflicts
from scenario_gen.situation.tracks import (
    describe_turn,
    follows_bend,
    is_same_turn,
    Track,
    turn_of,
)
from scenario_gen.types import Loss

LOSABLE = {
    "conflict": "vehicles whose paths cross or merge do not meet",
    "order": "another vehicle goes first",
    "following": "a vehicle does not follow its leader",
    "merge": "a vehicle does not enter another one's lane",
    "lane_change": "a vehicle does not leave another one's lane",
    "overtaking": "a vehicle does not pass another one",
    "clearance": "two vehicles side by side in one lane are nearer to each other",
    "stand": "a vehicle does not pass a stationary one on the same side",
    "turn": "a vehicle turns otherwise",
    "light": "a vehicle stops at red where the road has no light",
}
"""Losses for which a fit is refused unless `fitting.allow` names them, as lost_KIND.

Other losses are only reported.
"""

Tracks = tuple[Track, ...]


@dataclass(frozen=True)
class _Limits:
    """The bounds of lanes, passings and vehicles side by side."""

    min_kept_share: float = 0.5  # of the time side by side
    min_side_offset_m: float = 1.0  # between centres of vehicles side by side,
    lane_width_difference_m: float = 1.5  # between recorded lanes and those of the road
    in_lane_m: float = 1.4  # offset up to which a vehicle is in another one's lane,
    in_lane_on_road_m: float = 2.0
    next_lane_m: float = 2.3  # and from which it is in another lane
    max_extrapolation_m: float = 30.0  # beyond the ends of a path, straight on,
    max_drift_m: float = 1.0  # if this leaves the lane by less
    passing_distance_m: float = 2.0  # by which a passing vehicle is behind, and later ahead


_LIMITS = _Limits()


def find_losses(tracks: Tracks, placed: Tracks) -> tuple[Loss, ...]:
    """Return the losses of placed tracks, one for each set of vehicles."""
    losses = [
        *_lost_turns(tracks, placed),
        *_lost_passings(tracks, placed),
        *_lost_lanes(tracks, placed),
        *_lost_conflicts(tracks, placed),
        *_lost_clearances(tracks, placed),
        *_lost_neighbours(tracks, placed),
    ]
    by_vehicles: dict[frozenset[str], Loss] = {}
    for loss in losses:
        by_vehicles.setdefault(frozenset(loss.vehicles), loss)
    return tuple(by_vehicles.values())


def _lost_turns(tracks: Tracks, placed: Tracks) -> Iterator[Loss]:
    for track, placed_track in zip(tracks, placed, strict=True):
        turn, name = turn_of(placed_track), track.vehicle.id
        if not is_same_turn(turn_of(track), turn):
            recorded, placed_turn = describe_turn(turn_of(track)), describe_turn(turn)
            message = f"vehicle {name} {recorded} in the recording, {placed_turn} on this road"
            is_bend = follows_bend(track) and follows_bend(placed_track)
            yield Loss("bend" if is_bend else "turn", (name,), message)


def _lost_conflicts(tracks: Tracks, placed: Tracks) -> Iterator[Loss]:
    before, after = track_conflicts(tracks), track_conflicts(placed)
    for pair in sorted(before.keys() | after.keys()):
        a, b = (tracks[k].vehicle.id for k in pair)
        if pair not in after:
            loss = _lost_meeting(tracks, pair, following=before[pair].following)
            if loss is not None:
                yield loss
        elif pair not in before:
            message = f"vehicles {a} and {b} come into conflict on this road, not in the recording"
            yield Loss("new conflict", (a, b), message)
        elif before[pair].first != after[pair].first and not before[pair].following:
            first, delay = tracks[before[pair].first].vehicle.id, abs(after[pair].arrival_gap)
            message = (
                f"vehicle {first} goes first in the recording, but would arrive {delay:.1f} s "
                "later than the other on this road"
            )
            yield Loss("order", (a, b), message)


def _lost_meeting(tracks: Tracks, pair: tuple[int, int], *, following: bool) -> Loss | None:
    """Return the loss of a conflict; None if a pedestrian merely follows."""
    first, second = (tracks[k] for k in pair)
    a, b = first.vehicle.id, second.vehicle.id
    if not following:
        message = (
            f"vehicles {a} and {b} have crossing or merging paths in the recording, and do not "
            "meet on this road"
        )
        return Loss("conflict", (a, b), message)
    if first.vehicle.kind.walks or second.vehicle.kind.walks:
        return None
    if _in_two_lanes(first, second):
        message = (
            f"vehicles {a} and {b} drive side by side less than a lane apart in the recording, in "
            "two lanes on this road"
        )
        return Loss("beside", (a, b), message)
    message = (
        f"vehicles {a} and {b} follow each other in the recording, and do not meet on this road"
    )
    return Loss("following", (a, b), message)


def _in_two_lanes(track: Track, other: Track) -> bool:
    """Return whether two vehicles are side by side at both ends; they may overlap in a record."""
    offsets = np.abs(
        [
            _offset_at_end(first, second, end)
            for first, second in ((track, other), (other, track))
            for end in (0, 1)
        ]
    )
    return bool((offsets > _LIMITS.in_lane_m).any() and not (offsets <= _LIMITS.in_lane_m).any())


def _lost_lanes(tracks: Tracks, placed: Tracks) -> Iterator[Loss]:
    """Yield the vehicles that share a lane at the start or the end, and do so no more.

    Those side by side in one lane have another rule, `_lost_clearances`.
    """
    drivers = [n for n, track in enumerate(tracks) if not track.vehicle.kind.walks]
    abreast = {each.pair for each in abreast_in_lane(tracks)}
    for i, j in permutations(drivers, 2):
        before = [_offset_at_end(tracks[i], tracks[j], end) for end in (0, 1)]
        after = [_offset_at_end(placed[i], placed[j], end) for end in (0, 1)]
        shares_lane = any(abs(offset) < _LIMITS.in_lane_m for offset in before)
        max_offset = np.inf if shares_lane else MAX_SIDE_OFFSET_M
        changes = any(map(_changes_lane, before, after, (max_offset, max_offset)))
        if changes and abreast.isdisjoint(((i, j), (j, i))):
            yield _lane_loss(tracks[i].vehicle.id, tracks[j].vehicle.id, before)


def _lane_loss(a: str, b: str, offsets: Sequence[float]) -> Loss:
    """Return the loss of a vehicle b with recorded offsets [m] from a at the start and the end."""
    known = [offset for offset in offsets if not np.isnan(offset)]
    in_lane = [abs(offset) < _LIMITS.in_lane_m for offset in known]
    if all(in_lane):
        message = f"vehicles {a} and {b} drive in one lane in the recording, not on this road"
        return Loss("following", (a, b), message)
    if in_lane[-1]:
        message = f"vehicle {b} enters the lane of {a} in the recording, not on this road"
        return Loss("merge", (a, b), message)
    if in_lane[0]:
        message = f"vehicle {b} leaves the lane of {a} in the recording, not on this road"
        return Loss("lane_change", (a, b), message)
    message = f"vehicles {a} and {b} drive in two lanes in the recording, otherwise on this road"
    return Loss("lanes", (a, b), message)


def _changes_lane(recorded: float, on_road: float, max_offset: float) -> bool:
    """Return whether a vehicle has another lane on the road, from offsets [m] to another one.

    Recorded offsets beyond `max_offset` [m] are not compared.
    """
    if abs(recorded) < _LIMITS.in_lane_m:
        return bool(np.isnan(on_road)) or abs(on_road) > _LIMITS.in_lane_on_road_m
    is_beside = _LIMITS.next_lane_m < abs(recorded) < max_offset
    return is_beside and (recorded * on_road < 0.0 or abs(on_road) < _LIMITS.in_lane_m)


def _offset_at_end(track: Track, other: Track, end: int) -> float:
    """Return the offset [m, left positive] of another vehicle from a path, at its start or end.

    `end` is 0 for its start, 1 for its end. NaN: the path does not lead there.
    """
    pose = other.curve.at(other.progress[other.present[end]])
    lane = track.lane or track.curve
    length = lane.length if track.lane else track.travelled
    station, offset = lane.project(pose[None, :2])
    beyond = max(-float(station[0]), float(station[0]) - length)
    turn = abs(float(wrap_angle(lane.at(station)[0, 2] - pose[2])))
    if track.still or other.still:
        return np.nan
    if beyond <= 0.0:
        leads_there = turn < SAME_DIRECTION_RAD
    else:
        leads_there = beyond < _LIMITS.max_extrapolation_m and turn * beyond < _LIMITS.max_drift_m
    return float(offset[0]) if leads_there else np.nan


def _lost_passings(tracks: Tracks, placed: Tracks) -> Iterator[Loss]:
    for i, j in permutations(range(len(tracks)), 2):
        side = _passing_side(tracks[i], tracks[j], MAX_SIDE_OFFSET_M)
        max_offset = MAX_SIDE_OFFSET_M + _LIMITS.lane_width_difference_m
        if side and _passing_side(placed[i], placed[j], max_offset) != side:
            a, b = tracks[i].vehicle.id, tracks[j].vehicle.id
            word = "left" if side > 0 else "right"
            kind = "stand" if tracks[j].still else "overtaking"
            passed = f"the stationary vehicle {b}" if tracks[j].still else b
            message = (
                f"vehicle {a} passes {passed} on its {word} in the recording, not on this road"
            )
            yield Loss(kind, (a, b), message)


def _passing_side(track: Track, other: Track, max_offset: float) -> int:
    """Return on which side a vehicle passes another one in its direction, or a stationary one.

    It is 1 for left and -1 for right, 0 if it does not pass.
    """
    both = track.is_present & other.is_present
    if track.still or not both.any():
        return 0
    poses, others = track.poses[both], other.poses[both]
    ahead, left = ahead_and_left((others - poses)[:, :2], poses[:, 2])
    alike = np.abs(wrap_angle(others[:, 2] - poses[:, 2])) < SAME_DIRECTION_RAD
    near = (np.abs(left) < max_offset) & (other.still | alike)
    before = np.flatnonzero(near & (ahead > _LIMITS.passing_distance_m))
    after = np.flatnonzero(near & (ahead < -_LIMITS.passing_distance_m))
    if not len(before) or not len(after) or before[0] > after[-1]:
        return 0
    offset = float(left[np.argmin(np.where(near, np.abs(ahead), np.inf))])
    return -int(np.sign(offset)) if abs(offset) > _LIMITS.min_side_offset_m else 0


def _lost_neighbours(tracks: Tracks, placed: Tracks) -> Iterator[Loss]:
    for i, j in combinations(range(len(tracks)), 2):
        recorded = side_offsets(tracks[i], tracks[j])
        max_offset = MAX_SIDE_OFFSET_M + _LIMITS.lane_width_difference_m
        on_road = np.sign(np.nan_to_num(side_offsets(placed[i], placed[j], max_offset)))
        for side, word in ((1, "left"), (-1, "right")):
            side_by_side: Bools = np.sign(recorded) == side
            seconds = float(side_by_side.sum()) * tracks[0].dt
            if seconds < MIN_SIDE_BY_SIDE_S - ROUNDING_S:
                continue
            kept = float((on_road[side_by_side] == side).mean())
            if kept < _LIMITS.min_kept_share:
                a, b = tracks[i].vehicle.id, tracks[j].vehicle.id
                message = (
                    f"vehicle {b} is to the {word} of {a} for {seconds:.1f} s in the recording, "
                    f"for {kept * seconds:.1f} s of these on this road"
                )
                yield Loss("beside", (a, b), message)


def _lost_clearances(tracks: Tracks, placed: Tracks) -> Iterator[Loss]:
    """Yield the pairs that share a lane side by side, and are nearer or farther on the road."""
    for abreast in abreast_in_lane(tracks):
        first, second = (placed[n] for n in abreast.pair)
        offsets = path_offsets(first, second)[abreast.samples]
        if not np.isfinite(offsets).any():
            continue
        change = abs(float(np.nanmedian(offsets))) - abs(abreast.offset)
        if abs(change) > MAX_CLEARANCE_CHANGE_M:
            a, b = first.vehicle.id, second.vehicle.id
            message = (
                f"vehicle {b} drives {abreast.clearance:.1f} m beside vehicle {a} in the "
                f"recording, {abreast.clearance + change:.1f} m on this road"
            )
            yield Loss("clearance" if change < 0.0 else "beside", (a, b), message)
