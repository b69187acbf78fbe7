# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A placement of a template on a road, its scale, and whether it keeps who comes from which side."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from itertools import combinations

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.fitting.config import FittingConfig
from scenario_gen.numerics import exact, Floats, frozen, wrap_angle
from scenario_gen.numerics.curve import crossings, Curve
from scenario_gen.roads import footprint_fits, nearest_pose_with_room
from scenario_gen.template import path_crossing, separate, smallest_gaps, Track
from scenario_gen.types import Loss, Road

SCALES = (1.0, 0.9, 1.1, 0.8, 1.2)  # that are tried, the best first
_LEAST_CLEARANCE = 0.1  # metres between fitted footprints, where the template's own are as near
_RELUCTANTLY = 0.1  # how readily a vehicle leaves the middle of its lane, where setting it forward or back does not do


@dataclass(frozen=True, eq=False)
class Placement:
    """N vehicles' motion on the road. It knows nothing of changepoints, so the ends do not depend on them.

    Attributes:
        tracks: paths on the road, and the progress along them at each of the template's samples.
        scale: (N,) s of eq 9.
        manoeuvre: what each vehicle does on the road.
        moved: (N,) metres by which whole paths were shifted to keep vehicles apart.
        notes: what was decided, in sentences.
        unused: arms of the road that nobody uses.
        at_home: the template is in its own frame, on the road that it was recorded on.
    """

    tracks: tuple[Track, ...]
    scale: Floats
    manoeuvre: tuple[str, ...]
    moved: Floats
    notes: tuple[str, ...]
    unused: tuple[Loss, ...] = ()
    at_home: bool = False

    @classmethod
    def of(cls, tracks: tuple[Track, ...], scale: float, notes: Iterable[str], manoeuvres: Iterable[str] | str) -> "Placement":
        """Return the placement of tracks that all have one scale, none of them shifted; one that stands throughout waits.

        Args:
            tracks: on the road.
            scale: s of eq 9.
            notes: what was decided, in sentences.
            manoeuvres: what each vehicle does if it does not wait, or what all do.
        """
        names = [manoeuvres] * len(tracks) if isinstance(manoeuvres, str) else manoeuvres
        waits = tuple("wait" if track.still else name for track, name in zip(tracks, names, strict=True))
        return cls(tracks, frozen(np.full(len(tracks), scale)), waits, frozen(np.zeros(len(tracks))), tuple(notes))


def check_scale(scale: float, what: str, config: FittingConfig) -> None:
    """Raise RefusedError if a scale is too far from one.

    Source: s of eq 9.
    """
    if not config.accepts(scale):
        raise RefusedError(
            f"{what} would need scale {scale:.2f}; accepted is {config.scale_low:g} to {config.scale_high:g} "
            f"(scale shrinks gaps but not cars)"
        )


def separated(placement: Placement, config: FittingConfig, *, sideways: float, own: Sequence[Track] = ()) -> Placement:
    """Shift vehicles that come too close on this road, as little as possible.

    Args:
        placement: where they are.
        config: how far apart they should be, and how far they may be moved.
        sideways: how readily a path is shifted across itself, 0 to 1.
        own: the template's tracks; where they are nearer to each other than `clearance`, so may these be.

    Raises:
        RefusedError: no shift up to `max_move` does it.
    """
    clearance = config.clearance
    if own:
        clearance = min(clearance, max(float(smallest_gaps(own).min()), _LEAST_CLEARANCE))
    try:
        separation = separate(placement.tracks, clearance, config.max_move, sideways=sideways)
    except RefusedError:
        if sideways > 0.0:
            raise
        separation = separate(placement.tracks, clearance, config.max_move, sideways=_RELUCTANTLY)
    return replace(
        placement,
        tracks=separation.tracks,
        moved=placement.moved + separation.moved,
        notes=(*placement.notes, *separation.notes),
    )


def share_with_room(road: Road, track: Track, every: int = 5) -> Floats:
    """Share (scalar array), 0 to 1, of the track's samples (every n-th and the last) at which its footprint has room."""
    poses = np.concatenate((track.poses[:-1:every], track.poses[-1:]))
    return np.asarray(footprint_fits(road, poses, track.vehicle.length, track.vehicle.width).mean())


def max_repair(tracks: Sequence[Track], road: Road, max_move: float) -> float:
    """How far [m] the worst sampled footprint (twice a second while it is there, and the ends) is from a pose with room.

    Raises:
        RefusedError: one is farther than `max_move`; the message names every such vehicle with time, place and distance, and what
            can be done.
    """
    farthest = 0.0
    astray = []
    for track in tracks:
        first, last = track.present.tolist()
        poses = track.poses
        worst, at = 0.0, first
        for t in sorted({first, last, *range(first, last + 1, 5)}):
            answer = nearest_pose_with_room(road, poses[t], track.vehicle.length, track.vehicle.width, max_move)
            if answer is None:
                answer = nearest_pose_with_room(road, poses[t], track.vehicle.length, track.vehicle.width, _LOOKED)
            away = np.inf if answer is None else answer[1]
            if away > worst:
                worst, at = away, t
            if worst > _LOOKED:
                break
        farthest = max(farthest, worst)
        if worst > max_move:
            far = f"{worst:.1f} m" if worst <= _LOOKED else f"more than {_LOOKED:g} m"
            x, y = poses[at, :2]
            astray.append(f"vehicle {track.vehicle.id} is {far} from any pose with room at sample {at} (x {x:.1f}, y {y:.1f})")
    if astray:
        ids = ", ".join(text.split(" ", 2)[1] for text in astray)
        remedy = (
            "the map is another one, or lies elsewhere"
            if len(astray) == len(tracks) > 1
            else f"set fitting.max_move to more, mend the map there, or leave {ids} out (log.vehicles names who is kept)"
        )
        raise RefusedError(f"on road {road.name} {'; '.join(astray)}; at most {max_move:g} m is bridged; {remedy}")
    return farthest


