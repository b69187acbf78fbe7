# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Do vehicles keep the traffic rules of a map? Who stops at a stop line, and who gives way to whom.

- A vehicle runs a stop line if its front crosses it, on a lane with a stop sign, without having stopped in the last metres.
- A vehicle takes another one's right of way if it comes from a lane that gives way to the other one's, goes first where their
  paths meet, and hinders the other one: that one follows closely, or waits.
- Traffic lights have no state. Signs hold, as where lights are off.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
import math

import numpy as np

from scenario_gen.numerics import Bools, Floats
from scenario_gen.numerics.plane import edge_lengths, meeting_shares, unit
from scenario_gen.roads.vector.ground import on_lane
from scenario_gen.situation import Conflict
from scenario_gen.types import LaneNetwork, RuleKind, Scenario, TrafficRule

_SUBJECT = (RuleKind.STOP, RuleKind.GIVE_WAY)
_REACH = 50.0  # metres driven between a lane with a rule and the conflict that it concerns
_HINDERED = 2.0  # s: who has the right of way comes this much later, or more, if not hindered
_NEAR = 10.0  # metres before the conflict where waiting is for the other one
_APPROACH = 8.0  # metres before a stop line where one stops, at most
_STOPPED = 0.5  # m/s
_PULLS_AWAY = 2.5  # m/s²
_SAME_WAY = 0.5  # cosine between a vehicle's direction and its lane's
_MET = 5.0  # s between two vehicles that meet


@dataclass(frozen=True)
class Breach:
    """A rule that a vehicle breaks.

    Attributes:
        time: s.
        vehicles: indices: who breaks it, and whose right of way it is.
        message: what happens, with the rule's name in the map.
    """

    time: float
    vehicles: tuple[int, ...]
    message: str


