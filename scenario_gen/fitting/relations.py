# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""What the template's vehicles are to each other, as equations on where they stand along their routes.

Vehicle i is at arc length A_i + s·l_i(t) of its route. Arrival times at a conflict are the interaction, so distances along
the route to it are kept: each relation gives one or two linear equations in A.
"""

from dataclasses import dataclass
from enum import Enum

import numpy as np

from scenario_gen import exact
from scenario_gen.arrays import Floats, wrap_angle
from scenario_gen.roads.curve import crossings, Curve
from scenario_gen.roads.meeting import meeting
from scenario_gen.roads.tracks import Track

_SAME_LANE = 1.75  # metres
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
    found = []
    for a in range(len(tracks)):
        for b in range(a + 1, len(tracks)):
            relation = _relation(a, tracks[a], b, tracks[b])
            if relation is not None:
                found.append(relation)
    return tuple(found)


def _relation(a: int, one: Track, b: int, two: Track) -> Relation | None:
    for first, second, x, y in ((a, b, one, two), (b, a, two, one)):  # does x start on y's path?
        at = _on_path(x.curve.at(0.0), y, beyond=0.0)
        if at is not None:
            return Relation(Kind.SHARED_START, first, second, 0.0, at)
    met = meeting(one, two)
    if met is not None:
        return Relation(Kind.CROSSING, a, b, met.first, met.second)
    for first, second, x, y in ((a, b, one, two), (b, a, two, one)):  # does x end on y's path?
        at = _on_path(x.curve.at(x.travelled), y, beyond=0.0)
        if at is not None and not x.still:
            return Relation(Kind.SHARED_END, first, second, x.travelled, at)
    return None


def _on_path(pose: Floats, track: Track, beyond: float) -> float | None:
    station, offset = track.curve.project(pose[None, :2])
    s = float(station[0])
    turned = abs(float(wrap_angle(np.asarray(track.curve.at(s)[2] - pose[2]))))
    on = abs(float(offset[0])) < _SAME_LANE and turned < _SAME_WAY and -beyond <= s <= track.travelled + beyond
    return s if on else None


def equations(relation: Relation, one: Curve, two: Curve, scale: float) -> tuple[Equation, ...] | None:
    """The relation on two routes as equations, or None if these routes do not have it."""
    a, b, la, lb = relation.a, relation.b, scale * relation.at_a, scale * relation.at_b
    if relation.kind is Kind.SHARED_START:
        if float(exact.hypot(*(one.points[0, :2] - two.points[0, :2]))) > 0.5:
            return None
        return (Equation(((a, 1.0), (b, -1.0)), lb - la, 2.0),)
    if relation.kind is Kind.SHARED_END:
        if float(exact.hypot(*(one.points[-1, :2] - two.points[-1, :2]))) > 0.5:
            return None
        return (Equation(((a, 1.0), (b, -1.0)), (one.length - la) - (two.length - lb), 1.0),)
    found = crossings(one, two, _ANGLE)
    if len(found) == 0:
        return None
    at_a, at_b = found[len(found) // 2]
    return (Equation(((a, 1.0),), float(at_a) - la, 1.0), Equation(((b, 1.0),), float(at_b) - lb, 1.0))
