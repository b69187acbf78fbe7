# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A template along one road of a map: following, oncoming, passing, on lanes side by side, however the road winds.

Stations on the template's reference line (`template.frenet`) become stations on a chain of lanes; lanes counted from the
driver's left become lanes beside it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
import math

import numpy as np

from scenario_gen.base.cancelling import stop_if_cancelled
from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import Floats, wrap_angle
from scenario_gen.numerics.curve import Curve
from scenario_gen.roads.vector.match import (
    bending,
    Chains,
    changed_curve,
    Course,
    Match,
    pressed_aside,
    speeding,
)
from scenario_gen.situation import FrenetTracks, to_frenet, Track, turn_of
from scenario_gen.types import LEVEL

_ROOM = 1.0  # metres between a footprint and the end of the road
_FORTH = 25.0  # metres of road before and after what is driven, where it has them
_TRIED = 40  # roads, the straightest first
_TURN = math.radians(
    60.0
)  # more than the template's that a road may bend; less it may: the template is laid out straight
_APART = 2.2  # metres between the middles of oncoming lanes, at least
_ASIDE = 18.0  # metres between a road's outermost lanes
_STRAIGHT = (
    0.02  # rad/m: how much of the cost is the road's bending: (rad/m)² are counted against this
)
_PARALLEL = math.radians(20.0)
_EVERY = 10.0  # metres between the places at which lanes are compared
_WANDER = 1.8  # metres by which the distance between parallel lanes may differ


@dataclass(frozen=True, eq=False)
class _Stretch:
    """A stretch of road on which a template may lie.

    Attributes:
        chain: its lanes.
        curve: the middle of these.
        begin: arc length [m] on the curve at which the stretch begins.
        span: metres that it is long.
        bend: rad/m, the mean on the stretch.
    """

    chain: tuple[int, ...]
    curve: Curve
    begin: float
    span: float
    bend: float

    @property
    def lead(self) -> float:
        """Metres of the axis before the stretch."""
        return min(self.begin, _FORTH)

    @cached_property
    def axis(self) -> Curve:
        """The middle, with what lies before and after the stretch."""
        return self.curve.cut(
            max(self.begin - _FORTH, 0.0), min(self.begin + self.span + _FORTH, self.curve.length)
        )


@dataclass(frozen=True, eq=False)
class _Side:
    """A lane beside the axis: its chain, its middle, its mean offset [m, left positive]."""

    chain: tuple[int, ...]
    curve: Curve
    offset: float


def along_streets(
    chains: Chains, tracks: tuple[Track, ...], lanes: Sequence[int] | None = None
) -> Iterator[Match]:
    """Yield the template along the straightest stretches of road that have its lanes.

    Args:
        chains: of the map or the part of it.
        tracks: the template.
        lanes: the axis begins on one of these; None: on any lane.
    """
    try:
        compact = to_frenet(tracks)
    except RefusedError:
        return
    low, high = (
        end + room for end, room in zip(compact.span(tracks), (-_ROOM, _ROOM), strict=True)
    )
    stretches = sorted(
        _stretches(chains, high - low, lanes),
        key=lambda candidate: (round(candidate.bend, 4), candidate.chain),
    )
    ways = [compact.spread(), *([compact] if any(compact.between) else [])]
    if compact.swerve.any():  # where there is no room for that, others say what is lost
        ways.append(replace(compact, swerve=np.zeros_like(compact.swerve)))
    for frenet in ways:
        for stretch in stretches[:_TRIED]:
            stop_if_cancelled()
            for own in (True, False) if any(map(chains.own_of, tracks)) else (False,):
                match = _laid(chains, stretch, tracks, (frenet, low), own=own)
                if match is not None:
                    yield match


def _stretches(chains: Chains, span: float, lanes: Sequence[int] | None) -> Iterator[_Stretch]:
    """The straightest stretch of the chain from each lane, where that is long enough."""
    for first in range(len(chains.network.lanes)) if lanes is None else lanes:
        chain = _straight_on(chains, first, span)
        curve = chains.curve(chain)
        if curve.length < span:
            continue
        begins = np.arange(0.0, curve.length - span + 1e-9, 5.0)
        station = np.arange(0.0, curve.length + 1e-9, 1.0)
        turned = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(curve.at(station)[:, 2])))))
        bend = (
            np.interp(begins + span, station, turned) - np.interp(begins, station, turned)
        ) / span
        k = int(np.argmin(np.round(bend, 6)))
        yield _Stretch(chain, curve, float(begins[k]), span, float(bend[k]))