class RuleCheck:
    """Checks motions against the rules of a network.

    Attributes:
        rules: those that can be broken; none if the network's are not kept.
    """

    def __init__(self, network: LaneNetwork) -> None:
        self.network = network
        rules = network.rules if network.rules_kept else ()
        self._stops = [rule for rule in rules if rule.kind == RuleKind.STOP and len(rule.line)]
        self._ways = [rule for rule in rules if rule.kind in _SUBJECT and rule.over]
        self.rules = (*self._stops, *self._ways)
        self._subject = sorted({k for rule in self._ways for k in rule.lanes})
        self._first = sorted({k for rule in self._ways for k in rule.over})

    def breaches(self, scenario: Scenario, conflicts: Sequence[Conflict]) -> list[Breach]:
        """Return what breaks a rule.

        Args:
            scenario: in the map's frame.
            conflicts: where the paths of two of its vehicles meet; all of them (`find_conflicts`).
        """
        drives = [
            n for n, vehicle in enumerate(scenario.vehicles) if not vehicle.kind.walks
        ]  # the others know no such rules
        stops = [breach for n in drives for breach in self._runs(scenario, n)]
        met = [one for one in conflicts if {one.first, one.second} <= set(drives)]
        return [*stops, *(breach for one in met for breach in self._taken(scenario, one))]

    def kept_orders(self, scenario: Scenario, conflicts: Sequence[Conflict]) -> int:
        """Return at how many conflicts, where two meet within 5 s, the one who goes second has to give way."""
        met = [c for c in conflicts if c.encroachment < _MET]
        return len(
            [
                c
                for c in met
                if self._over(scenario, c.second, c.entry_second, c.first, c.entry_first)
            ]
        )

    def _runs(self, scenario: Scenario, n: int) -> Iterator[Breach]:
        """Stop lines that vehicle n crosses without a stop."""
        there = scenario.is_present[n]
        if not self._stops or there.sum() < 2:
            return
        heading, speed = scenario.heading[n, there], scenario.speed[n, there]
        front = scenario.position[n, there] + 0.5 * scenario.vehicles[n].length * unit(heading)
        driven = np.concatenate(([0.0], np.cumsum(edge_lengths(front))))
        for rule in self._stops:
            at = self._crossing(rule, front, heading)
            if at is None:
                continue
            before = (driven <= driven[at + 1]) & (driven >= driven[at] - _APPROACH)
            unseen = max(
                _APPROACH - float(driven[at]), 0.0
            )  # a stop there can have been before it came
            slowest = float(speed[before].min())
            if slowest > max(_STOPPED, math.sqrt(2.0 * _PULLS_AWAY * unseen)):
                message = f"crosses the stop line of {rule.id}; its minimum speed before it is {slowest:.1f} m/s"
                yield Breach(float(scenario.time[there][at]), (n,), message)

    def _crossing(self, rule: TrafficRule, front: Floats, heading: Floats) -> int | None:
        """The step in which a front (T, 2) [m] crosses a rule's line in the direction of one of its lanes."""
        low, high = rule.line.min(axis=0), rule.line.max(axis=0)
        if (front.max(axis=0) < low).any() or (front.min(axis=0) > high).any():
            return None
        p, u = front[:-1, None], np.diff(front, axis=0)[:, None]
        t, s, _ = meeting_shares(p, u, rule.line[None, :-1], np.diff(rule.line, axis=0)[None])
        with np.errstate(invalid="ignore"):
            steps = np.flatnonzero(((t >= 0.0) & (t < 1.0) & (s >= 0.0) & (s <= 1.0)).any(axis=1))
        for step in steps.tolist():
            if any(_same_way(self.network, k, front[step], heading[step]) for k in rule.lanes):
                return int(step)
        return None

    def _taken(self, scenario: Scenario, met: Conflict) -> Iterator[Breach]:
        """The right of way that the first one at a conflict takes from the second one."""
        rule = (
            self._over(scenario, met.first, met.entry_first, met.second, met.entry_second)
            if self._ways
            else None
        )
        if rule is None:
            return
        gap = met.arrival_gap if met.following else met.encroachment
        waits = _waits_before(scenario, met)
        if gap < _HINDERED or waits:
            how = "which waits for it" if waits else f"which follows after {gap:.1f} s"
            first, second = (scenario.vehicles[n].id for n in (met.first, met.second))
            message = (
                f"goes before vehicle {second}, {how}; by rule {rule.id} vehicle {first} gives way"
            )
            yield Breach(met.entry_first, (met.first, met.second), message)

    def _over(
        self, scenario: Scenario, who: int, entry: float, whom: int, other_entry: float
    ) -> TrafficRule | None:
        """The rule by which a vehicle gives way to another one, at a conflict that they enter at these times [s]."""
        own = self._lanes_before(scenario, who, entry, self._subject)
        others = (
            self._lanes_before(scenario, whom, other_entry, sorted({*self._first, *self._subject}))
            if own
            else set()
        )
        for rule in self._ways:
            if own & set(rule.lanes) and others & set(rule.over) and not others & set(rule.lanes):
                return rule
        return None

    def _lanes_before(
        self, scenario: Scenario, n: int, entry: float, lanes: Sequence[int]
    ) -> set[int]:
        """Those of some lanes on which a vehicle drives in the last metres before a time [s]."""
        steps = np.concatenate(([0.0], np.cumsum(edge_lengths(scenario.position[n]))))
        at = scenario.is_present[n] & (scenario.time <= entry + 1e-9)
        if not at.any():
            return set()
        at &= steps >= steps[at][-1] - _REACH
        poses = np.column_stack((scenario.position[n, at], scenario.heading[n, at]))
        return {k for k in lanes if on_lane(self.network.lanes[k], poses)}


def _same_way(network: LaneNetwork, lane: int, place: Floats, heading: float) -> bool:
    """Whether a vehicle at a place (2,) [m] drives about the way of a lane there."""
    away = np.square(network.lanes[lane].middle - place).sum(axis=1)
    return float(np.cos(network.lanes[lane].yaw[int(np.argmin(away))] - heading)) > _SAME_WAY


def _waits_before(scenario: Scenario, met: Conflict) -> bool:
    """Whether the second one at a conflict stands before it while the first one passes."""
    n, time = met.second, scenario.time
    passes: Bools = (
        scenario.is_present[n]
        & (time >= met.entry_first)
        & (time <= min(met.exit_first, met.entry_second))
    )
    if not passes.any():
        return False
    steps = np.concatenate(([0.0], np.cumsum(edge_lengths(scenario.position[n]))))
    near = steps >= float(np.interp(met.entry_second, time, steps)) - _NEAR
    return bool((scenario.speed[n, passes & near] < _STOPPED).any())
