# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A template on the lanes of a map: which chain of lanes each vehicle drives, and where on it the template begins.

A placement as one piece (`search`) says about where; then each vehicle gets the chain of lanes that its path lies nearest to, in
their direction, with at most one change of lanes where the map allows one. Along the chains the template keeps its distances
to crossings and between vehicles on one lane (least squares, weighted).
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice, product
import math

import numpy as np

from scenario_gen.numerics import Floats, runs, wrap_angle
from scenario_gen.numerics.curve import crossings, Curve
from scenario_gen.numerics.plane import angle_between, edge_lengths
from scenario_gen.roads.vector.search import Spot
from scenario_gen.situation import (
    describe_turn,
    Equation,
    pair_crossings,
    PairConflicts,
    solve_placement,
    Track,
    turn_of,
    turns_to_keep,
    WAIT_SPEED_MPS,
)
from scenario_gen.types import CARS, LaneNetwork, RuleKind

NEAR = 8.0  # metres: a chain begins on a lane that passes a vehicle's start at most so far away
_HEADING = math.radians(60.0)  # and is turned from it by this at most
_MOST_CHAINS = 48  # from one lane, and
_MOST_TRIED = 96  # of one vehicle: on recorded maps it has 15 at most
_STEP = 0.5  # metres between a chain's points
_SMOOTHED = 3  # points to either side of which a point is the mean: polylines have corners
_SAMPLES = 24  # of a path that are compared with a chain
_CAPPED = 100.0  # m²
_YAW = 20.0  # m² per unit of 1 - cos
_OWN_TURN = 40.0  # m² per rad²
_ANY = ("", "")  # of lanes
_OWN_LANE = 25.0  # m² by which a lane that is not for cars, but for a vehicle's type, is preferred
_CHANGING = 4  # chains, the most alike, between which a change of lanes is looked for
_PRIOR, _CROSSED, _MET, _BEYOND, _FOLLOWED = (
    0.5,
    1.0,
    3.0,
    0.25,
    2.0,
)  # weights: the place; crossings driven, or beyond the ends; gaps
_STOPPED, _TURNED = (
    4.0,
    20.0,
)  # weights of a stop before a line, and of a begin from which a vehicle turns as it does
_OTHERWISE = math.radians(
    12.0
)  # that a vehicle turns more or less on a course, for which another begin is looked for
_BEFORE, _PASSED = (
    0.7,
    6.0,
)  # metres before a stop line where one stops; beyond it, where a stop is taken for one at it
_WORTH = 1.5  # m² that a change of lanes must gain
_TURN = math.radians(
    40.0
)  # a chain may turn by this much more or less than the vehicle in the template
_CROSS = math.radians(15.0)  # least angle of a crossing
_SAME = 2.0  # metres sideways within which two vehicles follow each other
_ROOM = 1.0  # metres between a footprint and the end of the lanes
_BLEND = 5.7735  # largest second derivative of x³(10 − 15x + 6x²)
_SHIFT = 0.02  # 1/m, curvature of a change of lanes
_FORTH = 25.0  # metres of lanes before and after what is driven
_LOST, _LOST_DRIVEN = (
    6.0,
    18.0,
)  # m² of a crossing that is none on the lanes: beyond the recorded ends; one that is driven
_SPEEDING = 0.1  # m² per (m/s)² beyond the speed limit
_BRAKED, _PULLED = (
    4.0,
    2.5,
)  # m/s² with which a vehicle slows down for a bend, and speeds up after it
_ASIDE = 3.0  # m/s² across, beyond which a bend counts against a place,
_BENDING = 1.0  # m² per m/s² beyond, and
_MOST_ASIDE = 10.0  # the most that counts
_NO_GRIP = 9.0  # m/s² across that no car can drive


@dataclass(frozen=True, eq=False)
class Course:
    """What one vehicle drives.

    Attributes:
        lanes: the chain of lanes.
        curve: their middle, around what is driven.
        start: arc length [m] on the curve at which the template begins.
        progress: (T,) metres from there at each of the template's samples.
    """

    lanes: tuple[int, ...]
    curve: Curve
    start: float
    progress: Floats

    @property
    def end(self) -> float:
        """Arc length [m] on the curve at which the template ends."""
        return self.start + float(self.progress[-1])

    @property
    def turn(self) -> float:
        """How far [rad, left positive] it turns."""
        start, end = self.curve.at(np.array([self.start, self.end]))[:, 2]
        return float(end - start)


