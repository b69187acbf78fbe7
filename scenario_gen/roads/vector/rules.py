# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Whether vehicles obey the traffic rules of a map: stop lines and rights of way.

- A vehicle runs a stop line if its front crosses the line on a lane with a stop sign, and it has
  not stopped in the last metres.
- A vehicle violates the right of way of another one if it comes from a lane that gives way to the
  other's lane, goes first where their paths meet, and hinders the other one, which follows closely
  or waits.
- Signs apply as if lights were off; stop lines of lights are checked by the certificate.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
import math

import numpy as np

from scenario_gen.numerics import arc_lengths, Bools, Floats, meeting_shares, unit
from scenario_gen.roads.vector.ground import on_lane
from scenario_gen.roads.vector.signs import YIELDING_KINDS
from scenario_gen.situation import Conflict
from scenario_gen.types import LaneNetwork, Motion, RuleKind, TrafficRule


@dataclass(frozen=True)
class _Limits:
    """The bounds of obeying a rule."""

    lane_to_conflict_m: float = 50.0  # driven between a lane with a rule and the conflict
    hindered_gap_s: float = 2.0  # a vehicle that follows later is not hindered
    waiting_distance_m: float = 10.0  # before the conflict
    stop_distance_m: float = 8.0  # before a stop line
    stopped_mps: float = 0.5
    acceleration_mps2: float = 2.5  # from an unrecorded stop
    direction_cosine: float = 0.5  # between a vehicle and its lane
    meeting_gap_s: float = 5.0


_LIMITS = _Limits()


@dataclass(frozen=True)
class Breach:
    """A rule that a vehicle breaks.

    Attributes:
        time: [s].
        vehicles: indices of the vehicle that breaks it and, if any, of the one that it hinders.
        message: what happens, with the rule's name in the map.
    """

    time: float
    vehicles: tuple[int, ...]
    message: str