def _straight_on(chains: Chains, first: int, span: float) -> tuple[int, ...]:
    """The chain from a lane that turns least at every fork, as long as needed."""
    chain, length = [first], chains.length[first]
    while length < span + 2.0 * _FORTH:
        after = chains.after(chain)
        if not after:
            break
        chain.append(min(after, key=lambda k: (round(_turn_of(chains, k), 3), k)))
        length += chains.length[chain[-1]]
    return tuple(chain)


def _turn_of(chains: Chains, lane: int) -> float:
    centre = chains.network.lanes[lane].centre
    first, last = centre[1] - centre[0], centre[-1] - centre[-2]
    return abs(
        float(
            np.arctan2(
                first[0] * last[1] - first[1] * last[0], first[0] * last[0] + first[1] * last[1]
            )
        )
    )


def _laid(
    chains: Chains,
    stretch: _Stretch,
    tracks: tuple[Track, ...],
    along: tuple[FrenetTracks, float],
    *,
    own: bool,
) -> Match | None:
    """The template on a stretch of road, None if lanes are missing.

    Args:
        chains: of the map.
        stretch: where it goes.
        tracks: the template.
        along: the same in path coordinates, and the station [m] of its reference line at which the stretch begins.
        own: whether vehicles that have lanes of their own are laid on these.
    """
    frenet, low = along
    axis = stretch.axis
    ahead = sorted(_sides(chains, stretch, 1), key=lambda side: -side.offset)
    against = sorted(_sides(chains, stretch, -1), key=lambda side: side.offset)
    if (
        ahead and against and against[0].offset < ahead[0].offset
    ):  # traffic keeps left: count from the middle of the road
        ahead, against = ahead[::-1], against[::-1]
    courses, offsets = [], {1: list[float](), -1: list[float]()}
    for i, track in enumerate(tracks):
        sign = int(frenet.direction[i])
        closed, favoured = (
            chains.closed_to(track),
            chains.own_of(track) if own else frozenset[int](),
        )
        sides = [
            side for side in (ahead if sign > 0 else against) if closed.isdisjoint(side.chain)
        ]
        on_own = [side for side in sides if favoured.issuperset(side.chain)]
        sides = on_own or sides
        first, last = (0 if on_own else int(k) for k in frenet.lane[i])
        if max(first, last) >= len(sides):
            return None
        offsets[sign] += [sides[first].offset, sides[last].offset]
        station = stretch.lead + frenet.station[i] - low
        curve, used = sides[first].curve, sides[first].chain
        if first != last:
            at = int(np.argmax(frenet.change[i] >= 0.5))
            changed = changed_curve(curve, sides[last].curve, axis.at(float(station[at]))[:2])
            if changed is None:
                return None
            curve, used = changed, tuple(dict.fromkeys((*used, *sides[last].chain)))
        if frenet.swerve[i].any():
            courses.append(_swerving(used, curve, axis.at(station)[:, :2], frenet.swerve[i]))
        else:
            begin, _ = curve.project(axis.at(station[:1])[:, :2])
            progress = np.zeros(len(station)) if track.still else (station - station[0]) * sign
            courses.append(Course(used, curve, float(begin[0]), np.maximum.accumulate(progress)))
        half = track.vehicle.length / 2.0 + _ROOM / 2.0
        if courses[-1].start < half or courses[-1].end + half > curve.length:
            return None
        if abs(courses[-1].turn) > abs(turn_of(track)) + _TURN:
            return None
    if any(abs(a - b) < _APART for a in offsets[1] for b in offsets[-1]):
        return None  # one lane for both directions
    aside = [pressed_aside(course, track) for course, track in zip(courses, tracks, strict=True)]
    cost = (
        stretch.bend / _STRAIGHT
        + speeding(chains.network, courses, tracks)
        + bending([usual for usual, _ in aside])
    )
    return Match(
        tuple(courses),
        cost,
        "",
        max(forced for _, forced in aside),
        chains.off_own(courses, tracks),
    )