@dataclass(frozen=True, eq=False)
class Match:
    """A course for every vehicle.

    Attributes:
        courses: one for each vehicle; () where there is none for somebody.
        cost: m², how badly they resemble the template.
        reason: why it cannot be had, or "".
        aside: m/s² of lateral acceleration that the template's speeds at the ends leave no way around (`pressed_aside`).
        off_own: m², by which places count as worse where somebody does not drive on lanes of its own.
    """

    courses: tuple[Course, ...]
    cost: float
    reason: str
    aside: float = 0.0
    off_own: float = 0.0


class Chains:
    """The chains of lanes of one network, and their middles, each computed once."""

    def __init__(self, network: LaneNetwork) -> None:
        self.network = network
        self.length = [float(edge_lengths(lane.centre).sum()) for lane in network.lanes]
        self.points = np.concatenate([lane.centre[:-1] for lane in network.lanes])
        self.yaws = np.concatenate([lane.yaw for lane in network.lanes])
        self.height = np.concatenate([lane.height[:-1] for lane in network.lanes])
        self.owner = np.repeat(
            np.arange(len(network.lanes)), [len(lane.yaw) for lane in network.lanes]
        )
        self._curves: dict[tuple[int, ...], Curve] = {}
        self._by_users: dict[frozenset[str], tuple[frozenset[int], frozenset[int]]] = {}

    def curve(self, chain: tuple[int, ...]) -> Curve:
        """The middle of a chain."""
        if chain not in self._curves:
            self._curves[chain] = middle(
                np.concatenate([self.network.lanes[k].centre for k in chain])
            )
        return self._curves[chain]

    def after(self, chain: Sequence[int]) -> list[int]:
        """The lanes that follow a chain and are not in it."""
        return [k for k in self.network.lanes[chain[-1]].successors if k not in chain]

    def closed_to(self, track: Track) -> frozenset[int]:
        """The lanes that a vehicle may not use."""
        return self._closed_and_own(track.vehicle.kind.lane_user)[0]

    def own_of(self, track: Track) -> frozenset[int]:
        """The lanes of a vehicle's own: those that it may use, and cars may not."""
        return self._closed_and_own(track.vehicle.kind.lane_user)[1]

    def _closed_and_own(self, users: frozenset[str]) -> tuple[frozenset[int], frozenset[int]]:
        if users not in self._by_users:
            closed = frozenset(
                k for k, lane in enumerate(self.network.lanes) if not lane.open_to(users)
            )
            not_for_cars = frozenset(
                k for k, lane in enumerate(self.network.lanes) if not lane.open_to(CARS)
            )
            self._by_users[users] = closed, not_for_cars - closed
        return self._by_users[users]

    def off_own(self, courses: Sequence[Course], tracks: Sequence[Track]) -> float:
        """What it counts [m²] that vehicles do not drive on lanes of their own."""
        own = map(self.own_of, tracks)
        off = [
            bool(lanes) and lanes.isdisjoint(course.lanes)
            for lanes, course in zip(own, courses, strict=True)
        ]
        return _OWN_LANE * sum(off) / len(tracks)

    def near(self, pose: Floats) -> list[int]:
        """Lanes that pass a pose (3,) x, y [m], yaw [rad] nearby, about its way; the nearest first."""
        away = np.hypot(self.points[:, 0] - pose[0], self.points[:, 1] - pose[1])
        fits = (away <= NEAR) & (np.abs(wrap_angle(self.yaws - pose[2])) <= _HEADING)
        nearest: dict[int, float] = {}
        for k in np.flatnonzero(fits).tolist():
            owner = int(self.owner[k])
            nearest[owner] = min(nearest.get(owner, math.inf), round(float(away[k]), 6))
        return sorted(nearest, key=lambda lane: (nearest[lane], lane))

    def from_lane(
        self, first: int, travelled: float, closed: Collection[int] = ()
    ) -> Iterator[tuple[int, ...]]:
        """Chains that begin before a lane and go on for what is travelled from it, or until the lanes that are not closed end."""
        before: tuple[int, ...] = ()
        reach, lane = 0.0, first
        while reach < _FORTH and (
            back := [k for k in self.network.predecessors[lane] if k not in closed]
        ):
            lane = back[0]
            if lane in before or lane == first:
                break
            before, reach = (lane, *before), reach + self.length[lane]
        open_chains: list[tuple[tuple[int, ...], float]] = [((first,), self.length[first])]
        for _ in range(_MOST_CHAINS):
            if not open_chains:
                break
            chain, length = open_chains.pop(0)
            after = [k for k in self.after(chain) if k not in closed]
            if not after or length > travelled + self.length[first] + _FORTH:
                yield tuple(k for k in before if k not in chain) + chain
            else:
                open_chains += [((*chain, k), length + self.length[k]) for k in after]


