# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Is the manoeuvre kept? Turns, conflicts, who goes first and who is beside whom, of template and fit, over whole paths."""

from collections.abc import Iterable
from functools import lru_cache
from itertools import combinations

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.fitting.placement import Placement
from scenario_gen.numerics import Bools, Floats, Ints, wrap_angle
from scenario_gen.template import Conflict, conflicts_in, find_conflicts, in_words, keeps, Track, turn_of, turns_to_keep
from scenario_gen.types import Encounter, Loss, Road

CONFLICT, FOLLOWING = "conflict", "following"  # kinds of losses
_LONG = 1.0  # s side by side that count
_NEAREST, _FARTHEST = 1.0, 6.0  # metres sideways between centres of two vehicles that are beside each other
_LANES_DIFFER = 1.5  # metres by which they may be farther apart on a road, whose lanes are all of one width
_SAME_WAY = np.radians(30.0)
_ENOUGH = 0.5  # share of that time in which they are beside each other on the road, on the same side


class LostConflictError(RefusedError):
    """Vehicles that meet in the template would not on the road: its encounter is lost."""


def refuse_lost_conflicts(lost: Iterable[Loss], road: str) -> None:
    """Refuse a fit on which vehicles whose paths cross or merge in the template do not meet; who follows whom is only reported.

    Raises:
        LostConflictError: one is; it names the vehicles, and how it can be had all the same.
    """
    lost_here = [loss.message for loss in lost if loss.kind == CONFLICT]
    if lost_here:
        message = "; ".join(lost_here)
        raise LostConflictError(
            f"road {road} has no place that keeps the encounter: {message}; fitting.allow=lost_conflict takes it as it is"
        )


def refuse_lost_turns(tracks: tuple[Track, ...], placed: tuple[Track, ...], road: str) -> None:
    """Refuse a placement on which a vehicle does another manoeuvre than in the template.

    Raises:
        RefusedError: one turns more than 25° differently, or otherwise; with both figures.
    """
    for track, other in zip(tracks, placed, strict=True):
        there, name = turn_of(other), track.vehicle.id
        for turn in turns_to_keep(track):
            if not keeps(turn, there):
                raise RefusedError(
                    f"vehicle {name} {in_words(turn)} in the template, and would on road {road} {_otherwise(there)}"
                )


def _otherwise(turn: float) -> str:
    """As `in_words`, after "would"."""
    verb, rest = in_words(turn).split(" ", 1)
    return f"{verb.removesuffix('es') if verb == 'goes' else verb.removesuffix('s')} {rest}"


def count_lost(tracks: tuple[Track, ...], placed: tuple[Track, ...]) -> int:
    """How many of the template's conflicts a placement has not, or in another order, each counted twice, and new ones."""
    before, after = (_meetings(some) for some in (tracks, placed))
    changed = [pair for pair, conflict in before.items() if pair not in after or after[pair].first != conflict.first]
    return 2 * len(changed) + len(after.keys() - before.keys())


@lru_cache(maxsize=2)  # of one template many places are looked at
def _meetings(tracks: tuple[Track, ...]) -> dict[tuple[int, int], Conflict]:
    """The conflicts of some motion, by the vehicles."""
    time, poses = np.arange(len(tracks[0].progress), dtype=np.float64), np.stack([track.poses for track in tracks])
    return _by_pair(find_conflicts(tuple(track.vehicle for track in tracks), time, poses[..., :2], poses[..., 2]))


def keeps_conflicts(tracks: tuple[Track, ...], placed: tuple[Track, ...]) -> bool:
    """Whether all whose paths cross or merge in the template meet on the road."""
    before, after = (_meetings(some) for some in (tracks, placed))
    return {pair for pair, conflict in before.items() if not conflict.following} <= after.keys()


def find_unused(road: Road, used: Iterable[int]) -> tuple[Loss, ...]:
    """That arms of a drawn junction are not used, given the lanes that vehicles drive on."""
    arms = road.lanes.arms if road.lanes is not None and road.lanes.drawn else {}
    of_lane = {k: arm for arm, lanes in arms.items() for k in lanes}
    unused = len(arms) - len({of_lane[k] for k in used if k in of_lane})
    if len(arms) < 3 or not unused:
        return ()
    used_by_nobody = f"{'is' if unused == 1 else 'are'} not used: nobody in the template comes or goes there"
    return (Loss("arm", (), f"{unused} of the {len(arms)} arms of road {road.name} {used_by_nobody}"),)


