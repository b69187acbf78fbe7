# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Is the encounter kept? Who turns, who meets whom and goes first, who drives in whose lane, who passes whom on which side."""

from collections.abc import Iterable, Iterator
from itertools import combinations, permutations

import numpy as np

from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.numerics import Bools, Floats, Ints, wrap_angle
from scenario_gen.numerics.plane import ahead_and_left
from scenario_gen.situation import (
    describe_turn,
    is_same_turn,
    Track,
    track_conflicts,
    turn_of,
    turns_to_keep,
)
from scenario_gen.types import LaneNetwork, Loss

LOSABLE = {
    "conflict": "vehicles whose paths cross or merge do not meet",
    "order": "another vehicle goes first",
    "following": "a vehicle does not follow its leader",
    "merge": "a vehicle does not come into another one's lane",
    "lane_change": "a vehicle does not leave another one's lane, or two lanes become one",
    "overtaking": "a vehicle does not pass another one",
    "stand": "a vehicle does not pass one that stands, on its side",
    "turn": "a vehicle turns otherwise",
}
"""What a fit may lose only where `fitting.allow` names it, as lost_KIND; other losses are only reported."""

_LONG = 1.0  # s side by side that count
_NEAREST, _FARTHEST = (
    1.0,
    6.0,
)  # metres sideways between centres of two vehicles that are beside each other
_LANES_DIFFER = (
    1.5  # metres by which they may be farther apart on a road, whose lanes are all of one width
)
_SAME_WAY = np.radians(30.0)
_ENOUGH = (
    0.5  # share of that time in which they are beside each other on the road, on the same side
)
_IN_LANE, _OFF_LANE = (
    1.4,
    2.3,
)  # metres sideways up to which a vehicle is in another one's lane, and from which on beside it
_STILL_IN_LANE = 2.0  # metres, likewise on the road
_BEYOND = 30.0  # metres beyond the ends of a path, or of its lanes, for which it says, straight on, where its lane lies …
_DRIFT = 1.0  # … to so many metres
_PASSED = 2.0  # metres by which one that passes another is behind it first, and then before it


class LostEncounterError(RefusedError):
    """The road has a place for the template, and there something of its encounter would be lost."""


def allowed_losses(allow: str) -> frozenset[str]:
    """Return the kinds of losses that `fitting.allow` names.

    Raises:
        InputError: it names something else.
    """
    known = {f"lost_{kind}": kind for kind in LOSABLE}
    names = [name.strip() for name in allow.split(",") if name.strip()]
    for name in names:
        if name not in known:
            raise InputError(
                f"parameter allow names {name!r}; it may name, with commas between them, {', '.join(known)}"
            )
    return frozenset(known[name] for name in names)


def refused_losses(lost: Iterable[Loss], allow: str) -> list[Loss]:
    """Return the losses for which a fit is refused."""
    allowed = allowed_losses(allow)
    return [loss for loss in lost if loss.kind in LOSABLE and loss.kind not in allowed]


def refuse_lost(lost: Iterable[Loss], allow: str, road: str) -> None:
    """Refuse a fit that loses what `allow` does not name.

    Raises:
        LostEncounterError: it does; it names the vehicles, and how it can be had all the same.
    """
    refused = refused_losses(lost, allow)
    if refused:
        names = ",".join(
            f"lost_{kind}"
            for kind in sorted(allowed_losses(allow) | {loss.kind for loss in refused})
        )
        raise LostEncounterError(
            f"road {road} has no place that keeps the encounter: {'; '.join(loss.message for loss in refused)}; "
            f"fitting.allow={names} takes it as it is"
        )


def find_unused(network: LaneNetwork, used: Iterable[int]) -> tuple[Loss, ...]:
    """That arms of a drawn junction are not used, given the lanes that vehicles drive on."""
    arms = network.arms
    of_lane = {k: arm for arm, lanes in arms.items() for k in lanes}
    unused = len(arms) - len({of_lane[k] for k in used if k in of_lane})
    if len(arms) < 3 or not unused:
        return ()
    used_by_nobody = (
        f"{'is' if unused == 1 else 'are'} not used: no recorded vehicle enters or leaves there"
    )
    return (
        Loss(
            "arm", (), f"{unused} of the {len(arms)} arms of road {network.name} {used_by_nobody}"
        ),
    )