def middle(points: Floats) -> Curve:
    """A curve through the means of neighbouring points of a polyline (M, 2) [m]; its ends stay where they are."""
    rough = Curve.through(points)
    even = rough.cut(0.0, rough.length, _STEP).points[:, :2]
    index = np.arange(len(even))
    room = np.minimum(index, index[::-1])[
        :, None
    ]  # at the ends the window shrinks, on both sides alike
    offset = np.arange(-_SMOOTHED, _SMOOTHED + 1)
    return Curve.through(even[index[:, None] + np.clip(offset, -room, room)].mean(axis=1))


def match(
    chains: Chains,
    tracks: Sequence[Track],
    met: PairConflicts,
    spot: Spot,
    scale: float = 1.0,
    ends: Sequence[tuple[str, str]] = (),
    *,
    own: bool = False,
) -> Iterator[Match]:
    """Give every vehicle its course near a placement of the template as one piece.

    Yields one match, and where somebody turns otherwise there, another, in which it turns as it does: it may leave a crossing.

    Args:
        chains: of the map or the part of it.
        tracks: the template.
        met: its conflicts by their vehicles, see `track_conflicts`.
        spot: where it lies.
        scale: s of eq 9, of the distances driven.
        ends: by vehicle, the ids of the lanes by which it comes and goes, "" where any may be; (): any for all.
        own: whether vehicles that have lanes of their own are laid on these, wherever there are some nearby.
    """
    courses = []
    for track, named in zip(tracks, ends or [_ANY] * len(tracks), strict=True):
        by = (
            _ANY if own and chains.own_of(track) else named
        )  # other lanes than those by which cars come and go
        course = _course(chains, track, _placed(track, spot), scale, by, own=own)
        if course is None:
            yield Match(
                (),
                math.inf,
                f"no lanes lead along the path of vehicle {track.vehicle.id}, from its start to its end",
            )
            return
        courses.append(course)
    yield judged(
        chains,
        _tied(chains.network, courses, tracks, met, scale, [None] * len(courses)),
        tracks,
        spot,
    )
    begins = [_start_to_turn(course, track) for course, track in zip(courses, tracks, strict=True)]
    if any(begin is not None for begin in begins):
        yield judged(
            chains, _tied(chains.network, courses, tracks, met, scale, begins), tracks, spot
        )


def _placed(track: Track, spot: Spot) -> Floats:
    """Poses (K, 3) along a template's path, on the map."""
    poses = track.curve.at(np.linspace(0.0, track.travelled, 1 if track.still else _SAMPLES))
    return np.column_stack((spot.moved(poses[:, :2]), poses[:, 2] + spot.yaw))