class RuleCheck:
    """Checks motions against the rules of a network.

    Attributes:
        network: its lanes and rules.
        rules: those that can be broken; none if the network's are not kept.
    """

    def __init__(self, network: LaneNetwork) -> None:
        self.network = network
        rules = network.rules if network.rules_kept else ()
        self._stops = [rule for rule in rules if rule.kind == RuleKind.STOP and len(rule.line)]
        self._rights = [rule for rule in rules if rule.kind in YIELDING_KINDS and rule.over]
        self.rules = (*self._stops, *self._rights)
        self._yielding = {k for rule in self._rights for k in rule.lanes}
        going_first = {k for rule in self._rights for k in rule.over}
        self._involved = np.array(sorted(going_first.union(self._yielding)), dtype=np.int64)
        boxes = np.array([network.lanes[k].box for k in self._involved]).reshape(-1, 2, 2)
        self._low, self._high = boxes[:, 0], boxes[:, 1]

    def breaches(self, motion: Motion, conflicts: Sequence[Conflict]) -> list[Breach]:
        """Return the breaches of rules.

        Args:
            motion: in the map's frame.
            conflicts: all of them (`find_conflicts`).
        """
        drivers = {n for n, vehicle in enumerate(motion.vehicles) if not vehicle.kind.walks}
        breaches = [breach for n in sorted(drivers) for breach in self._run_lines(motion, n)]
        for conflict in conflicts:
            if drivers.issuperset((conflict.first, conflict.second)):
                breaches += self._violated_right(motion, conflict)
        return breaches

    def kept_orders(self, motion: Motion, conflicts: Sequence[Conflict]) -> int:
        """Return the number of conflicts at which the second vehicle gives way by a rule.

        Only conflicts within a few seconds count.
        """
        kept = 0
        for met in conflicts:
            if met.encroachment < _LIMITS.meeting_gap_s:
                second, first = (met.second, met.entry_second), (met.first, met.entry_first)
                kept += self._rule_between(motion, second, first) is not None
        return kept

    def _run_lines(self, motion: Motion, n: int) -> Iterator[Breach]:
        """Yield the stop lines that vehicle n crosses without a stop."""
        present = motion.is_present[n]
        if not self._stops or present.sum() < 2:
            return
        heading, speed = motion.heading[n, present], motion.speed[n, present]
        half_length = 0.5 * motion.vehicles[n].length
        front = motion.position[n, present] + half_length * unit(heading)
        driven = arc_lengths(front)
        for rule in self._stops:
            k = self._crossing_step(rule, front, heading)
            if k is None:
                continue
            approach = (driven <= driven[k + 1]) & (driven >= driven[k] - _LIMITS.stop_distance_m)
            # The vehicle can have stopped before the record begins.
            unrecorded = max(_LIMITS.stop_distance_m - float(driven[k]), 0.0)
            after_stop = math.sqrt(2.0 * _LIMITS.acceleration_mps2 * unrecorded)
            slowest = float(speed[approach].min())
            if slowest > max(_LIMITS.stopped_mps, after_stop):
                message = (
                    f"crosses the stop line of {rule.id}; its minimum speed before it is "
                    f"{slowest:.1f} m/s"
                )
                yield Breach(float(motion.time[present][k]), (n,), message)

    def _crossing_step(self, rule: TrafficRule, front: Floats, heading: Floats) -> int | None:
        """Return the step in which a front (T, 2) [m] crosses a rule's line along its lanes."""
        low, high = rule.line.min(axis=0), rule.line.max(axis=0)
        if (front.max(axis=0) < low).any() or (front.min(axis=0) > high).any():
            return None
        steps, edges = np.diff(front, axis=0)[:, None], np.diff(rule.line, axis=0)[None]
        t, s, _ = meeting_shares(front[:-1, None], steps, rule.line[None, :-1], edges)
        with np.errstate(invalid="ignore"):
            crosses = ((t >= 0.0) & (t < 1.0) & (s >= 0.0) & (s <= 1.0)).any(axis=1)
        for k in np.flatnonzero(crosses).tolist():
            if any(self._drives_along(lane, front[k], heading[k]) for lane in rule.lanes):
                return int(k)
        return None

    def _drives_along(self, lane: int, place: Floats, heading: float) -> bool:
        """Return whether a vehicle at a place (2,) [m] drives in about the direction of a lane."""
        distance = np.square(self.network.lanes[lane].middle - place).sum(axis=1)
        yaw = self.network.lanes[lane].yaw[int(np.argmin(distance))]
        return float(np.cos(yaw - heading)) > _LIMITS.direction_cosine

    def _violated_right(self, motion: Motion, met: Conflict) -> Iterator[Breach]:
        """Yield the right of way that the first vehicle at a conflict violates."""
        if not self._rights:
            return
        gap = met.arrival_gap if met.following else met.encroachment
        waits = _waits_before(motion, met)
        if not waits and gap >= _LIMITS.hindered_gap_s:
            return
        first, second = (met.first, met.entry_first), (met.second, met.entry_second)
        rule = self._rule_between(motion, first, second)
        if rule is not None:
            hindered = "which waits for it" if waits else f"which follows after {gap:.1f} s"
            ids = [motion.vehicles[n].id for n in (met.first, met.second)]
            message = (
                f"goes before vehicle {ids[1]}, {hindered}; by rule {rule.id} vehicle {ids[0]} "
                "gives way"
            )
            yield Breach(met.entry_first, (met.first, met.second), message)

    def _rule_between(
        self, motion: Motion, yielding: tuple[int, float], other: tuple[int, float]
    ) -> TrafficRule | None:
        """Return the rule by which a vehicle gives way to another one at a conflict.

        Each is given by its index and the time [s] at which it enters the conflict area.
        """
        lanes = self._lanes_before(motion, *yielding) & self._yielding
        if not lanes:
            return None
        other_lanes = self._lanes_before(motion, *other)
        for rule in self._rights:
            goes_first = other_lanes & set(rule.over) and not other_lanes & set(rule.lanes)
            if lanes & set(rule.lanes) and goes_first:
                return rule
        return None

    def _lanes_before(self, motion: Motion, n: int, entry: float) -> set[int]:
        """Return which lanes of rules a vehicle drives on in the last metres before a time [s]."""
        first, last = motion.present[n].tolist()
        end = min(int(np.searchsorted(motion.time, entry + 1e-9, side="right")), last + 1)
        if end <= first:
            return set()
        driven = arc_lengths(motion.position[n, :end])
        begin = int(np.searchsorted(driven, driven[-1] - _LIMITS.lane_to_conflict_m))
        before = slice(max(begin, first), end)
        poses = np.column_stack((motion.position[n, before], motion.heading[n, before]))
        low, high = poses[:, :2].min(axis=0), poses[:, :2].max(axis=0)
        near = ((self._low <= high) & (self._high >= low)).all(axis=1)
        lanes = self._involved[near].tolist()
        return {k for k in lanes if on_lane(self.network.lanes[k], poses)}


def _waits_before(motion: Motion, met: Conflict) -> bool:
    """Return whether the second vehicle stands before a conflict while the first one passes."""
    n, time = met.second, motion.time
    last = min(met.exit_first, met.entry_second)
    passing: Bools = motion.is_present[n] & (time >= met.entry_first) & (time <= last)
    stands = passing & (motion.speed[n] < _LIMITS.stopped_mps)
    if not stands.any():
        return False
    driven = arc_lengths(motion.position[n])
    near = driven >= np.interp(met.entry_second, time, driven) - _LIMITS.waiting_distance_m
    return bool((stands & near).any())