def find_losses(tracks: tuple[Track, ...], placed: tuple[Track, ...]) -> tuple[Loss, ...]:
    """Return what of the template's interaction its placement on a road has not, or has otherwise; both are cleaned tracks."""
    found = (_lost_turns, _lost_passings, _lost_lanes, _lost_conflicts, _lost_neighbours)
    by_vehicles = {
        frozenset(loss.vehicles): loss
        for find in reversed(found)
        for loss in reversed([*find(tracks, placed)])
    }
    return tuple(by_vehicles.values())[::-1]


def _lost_turns(tracks: tuple[Track, ...], placed: tuple[Track, ...]) -> Iterator[Loss]:
    for track, other in zip(tracks, placed, strict=True):
        there, name = turn_of(other), track.vehicle.id
        lost = next((turn for turn in turns_to_keep(track) if not is_same_turn(turn, there)), None)
        if lost is not None:
            yield Loss(
                "turn",
                (name,),
                f"vehicle {name} {describe_turn(lost)} in the recording, {describe_turn(there)} on this road",
            )


def _lost_conflicts(tracks: tuple[Track, ...], placed: tuple[Track, ...]) -> Iterator[Loss]:
    before, after = track_conflicts(tracks), track_conflicts(placed)
    for pair in sorted(before.keys() | after.keys()):
        a, b = (tracks[k].vehicle.id for k in pair)
        if pair not in after:
            following = before[pair].following
            if following and any(tracks[k].vehicle.kind.walks for k in pair):
                continue
            if following and _in_two_lanes(*(tracks[k] for k in pair)):
                how = "drive side by side less than a lane apart in the recording, in two lanes on this road"
                yield Loss("beside", (a, b), f"vehicles {a} and {b} {how}")
                continue
            what = "follow each other" if following else "have crossing or merging paths"
            kind = "following" if following else "conflict"
            yield Loss(
                kind,
                (a, b),
                f"vehicles {a} and {b} {what} in the recording, and do not meet on this road",
            )
        elif pair not in before:
            yield Loss(
                "new conflict",
                (a, b),
                f"vehicles {a} and {b} come into conflict on this road, not in the recording",
            )
        elif before[pair].first != after[pair].first and not before[pair].following:
            first, late = tracks[before[pair].first].vehicle.id, abs(after[pair].arrival_gap)
            yield Loss(
                "order",
                (a, b),
                f"vehicle {first} goes first in the recording, {late:.1f} s after the other on this road",
            )


def _in_two_lanes(track: Track, other: Track) -> bool:
    """Whether two vehicles drive beside each other at both ends, however near: a record may have them overlap."""
    aside = np.abs(
        [
            _aside(one, another, end)
            for one, another in ((track, other), (other, track))
            for end in (0, 1)
        ]
    )
    return bool((aside > _IN_LANE).any() and not (aside <= _IN_LANE).any())


def _lost_lanes(tracks: tuple[Track, ...], placed: tuple[Track, ...]) -> Iterator[Loss]:
    """Who drives in whose lane at the start and at the end: what has become of it on the road."""
    for i, j in permutations(
        (n for n, track in enumerate(tracks) if not track.vehicle.kind.walks), 2
    ):
        before = [_aside(tracks[i], tracks[j], end) for end in (0, 1)]
        after = [_aside(placed[i], placed[j], end) for end in (0, 1)]
        together = [abs(offset) < _IN_LANE for offset in before]
        farthest = np.inf if any(together) else _FARTHEST
        if not any(
            _differs(own, there, farthest) for own, there in zip(before, after, strict=True)
        ):
            continue
        a, b = tracks[i].vehicle.id, tracks[j].vehicle.id
        known = [near for near, own in zip(together, before, strict=True) if not np.isnan(own)]
        if all(known):
            yield Loss(
                "following",
                (a, b),
                f"vehicles {a} and {b} drive in one lane in the recording, not on this road",
            )
        elif known[-1]:
            yield Loss(
                "merge",
                (a, b),
                f"vehicle {b} comes into the lane of {a} in the recording, not on this road",
            )
        elif known[0]:
            yield Loss(
                "lane_change",
                (a, b),
                f"vehicle {b} leaves the lane of {a} in the recording, not on this road",
            )
        else:
            yield Loss(
                "lane_change",
                (a, b),
                f"vehicles {a} and {b} drive in two lanes in the recording, otherwise on this road",
            )