def _course(
    chains: Chains, track: Track, poses: Floats, scale: float, ends: tuple[str, str], *, own: bool
) -> Course | None:
    """The chain of lanes that resembles a vehicle's path (K, 3) most, of those that come and go by lanes that are named."""
    lanes, closed, favoured = (
        chains.network.lanes,
        chains.closed_to(track),
        chains.own_of(track) if own else frozenset[int](),
    )
    exits = {k for k, lane in enumerate(lanes) if not ends[1] or lane.id == ends[1]}
    firsts = [k for k, lane in enumerate(lanes) if lane.id == ends[0]] or [
        k for k in chains.near(poses[0]) if k not in closed
    ]
    driven = scale * track.travelled
    tried: dict[tuple[int, ...], tuple[float, Curve, Floats]] = {}
    candidates = (
        chain
        for first in firsts
        for chain in chains.from_lane(first, driven, closed)
        if exits.intersection(chain)
    )
    for chain in dict.fromkeys(islice(candidates, _MOST_TRIED)):
        curve = _around(chains.curve(chain), poses, driven)
        misses = _misses(curve, poses)
        tried[chain] = (float(misses.mean()) + _turn_cost(curve, poses), curve, misses)
    length = chains.length
    on_own = {
        used: sum(length[k] for k in used if k in favoured) / sum(length[k] for k in used)
        for used in tried
    }
    ranked = sorted(
        tried, key=lambda chain: (round(tried[chain][0] - _OWN_LANE * on_own[chain], 6), chain)
    )
    if not ranked:
        return None
    cost, curve, _ = tried[ranked[0]]
    used = ranked[0]
    for before, after in (
        product(ranked[:_CHANGING], repeat=2) if not track.still and not on_own[used] else ()
    ):
        change = _change(tried[before][2], tried[after][2])
        if (
            change is not None
            and change[1] < cost - _WORTH
            and _beside(chains.network, before, after)
        ):
            changed = changed_curve(tried[before][1], tried[after][1], poses[change[0], :2])
            if changed is not None:
                cost, curve, used = change[1], changed, tuple(dict.fromkeys((*before, *after)))
    station, _ = curve.project(poses[:, :2])
    start = float(np.median(station - np.linspace(0.0, driven, len(station))))
    return Course(used, curve, start, scale * track.progress)


def _around(curve: Curve, poses: Floats, driven: float) -> Curve:
    """The part of a chain around a path (K, 3), with what lies before and after it."""
    station, _ = curve.project(poses[:1, :2])
    low, high = (
        max(float(station[0]) - _FORTH, 0.0),
        min(float(station[0]) + 1.1 * driven + 2.0 * _FORTH, curve.length),
    )
    return curve.cut(low, high) if high - low > _STEP else curve


def _turn_cost(curve: Curve, poses: Floats) -> float:
    """How differently [m²] a chain turns over a path."""
    station, _ = curve.project(poses[[0, -1], :2])
    yaw = curve.at(np.clip(station, 0.0, curve.length))[:, 2]
    return float(_OWN_TURN * np.square((yaw[1] - yaw[0]) - (poses[-1, 2] - poses[0, 2])))


def _misses(curve: Curve, poses: Floats) -> Floats:
    """How badly (K,) [m²] poses agree with a curve."""
    station, offset = curve.project(poses[:, :2])
    off = poses[:, 2] - curve.at(station)[:, 2]
    beyond = np.maximum(-station, 0.0) + np.maximum(station - curve.length, 0.0)
    return np.asarray(
        np.minimum(np.square(offset) + np.square(beyond), _CAPPED) + _YAW * (1.0 - np.cos(off))
    )


def _change(before: Floats, after: Floats) -> tuple[int, float] | None:
    """At which sample (not the first or last) to change from one chain to another, and the mean miss then [m²]."""
    forth = np.cumsum(before)[:-1] + (after.sum() - np.cumsum(after))[:-1]
    k = int(np.argmin(forth))
    return (k, float(forth[k]) / len(before)) if 2 <= k < len(before) - 3 else None


def _beside(network: LaneNetwork, chain: tuple[int, ...], other: tuple[int, ...]) -> bool:
    """Whether traffic may change from a chain to another."""
    return any(k in network.lanes[lane].beside for lane in chain for k in other)


def changed_curve(first: Curve, second: Curve, at: Floats) -> Curve | None:
    """A curve that changes smoothly (x³(10 − 15x + 6x²)) from one curve to another around a place (2,) [m]."""
    station = float(first.project(at[None])[0][0])
    _, offset = second.project(first.at(np.array([station]))[:, :2])
    width = abs(float(offset[0]))
    reach = math.sqrt(max(width, 0.1) * _BLEND / _SHIFT)
    s = np.arange(0.0, first.length + 1e-9, _STEP)
    here = first.at(s)
    there, _ = second.project(here[:, :2])
    x = np.clip((s - station) / reach + 0.5, 0.0, 1.0)
    share = x**3 * (10.0 - 15.0 * x + 6.0 * np.square(x))
    target = second.at(there)[:, :2]
    kept = (s < station) | ((there > 0.0) & (there < second.length))
    mixed = (here[:, :2] + share[:, None] * (target - here[:, :2]))[kept]
    return Curve.through(mixed) if len(mixed) > 3 else None