_LOOKED = 12.0  # metres within which a pose with room is looked for, to say how far it is
_SAME_LANE = 1.75  # metres
_SAME_END = 0.5  # metres between the ends of two routes in one lane
_SAME_WAY = np.radians(30.0)
_ANGLE = np.radians(15.0)


class Kind(Enum):
    """How two paths relate."""

    CROSSING = "crosses"
    SHARED_START = "shares its entry lane with"
    SHARED_END = "shares its exit lane with"


@dataclass(frozen=True)
class Relation:
    """Vehicles `a` and `b` (indices): at `at_a` and `at_b` metres of their paths they are at the same place."""

    kind: Kind
    a: int
    b: int
    at_a: float
    at_b: float


@dataclass(frozen=True, eq=False)
class Equation:
    """coefficients · A = value, with a weight."""

    terms: tuple[tuple[int, float], ...]
    value: float
    weight: float


def find_relations(tracks: tuple[Track, ...]) -> tuple[Relation, ...]:
    """One relation for each pair that shares a lane or crosses."""
    found = (_relation(a, tracks[a], b, tracks[b]) for a, b in combinations(range(len(tracks)), 2))
    return tuple(relation for relation in found if relation is not None)


def _relation(a: int, one: Track, b: int, two: Track) -> Relation | None:
    for first, second, x, y in ((a, b, one, two), (b, a, two, one)):  # does x start on y's path?
        at = _on_path(x.curve.at(0.0), y)
        if at is not None:
            return Relation(Kind.SHARED_START, first, second, 0.0, at)
    crossing = path_crossing(one, two)
    if crossing is not None:
        return Relation(Kind.CROSSING, a, b, crossing.first, crossing.second)
    for first, second, x, y in ((a, b, one, two), (b, a, two, one)):  # does x end on y's path?
        at = _on_path(x.curve.at(x.travelled), y)
        if at is not None and not x.still:
            return Relation(Kind.SHARED_END, first, second, x.travelled, at)
    return None


def _on_path(pose: Floats, track: Track) -> float | None:
    """The station [m] at which a pose (3,) is on a track's path, heading the same way; None if it is not."""
    station, offset = track.curve.project(pose[None, :2])
    s = float(station[0])
    turned = abs(float(wrap_angle(np.asarray(track.curve.at(s)[2] - pose[2]))))
    on = abs(float(offset[0])) < _SAME_LANE and turned < _SAME_WAY and 0.0 <= s <= track.travelled
    return s if on else None


def equations(relation: Relation, one: Curve, two: Curve, scale: float) -> tuple[Equation, ...] | None:
    """The relation on two routes as equations, or None if these routes do not have it."""
    a, b, la, lb = relation.a, relation.b, scale * relation.at_a, scale * relation.at_b
    starts, ends = (float(exact.hypot(*(one.points[k, :2] - two.points[k, :2]))) for k in (0, -1))
    if relation.kind is Kind.SHARED_START:
        return None if starts > _SAME_END else (Equation(((a, 1.0), (b, -1.0)), lb - la, 2.0),)
    if relation.kind is Kind.SHARED_END:
        if ends > _SAME_END or starts <= _SAME_END:  # they come from different lanes
            return None
        return (Equation(((a, 1.0), (b, -1.0)), (one.length - la) - (two.length - lb), 1.0),)
    found = crossings(one, two, _ANGLE)
    if len(found) == 0:
        found = _merging(one, two)
    if len(found) == 0:
        return None
    at_a, at_b = found[len(found) // 2]
    return (Equation(((a, 1.0),), float(at_a) - la, 1.0), Equation(((b, 1.0),), float(at_b) - lb, 1.0))


def _merging(one: Curve, two: Curve) -> Floats:
    """(1, 2) stations from which on two routes run in one lane, as in a roundabout; (0, 2) if they never do so."""
    s = np.arange(0.0, one.length, 1.0)
    poses = one.at(s)
    station, offset = two.project(poses[:, :2])
    same = (np.abs(offset) < 1.0) & (np.abs(wrap_angle(two.at(station)[:, 2] - poses[:, 2])) < _SAME_WAY)
    same &= (station > 0.0) & (station < two.length)
    if not same.any() or same[0]:
        return np.zeros((0, 2))
    first = int(np.argmax(same))
    return np.array([[s[first], station[first]]])
