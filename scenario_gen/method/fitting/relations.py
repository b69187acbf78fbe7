# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Which vehicles cross or share a lane in a template, and what that says of where they start on given routes."""

from dataclasses import dataclass
from enum import Enum
from itertools import combinations

import numpy as np

from scenario_gen.numerics import Floats, wrap_angle
from scenario_gen.numerics.curve import crossings, Curve
from scenario_gen.numerics.plane import angle_between
from scenario_gen.template import Equation, path_crossing, Track

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


def find_relations(tracks: tuple[Track, ...]) -> tuple[Relation, ...]:
    """One relation for each pair that shares a lane or crosses."""
    relations = (_relation(a, tracks[a], b, tracks[b]) for a, b in combinations(range(len(tracks)), 2))
    return tuple(relation for relation in relations if relation is not None)


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
    turned = abs(angle_between(track.curve.at(s)[2], pose[2]))
    on = abs(float(offset[0])) < _SAME_LANE and turned < _SAME_WAY and 0.0 <= s <= track.travelled
    return s if on else None


def equations(relation: Relation, first: Curve, second: Curve, scale: float) -> tuple[Equation, ...] | None:
    """The relation on two routes as equations, or None if these routes do not have it."""
    a, b, la, lb = relation.a, relation.b, scale * relation.at_a, scale * relation.at_b
    starts, ends = (float(np.hypot(*(first.points[k, :2] - second.points[k, :2]))) for k in (0, -1))
    if relation.kind is Kind.SHARED_START:
        return None if starts > _SAME_END else (Equation(((a, 1.0), (b, -1.0)), lb - la, 2.0),)
    if relation.kind is Kind.SHARED_END:
        if ends > _SAME_END or starts <= _SAME_END:  # they come from different lanes
            return None
        return (Equation(((a, 1.0), (b, -1.0)), (first.length - la) - (second.length - lb), 1.0),)
    found = crossings(first, second, _ANGLE)
    if len(found) == 0:
        found = _merging(first, second)
    if len(found) == 0:
        return None
    at_a, at_b = found[len(found) // 2]
    return (Equation(((a, 1.0),), float(at_a) - la, 1.0), Equation(((b, 1.0),), float(at_b) - lb, 1.0))


def _merging(first: Curve, second: Curve) -> Floats:
    """(1, 2) stations from which on two routes run in one lane, as in a roundabout; (0, 2) if they never do so."""
    s = np.arange(0.0, first.length, 1.0)
    poses = first.at(s)
    station, offset = second.project(poses[:, :2])
    same = (np.abs(offset) < 1.0) & (np.abs(wrap_angle(second.at(station)[:, 2] - poses[:, 2])) < _SAME_WAY)
    same &= (station > 0.0) & (station < second.length)
    if not same.any() or same[0]:
        return np.zeros((0, 2))
    begins = int(np.argmax(same))
    return np.array([[s[begins], station[begins]]])