def _tied(
    network: LaneNetwork,
    courses: list[Course],
    tracks: Sequence[Track],
    met: PairConflicts,
    scale: float,
    begins: Sequence[float | None],
) -> list[Course]:
    """Shift the beginnings so that crossings and gaps on one lane are as far along as in the template (least squares).

    `begins` [m] are those from which vehicles turn as far as in the template, if any; they may leave a crossing behind.
    Who stops a little beyond a stop line in the template stops before it.
    """
    known = [Equation(((i, 1.0),), course.start, _PRIOR) for i, course in enumerate(courses)]
    crossing_of = {(a, b): crossing for a, b, crossing in pair_crossings(tracks)}
    for a in range(len(tracks)):
        for b in range(a):
            crossing = crossing_of.get((a, b))
            crossing_points = (
                crossings(courses[a].curve, courses[b].curve, _CROSS) if crossing else ()
            )
            if crossing and len(crossing_points):
                along = scale * np.array([crossing.first, crossing.second])
                target = np.array([courses[a].start, courses[b].start]) + along
                at = (
                    crossing_points[int(np.argmin(np.abs(crossing_points - target).sum(axis=1)))]
                    - along
                )
                weight = (
                    _CROSSED
                    if crossing.driven
                    else _MET
                    if (b, a) in met and not met[b, a].following
                    else _BEYOND
                )
                known += [
                    Equation(((i, 1.0),), float(station), weight)
                    for i, station in zip((a, b), at, strict=True)
                ]
            for first, second in ((a, b), (b, a)):
                gap = _follows(tracks[first], tracks[second])
                if gap is None:
                    continue
                station, offset = courses[second].curve.project(
                    courses[first].curve.at(np.array([courses[first].start]))[:, :2]
                )
                if (
                    abs(float(offset[0])) < _SAME
                ):  # of `first`, its start lies so far along the course of `second`
                    shift = float(station[0]) - courses[first].start
                    known.append(
                        Equation(((first, 1.0), (second, -1.0)), scale * gap - shift, _FOLLOWED)
                    )
    for i, (course, track, begin) in enumerate(zip(courses, tracks, begins, strict=True)):
        known += [] if begin is None else [Equation(((i, 1.0),), begin, _TURNED)]
        known += [
            Equation(((i, 1.0),), start, _STOPPED)
            for start in _starts_to_stop(network, course, track, scale)
        ]
    starts = solve_placement(range(len(courses)), known)
    return [replace(course, start=starts[i]) for i, course in enumerate(courses)]


def _starts_to_stop(
    network: LaneNetwork, course: Course, track: Track, scale: float
) -> Iterator[float]:
    """Begins [m] of a course from which a vehicle stops before a stop line that it passes a little before it stops."""
    rules = [
        rule
        for rule in network.rules
        if rule.kind == RuleKind.STOP and set(rule.lanes) & set(course.lanes)
    ]
    first = (
        [a for a, _ in runs((track.speed < WAIT_SPEED_MPS) & track.is_present)]
        if rules and not track.still
        else []
    )
    for rule in rules:
        station, offset = course.curve.project(rule.line.mean(axis=0)[None])
        if abs(float(offset[0])) > _SAME:
            continue
        for k in first:
            ahead = scale * float(track.progress[k]) + track.vehicle.length / 2.0
            beyond = course.start + ahead - float(station[0])
            if -_BEFORE < beyond < _PASSED:
                yield float(station[0]) - ahead - _BEFORE


def _start_to_turn(course: Course, track: Track) -> float | None:
    """The begin [m] nearest to a course's own from which it turns as the vehicle does; None if it does anyway, or from none."""
    turn, driven = float(np.mean(turns_to_keep(track))), float(course.progress[-1])
    if track.still or abs(course.turn - turn) < _OTHERWISE:
        return None
    starts = np.arange(0.0, max(course.curve.length - driven, 0.0), _STEP)
    more = course.curve.at(starts + driven)[:, 2] - course.curve.at(starts)[:, 2] - turn
    alike = starts[np.abs(more) < _OTHERWISE / 2.0]
    return float(alike[np.argmin(np.abs(alike - course.start))]) if len(alike) else None