def _swerving(used: tuple[int, ...], lane: Curve, places: Floats, swerve: Floats) -> Course:
    """The course of a vehicle that swerves by so much (T,) [m] to the left of a lane's middle at places (T, 2) [m] of a road."""
    at = np.maximum.accumulate(lane.project(places)[0])
    s = np.linspace(0.0, lane.length, max(math.ceil(2.0 * lane.length), 1) + 1)
    moves = np.concatenate(([True], np.diff(at) > 0.0))
    curve = Curve.through(lane.beside(s, np.interp(s, at[moves], swerve[moves]))[:, :2])
    driven = np.interp(at, s, curve.station)
    return Course(used, curve, float(driven[0]), driven - driven[0])


def _sides(chains: Chains, stretch: _Stretch, sign: int) -> list[_Side]:
    """The lanes that run beside a stretch's axis, in its direction (+1) or against it (-1), from end to end."""
    begin, end = stretch.lead, stretch.lead + stretch.span
    poses = stretch.axis.at(np.linspace(begin, end, max(math.ceil((end - begin) / _EVERY), 1) + 1))
    start = poses[0 if sign > 0 else -1]
    yaw = start[2] + (0.0 if sign > 0 else np.pi)
    away = np.hypot(chains.points[:, 0] - start[0], chains.points[:, 1] - start[1])
    own = np.flatnonzero(np.isin(chains.owner, stretch.chain))
    level = chains.height[own[np.argmin(away[own])]]
    near = (
        (away < _ASIDE)
        & (np.abs(wrap_angle(chains.yaws - yaw)) < _PARALLEL)
        & ~(np.abs(chains.height - level) > LEVEL)
    )
    sides: list[_Side] = []
    for first in np.unique(chains.owner[near]).tolist():
        chain = _beside(chains, first, poses[::sign], sign)
        back = chains.network.predecessors[first]
        chain = (back[0], *chain) if back and back[0] not in chain else chain
        curve = chains.curve(chain)
        station, _ = curve.project(poses[:, :2])
        turned = np.abs(
            wrap_angle(curve.at(station)[:, 2] - poses[:, 2] + (0.0 if sign > 0 else np.pi))
        )
        _, offset = stretch.axis.project(curve.at(np.clip(station, 0.0, curve.length))[:, :2])
        inside = (station > -0.1).all() and (station < curve.length + 0.1).all()
        if inside and (turned < _PARALLEL).all() and np.ptp(offset) < _WANDER:
            mean = float(offset.mean())
            if all(abs(mean - other.offset) > 1.0 for other in sides):
                low, high = float(station.min()) - _FORTH, float(station.max()) + _FORTH
                sides.append(_Side(chain, curve.cut(max(low, 0.0), min(high, curve.length)), mean))
    return sides


def _beside(chains: Chains, first: int, poses: Floats, sign: int) -> tuple[int, ...]:
    """The chain from a lane that keeps its distance from the axis's poses, the last of which it is to reach."""
    chain, goal = [first], poses[-1, :2]
    while True:
        centre = chains.network.lanes[chain[-1]].centre
        if (
            float(np.hypot(*(centre - goal).T).min()) < _ASIDE
            and len(chain) > 1
            and _passed(centre, poses[-1], sign)
        ):
            return tuple(chain)
        after = chains.after(chain)
        if not after:
            return tuple(chain)
        chain.append(
            min(
                after, key=lambda k: (round(_off(chains.network.lanes[k].centre[-1], poses), 3), k)
            )
        )


def _off(point: Floats, poses: Floats) -> float:
    return float(np.hypot(*(poses[:, :2] - point).T).min())


def _passed(centre: Floats, pose: Floats, sign: int) -> bool:
    """Whether a lane goes on beyond a pose by more than room for a vehicle."""
    ahead = (centre[-1] - pose[:2]) * np.array([np.cos(float(pose[2])), np.sin(float(pose[2]))])
    return bool(sign * float(ahead.sum()) > 10.0)
