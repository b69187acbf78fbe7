# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How far along given ways through a junction each vehicle starts, and how much that resembles the template."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from scenario_gen.method.fitting.relations import equations, Relation
from scenario_gen.numerics import Floats, wrap_angle
from scenario_gen.numerics.curve import Curve
from scenario_gen.template import Equation, solve_starts, Track

_INSTANTS = 15
_LOST = 400.0  # cost [m²] of a relation that the routes do not have
FAR = 20.0  # metres: a mismatch of position counts no more than this
HEADING = 100.0  # m² per unit of 1 − cos
_OWN_TURN = 40.0  # m² per rad²: how much more or less a vehicle turns than in the template
WHOLE_TURN = 15.0  # the same for the whole way, driven or not
_ARM = 30.0  # m² per rad²: how differently two vehicles' entries are turned from each other
OWN_SLACK = np.radians(15.0)  # a road's corner may turn by this much more or less than the template
_OFF = 50.0  # cost per metre beyond the road's end
_TURNS = np.radians(15.0)  # more is a turn that has its place on the way
_TURN_WEIGHT = 2.0  # of that place, where the place of a crossing has 1


@dataclass(frozen=True, eq=False)
class Way:
    """A route that a vehicle could take."""

    entry: int
    leave: int
    curve: Curve
    turn: float


class Rigid(NamedTuple):
    """A similarity of the plane: points (..., 2) [m] go to points · matrix' + shift, headings turn by yaw [rad]."""

    matrix: Floats
    shift: Floats
    yaw: float

    def of(self, points: Floats) -> Floats:
        """Return where points (M, 2) [m] go."""
        return points @ self.matrix.T + self.shift


@dataclass(frozen=True, eq=False)
class Choice:
    """Ways for the vehicles assigned so far, with the arc lengths A at which they start."""

    ways: dict[int, Way]
    start: dict[int, float]
    cost: float
    lost: int
    beyond: float
    turned: float
    relations: int = 0