def _follows(track: Track, leader: Track) -> float | None:
    """How far along the leader's path the track's path begins, if it begins on it."""
    start = track.curve.at(0.0)
    station, offset = leader.curve.project(start[None, :2])
    turned = abs(angle_between(leader.curve.at(float(station[0]))[2], start[2]))
    on = (
        abs(float(offset[0])) < _SAME
        and turned < math.radians(30.0)
        and 0.0 <= station[0] <= leader.travelled
    )
    return float(station[0]) if on else None


def judged(
    chains: Chains, courses: Sequence[Course], tracks: Sequence[Track], spot: Spot
) -> Match:
    """Say how well courses resemble the template, and what is lost."""
    cost, reason = 0.0, ""
    for course, track in zip(courses, tracks, strict=True):
        half = track.vehicle.length / 2.0 + _ROOM
        short = max(half - course.start, course.end + half - course.curve.length)
        if short > 0.0:
            reason = (
                reason or f"the lanes of vehicle {track.vehicle.id} end {short:.1f} m too soon"
            )
        if abs(course.turn - turn_of(track)) > _TURN:
            there = describe_turn(course.turn)
            reason = (
                reason
                or f"vehicle {track.vehicle.id} {describe_turn(turn_of(track))} in the recording, {there} there"
            )
        poses = _placed(track, spot)
        fitted = course.curve.at(np.linspace(course.start, course.end, len(poses)))
        miss = np.minimum(
            np.square(fitted[:, 0] - poses[:, 0]) + np.square(fitted[:, 1] - poses[:, 1]), _CAPPED
        )
        turned = 1.0 - np.cos(fitted[:, 2] - poses[:, 2])
        cost += float(miss.mean() + _YAW * turned.mean()) / len(tracks)
    for a, b, crossing in pair_crossings(tracks):
        if not len(crossings(courses[a].curve, courses[b].curve, _CROSS)):
            cost += _LOST_DRIVEN if crossing.driven else _LOST
    aside = [pressed_aside(course, track) for course, track in zip(courses, tracks, strict=True)]
    for (_, forced), track in zip(aside, tracks, strict=True):
        if forced > _NO_GRIP:
            reason = (
                reason or f"the lanes bend too sharply for the speed of vehicle {track.vehicle.id}"
            )
    cost += speeding(chains.network, courses, tracks) + bending([usual for usual, _ in aside])
    return Match(
        tuple(courses),
        cost,
        reason,
        max(forced for _, forced in aside),
        chains.off_own(courses, tracks),
    )


def pressed_aside(course: Course, track: Track) -> tuple[float, float]:
    """Return the largest lateral acceleration [m/s²], v² times curvature, that a vehicle has on a course.

    The first is that with the template's speeds; the second that with the least speeds which those at both ends allow, at
    `_BRAKED` from the first on and `_PULLED` up to the last: a bend may be driven more slowly than the template drives there,
    the ends may not.
    """
    driven = float(course.progress[-1])
    if track.still or driven < _STEP:
        return 0.0, 0.0
    at = np.linspace(0.0, driven, max(math.ceil(driven), 1) + 1)
    turned = np.abs(np.diff(course.curve.at(course.start + at)[:, 2]))
    curvature, middle_at = turned / np.diff(at), (at[1:] + at[:-1]) / 2.0
    speed = track.speed * (driven / float(track.progress[-1]))
    squared = np.square(np.interp(middle_at, course.progress, speed))
    first, last = float(np.square(speed[0])), float(np.square(speed[-1]))
    least = np.maximum(
        first - 2.0 * _BRAKED * middle_at, last - 2.0 * _PULLED * (driven - middle_at)
    ).clip(min=0.0)
    return float((curvature * squared).max()), float((curvature * least).max())


def bending(aside: Sequence[float]) -> float:
    """What it counts [m²] that bends would be driven faster than is comfortable; `aside` [m/s²] as of `pressed_aside`."""
    return _BENDING * float(np.mean(np.clip(np.array(aside) - _ASIDE, 0.0, _MOST_ASIDE)))


def speeding(network: LaneNetwork, courses: Sequence[Course], tracks: Sequence[Track]) -> float:
    """What it counts [m²] that vehicles would drive faster than the highest limit of their lanes."""
    over = []
    for course, track in zip(courses, tracks, strict=True):
        limit = max((network.lanes[k].speed_limit for k in course.lanes), default=math.nan)
        over.append(max(float(track.speed.max()) - limit, 0.0) if limit > 0.0 else 0.0)
    return _SPEEDING * float(np.mean(np.square(over)))