def find_losses(encounter: Encounter, tracks: tuple[Track, ...], placement: Placement) -> tuple[Loss, ...]:
    """What of the template's interaction the placed motion has not, or has otherwise.

    Args:
        encounter: the template.
        tracks: its N cleaned tracks.
        placement: where they are on the road, sample by sample.
    """
    poses = np.stack([track.poses for track in placement.tracks])
    turns = [
        Loss("turn", (track.vehicle.id,), f"vehicle {track.vehicle.id} {in_words(a)} in the template, {in_words(b)} on this road")
        for track, a, b in ((t, _recorded(t), turn_of(p)) for t, p in zip(tracks, placement.tracks, strict=True))
        if not keeps(a, b)
    ]
    own = np.concatenate((encounter.position, encounter.heading[..., None]), axis=-1)
    return (*turns, *_lost_conflicts(encounter, poses), *_lost_neighbours(encounter, own, poses))


def _recorded(track: Track) -> float:
    """How far [rad] a vehicle was recorded to turn, by its heading; by its path where that is not known."""
    return turn_of(track) if np.isnan(track.recorded_turn) else track.recorded_turn


def _lost_conflicts(encounter: Encounter, poses: Floats) -> list[Loss]:
    vehicles, time = encounter.vehicles, encounter.time
    before = _by_pair(conflicts_in(encounter))
    after = _by_pair(find_conflicts(vehicles, time, poses[..., :2], poses[..., 2], encounter.present))
    lost = []
    for pair in sorted(before.keys() | after.keys()):
        a, b = (vehicles[k].id for k in pair)
        if pair not in after:
            kind = FOLLOWING if before[pair].following else CONFLICT
            what = "follow each other" if before[pair].following else "have crossing or merging paths"
            lost.append(Loss(kind, (a, b), f"vehicles {a} and {b} {what} in the template, and do not meet on this road"))
        elif pair not in before:
            lost.append(
                Loss("new conflict", (a, b), f"vehicles {a} and {b} come into conflict on this road, not in the template")
            )
        elif before[pair].first != after[pair].first and not before[pair].following:
            first, second = vehicles[before[pair].first].id, vehicles[before[pair].second].id
            late = abs(after[pair].arrival_gap)
            lost.append(
                Loss("order", (a, b), f"vehicle {first} goes before {second} in the template, {late:.1f} s after it on this road")
            )
    return lost


def _by_pair(conflicts: tuple[Conflict, ...]) -> dict[tuple[int, int], Conflict]:
    return {(min(c.first, c.second), max(c.first, c.second)): c for c in conflicts}


def _lost_neighbours(encounter: Encounter, own: Floats, poses: Floats) -> list[Loss]:
    lost = []
    for i, j in combinations(range(len(own)), 2):
        reach = (encounter.vehicles[i].length + encounter.vehicles[j].length) / 2.0
        both = encounter.there[i] & encounter.there[j]
        before = np.where(both, _side(own[i], own[j], reach), 0)
        for side, word in ((1, "left"), (-1, "right")):
            there: Bools = before == side
            seconds = float(there.sum()) * encounter.dt
            if seconds < _LONG:
                continue
            kept = float((_side(poses[i], poses[j], reach, _LANES_DIFFER)[there] == side).mean())
            if kept < _ENOUGH:
                a, b = encounter.vehicles[i].id, encounter.vehicles[j].id
                here = f"for {kept * seconds:.1f} s of these on this road"
                in_template = f"vehicle {b} is to the {word} of {a} for {seconds:.1f} s in the template"
                lost.append(Loss("beside", (a, b), f"{in_template}, {here}"))
    return lost


def _side(path: Floats, other: Floats, reach: float, wider: float = 0.0) -> Ints:
    """(T,) 1 where `other` (T, 3) is to the left of `path`, side by side and the same way, -1 to the right, 0 elsewhere."""
    d = other[:, :2] - path[:, :2]
    cos, sin = np.cos(path[:, 2]), np.sin(path[:, 2])
    ahead, left = d[:, 0] * cos + d[:, 1] * sin, d[:, 1] * cos - d[:, 0] * sin
    same = np.abs(wrap_angle(other[:, 2] - path[:, 2])) < _SAME_WAY
    beside = same & (np.abs(ahead) < reach) & (np.abs(left) > _NEAREST) & (np.abs(left) < _FARTHEST + wider)
    return np.where(beside, np.sign(left), 0.0).astype(np.int64)