class Solver:
    """Distances along given ways, and how well the result resembles the template."""

    def __init__(self, tracks: tuple[Track, ...], relations: tuple[Relation, ...], scale: float) -> None:
        self.tracks, self.relations, self.scale = tracks, relations, scale
        instants = np.unique(np.linspace(0, len(tracks[0].progress) - 1, _INSTANTS).astype(np.int64))
        self.poses = np.stack([track.poses[instants] for track in tracks])
        self.driven = scale * np.stack([track.progress[instants] for track in tracks])
        self.cache: dict[tuple[int, int, int], tuple[Equation, ...] | None] = {}
        self.by_turn: dict[tuple[int, int], float] = {}

    def solve(self, ways: dict[int, Way]) -> Choice:
        """Return where along these ways, by vehicle, crossings, shared lanes and turns are as in the template; and its cost."""
        members = sorted(ways)
        system: list[Equation] = []
        lost = 0
        for k, relation in enumerate(self.relations):
            if relation.a in ways and relation.b in ways:
                equations = self._equations(k, relation, ways[relation.a], ways[relation.b])
                lost += equations is None
                system.extend(equations or ())
        for i in members:  # who turns does so where the way turns
            if abs(self._turn(i)) > _TURNS and abs(ways[i].turn) > _TURNS:
                key = (i, id(ways[i]))
                if key not in self.by_turn:
                    self.by_turn[key] = self.start_by_turn(i, ways[i].curve)
                system.append(Equation(((i, 1.0),), self.by_turn[key], _TURN_WEIGHT))
        start = _starts(members, system)
        if not start:  # nobody is tied down: who turns most is placed by its turn, the others beside it
            i = max(members, key=lambda i: (abs(self._turn(i)), self.driven[i, -1], -i))
            start[i] = self.start_by_turn(i, ways[i].curve)
        rigid = self.align(ways, start, members)
        untied = [i for i in members if i not in start]
        for i in untied:  # who has no equation is placed by its relative position
            station, _ = ways[i].curve.project(rigid.of(self.poses[i][::3, :2]))
            start[i] = float(np.median(station - self.driven[i][::3]))
        if untied:
            rigid = self.align(ways, start, members)
        return self._checked(ways, start, lost, rigid)

    def _equations(self, k: int, relation: Relation, first: Way, second: Way) -> tuple[Equation, ...] | None:
        key = (k, id(first), id(second))
        if key not in self.cache:
            self.cache[key] = equations(relation, first.curve, second.curve, self.scale)
        return self.cache[key]

    def _turn(self, i: int) -> float:
        return float(self.poses[i][-1, 2] - self.poses[i][0, 2])

    def start_by_turn(self, i: int, curve: Curve) -> float:
        """The start on a way that makes the vehicle turn where the way turns; on a straight one, its middle."""
        most = max(curve.length - float(self.driven[i, -1]), 0.0)
        if max(abs(self._turn(i)), abs(float(curve.points[-1, 2] - curve.points[0, 2]))) < _TURNS:
            return most / 2.0
        starts = np.linspace(0.0, most, int(np.ceil(most)) + 1)
        off = curve.at((starts[:, None] + self.driven[i]).ravel())[:, 2].reshape(len(starts), -1) - self.poses[i][:, 2]
        alike = np.hypot(
            np.cos(off).mean(axis=1), np.sin(off).mean(axis=1)
        )  # 1 where way and template differ by one rotation throughout
        best = starts[alike >= alike.max() - 1e-3]
        return float(best[np.argmin(np.abs(best - most / 2.0))])

    def align(self, ways: dict[int, Way], start: dict[int, float], members: list[int]) -> Rigid:
        """The rigid motion (Umeyama 1991, det R = +1, scale fixed) from the template to the vehicles placed so far."""
        known = [i for i in members if i in start]
        source = np.concatenate([self.poses[i] for i in known])
        target = np.concatenate([ways[i].curve.at(start[i] + self.driven[i]) for i in known])
        a, b = self.scale * source[:, :2], target[:, :2]
        ca, cb = a.mean(axis=0), b.mean(axis=0)
        u, v = a - ca, b - cb
        sine = float((u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]).sum()) + 10.0 * float(np.sin(target[:, 2] - source[:, 2]).sum())
        cosine = float((u * v).sum()) + 10.0 * float(np.cos(target[:, 2] - source[:, 2]).sum())
        yaw = float(np.arctan2(sine, cosine))
        rotation = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
        return Rigid(self.scale * rotation, cb - rotation @ ca, yaw)

    def _checked(self, ways: dict[int, Way], start: dict[int, float], lost: int, rigid: Rigid) -> Choice:
        """The cost of ways and starts: how unlike the template the vehicles are then, each seen from the others."""
        members = sorted(ways)
        cost, beyond, turned = _LOST * lost, 0.0, 0.0
        came = [float(ways[i].curve.points[0, 2] - self.poses[i][0, 2]) for i in members]
        for k in range(1, len(members)):
            apart = wrap_angle(np.array([came[k] - other for other in came[:k]]))
            cost += _ARM * float((np.square(apart)).sum()) / len(members)
        for i in members:
            curve = ways[i].curve
            fitted = curve.at(start[i] + self.driven[i])
            miss = np.hypot(*(fitted[:, :2] - self.poses[i][:, :2] @ rigid.matrix.T - rigid.shift).T)
            off = np.abs(wrap_angle(fitted[:, 2] - self.poses[i][:, 2] - rigid.yaw))
            own = float((fitted[-1, 2] - fitted[0, 2]) - (self.poses[i][-1, 2] - self.poses[i][0, 2]))
            whole = float(ways[i].turn - (self.poses[i][-1, 2] - self.poses[i][0, 2]))
            alike = np.mean(np.square(np.minimum(miss, FAR))) + HEADING * np.mean(1.0 - np.cos(off))
            alike += _OWN_TURN * np.square(own) + WHOLE_TURN * np.square(whole)
            cost += float(alike) / len(members)
            turned = max(turned, float(off.mean()), abs(own) - OWN_SLACK)
            half = self.tracks[i].vehicle.length / 2.0 + 0.5
            short = max(half - start[i], start[i] + float(self.driven[i][-1]) + half - curve.length, 0.0)
            beyond = max(beyond, short)
            cost += _OFF * short
        return Choice(ways, start, cost, lost, beyond, turned, len(self.relations))


def _starts(members: list[int], system: list[Equation]) -> dict[int, float]:
    """A for the vehicles that equations tie to the road (those tied only to each other are left out)."""
    absolute = {term[0] for e in system if len(e.terms) == 1 for term in e.terms}
    while True:  # who shares a lane with one that is tied down is tied down too
        more = {i for e in system if len(e.terms) == 2 and any(t[0] in absolute for t in e.terms) for i, _ in e.terms}
        if more <= absolute:
            break
        absolute |= more
    tied = [i for i in members if i in absolute]
    return solve_starts(tied, (e for e in system if all(i in absolute for i, _ in e.terms))) if tied else {}