def _differs(own: float, there: float, farthest: float) -> bool:
    """Whether a vehicle so far aside [m] in the template, at most `farthest`, is so far aside [m] on the road in another lane."""
    if abs(own) < _IN_LANE:
        return bool(np.isnan(there)) or abs(there) > _STILL_IN_LANE
    return _OFF_LANE < abs(own) < farthest and (own * there < 0.0 or abs(there) < _IN_LANE)


def _aside(track: Track, other: Track, end: int) -> float:
    """How far [m, left positive] beside a path another vehicle starts (`end` 0) or ends (1); NaN if it does not lead there."""
    pose, lane = other.curve.at(other.progress[other.present[end]]), track.lane or track.curve
    station, offset = lane.project(pose[None, :2])
    beyond = max(
        -float(station[0]), float(station[0]) - (lane.length if track.lane else track.travelled)
    )
    turned = abs(float(wrap_angle(lane.at(station)[0, 2] - pose[2])))
    leads = turned < _SAME_WAY if beyond <= 0.0 else beyond < _BEYOND and turned * beyond < _DRIFT
    return float(offset[0]) if leads and not (track.still or other.still) else np.nan


def _lost_passings(tracks: tuple[Track, ...], placed: tuple[Track, ...]) -> Iterator[Loss]:
    for i, j in permutations(range(len(tracks)), 2):
        side = _passes(tracks[i], tracks[j], _FARTHEST)
        if not side or _passes(placed[i], placed[j], _FARTHEST + _LANES_DIFFER) == side:
            continue
        a, b, word = tracks[i].vehicle.id, tracks[j].vehicle.id, "left" if side > 0 else "right"
        kind, what = ("stand", f"{b}, which stands") if tracks[j].still else ("overtaking", b)
        yield Loss(
            kind,
            (a, b),
            f"vehicle {a} passes {what}, to its {word}, in the recording, not on this road",
        )


def _passes(track: Track, other: Track, farthest: float) -> int:
    """On which side a vehicle passes another one that drives the same way, or stands: 1 left, -1 right, 0 it does not."""
    both = track.is_present & other.is_present
    if track.still or not both.any():
        return 0
    poses, others = track.poses[both], other.poses[both]
    ahead, left = ahead_and_left((others - poses)[:, :2], poses[:, 2])
    near = (np.abs(left) < farthest) & (
        other.still | (np.abs(wrap_angle(others[:, 2] - poses[:, 2])) < _SAME_WAY)
    )
    before, after = (
        np.flatnonzero(near & (ahead > _PASSED)),
        np.flatnonzero(near & (ahead < -_PASSED)),
    )
    if not len(before) or not len(after) or before[0] > after[-1]:
        return 0
    aside = float(left[np.argmin(np.where(near, np.abs(ahead), np.inf))])
    return -int(np.sign(aside)) if abs(aside) > _NEAREST else 0


def _lost_neighbours(tracks: tuple[Track, ...], placed: tuple[Track, ...]) -> Iterator[Loss]:
    for i, j in combinations(range(len(tracks)), 2):
        reach = (tracks[i].vehicle.length + tracks[j].vehicle.length) / 2.0
        before = np.where(
            tracks[i].is_present & tracks[j].is_present,
            _side(tracks[i].poses, tracks[j].poses, reach),
            0,
        )
        for side, word in ((1, "left"), (-1, "right")):
            there: Bools = before == side
            seconds = float(there.sum()) * tracks[0].dt
            if seconds < _LONG:
                continue
            kept = float(
                (
                    _side(placed[i].poses, placed[j].poses, reach, _LANES_DIFFER)[there] == side
                ).mean()
            )
            if kept < _ENOUGH:
                a, b = tracks[i].vehicle.id, tracks[j].vehicle.id
                here = f"for {kept * seconds:.1f} s of these on this road"
                yield Loss(
                    "beside",
                    (a, b),
                    f"vehicle {b} is to the {word} of {a} for {seconds:.1f} s in the recording, {here}",
                )


def _side(path: Floats, other: Floats, reach: float, wider: float = 0.0) -> Ints:
    """(T,) 1 where `other` (T, 3) is to the left of `path`, side by side and the same way, -1 to the right, 0 elsewhere."""
    ahead, left = ahead_and_left((other - path)[:, :2], path[:, 2])
    same = np.abs(wrap_angle(other[:, 2] - path[:, 2])) < _SAME_WAY
    beside = (
        same
        & (np.abs(ahead) < reach)
        & (np.abs(left) > _NEAREST)
        & (np.abs(left) < _FARTHEST + wider)
    )
    return np.where(beside, np.sign(left), 0.0).astype(np.int64)
