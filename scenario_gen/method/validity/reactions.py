# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The certificate of interaction: yielding, following, no tailgating, and waiting at red."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
import math

import numpy as np

from scenario_gen.method.validity.limits import Limits
from scenario_gen.numerics import Floats
from scenario_gen.numerics.rounding import ROUNDING_M, ROUNDING_S
from scenario_gen.situation import (
    Conflict,
    departure,
    faced_light,
    LaneGaps,
    passing,
    runs_red,
    time_gaps,
    WAIT_SPEED_MPS,
)
from scenario_gen.types import (
    Cause,
    FOLLOW,
    Reaction,
    Scenario,
    SignalStop,
    TrafficLight,
    Violation,
)


@dataclass(frozen=True)
class _Following:
    """What counts as a gap that a driver keeps.

    Attributes:
        similar_speed: m/s within which recorded gaps apply; recordings are too short for less.
        moving_speed: m/s above which a time gap is meaningful.
        tolerance: metres; gaps at the samples differ by this from those in between.
        ample_gap, ample_time_gap: m and s; a larger gap is not kept because it is needed.
    """

    similar_speed: float = 2.0
    moving_speed: float = 3.0
    tolerance: float = 0.05
    ample_gap: float = 4.0
    ample_time_gap: float = 1.5


_FOLLOWING = _Following()
_EVENT_ROUNDING_S = 0.1  # an entry or a clearing is known to a sample


def broken_reactions(
    scenario: Scenario,
    conflicts: Sequence[Conflict | None],
    edges: Sequence[Reaction],
    limits: Limits,
    gaps: LaneGaps,
) -> Iterator[Violation]:
    """Yield the reactions of a template that a scenario does not keep.

    Args:
        scenario: the vehicles.
        conflicts: the scenario's conflicts that the template has, too.
        edges: the reactions.
        limits: shares and tolerances.
        gaps: between the scenario's followers and leaders.
    """
    known = (conflict for conflict in conflicts if conflict is not None)
    by_pair = {(conflict.second, conflict.first): conflict for conflict in known}
    for edge in edges:
        pair = (edge.who, edge.whom)
        message = ""
        time = 0.0
        if edge.kind == FOLLOW:
            message = _following_fault(scenario, edge, limits, gaps)
        elif edge.gap == math.inf:
            continue  # it stops, which is a wait, or does not go first, which is an order
        elif pair not in by_pair:
            leader = scenario.vehicles[edge.whom].id
            message = f"does not pass behind vehicle {leader}, for which it waits in the recording"
        else:
            message, time = _yielding_fault(scenario, by_pair[pair], edge, limits)
        if message:
            vehicle = scenario.vehicles[edge.who].id
            yield Violation(Cause.REACTION, time, pair, f"vehicle {vehicle}: {message}")


def _following_fault(
    scenario: Scenario, edge: Reaction, limits: Limits, lane_gaps: LaneGaps
) -> str:
    """Return how a follower falls back too far, "" if it does not."""
    gaps = time_gaps(lane_gaps, edge.who, edge.whom)
    high = (1.0 + limits.headway_share) * edge.headway[2]
    if not len(gaps) or gaps.max() <= high + ROUNDING_S:
        return ""
    leader = scenario.vehicles[edge.whom].id
    return f"drives up to {gaps.max():.2f} s behind vehicle {leader}; at most {high:.2f} s allowed"


def _yielding_fault(
    scenario: Scenario, conflict: Conflict, edge: Reaction, limits: Limits
) -> tuple[str, float]:
    """Return how a yielder enters or leaves too early or too late ("" if not), and when [s]."""
    other = scenario.vehicles[edge.whom].id
    clears, enters = passing(scenario, conflict, merges=edge.merges)
    gap = enters - clears
    low, high = allowed_gap(edge, limits)
    message = ""
    if not low - _EVENT_ROUNDING_S <= gap <= high + ROUNDING_S:
        message = (
            f"enters {gap:.2f} s after vehicle {other} has cleared; "
            f"{low:.2f} to {high:.2f} s allowed"
        )
    if edge.stands:
        lead = clears - departure(scenario, edge.who, enters)
        max_lead = max(-edge.lag, 0.0) + limits.anticipation
        if lead > max_lead + ROUNDING_S:
            message = (
                f"leaves {lead:.2f} s before vehicle {other} has cleared; "
                f"at most {max_lead:.2f} s allowed"
            )
    return message, enters


def allowed_gap(edge: Reaction, limits: Limits) -> tuple[float, float]:
    """Return the least and the greatest gap [s] of a yielder behind the other vehicle."""
    low = min(edge.gap, max((1.0 - limits.gap_share) * edge.gap - limits.anticipation, 0.0))
    return low, (1.0 + limits.gap_share) * max(edge.gap, 0.0) + limits.patience


def tailgaters(
    scenario: Scenario, gaps: LaneGaps, recorded: LaneGaps, limits: Limits
) -> Iterator[Violation]:
    """Yield the vehicles that, at the samples, follow closer than they do in the template."""
    none = (np.zeros(0), np.zeros(0))
    for pair, (speeds, bumper_gaps) in gaps.items():
        close = bumper_gaps < np.maximum(_ample_gap(speeds), limits.least_headway * speeds)
        if not close.any():
            continue
        speed, gap = speeds[close], bumper_gaps[close]
        floor = least_gaps(speed, *recorded.get(pair, none), limits)
        k = int(np.argmax(floor - gap))
        if floor[k] - gap[k] > _FOLLOWING.tolerance:
            follower, leader = (scenario.vehicles[n].id for n in pair)
            message = (
                f"vehicle {follower}: comes within {gap[k]:.2f} m of vehicle {leader} ahead at "
                f"{speed[k]:.1f} m/s; the recorded minimum allows {floor[k]:.2f} m"
            )
            yield Violation(Cause.REACTION, 0.0, pair, message)


def least_gaps(speed: Floats, recorded: Floats, gap: Floats, limits: Limits) -> Floats:
    """Return the smallest allowed bumper-to-bumper gaps (k,) [m].

    Args:
        speed: (k,) m/s of a follower.
        recorded: (m,) m/s of its driver in the template.
        gap: (m,) metres at these speeds.
        limits: shares and time gaps.
    """
    order = np.argsort(recorded)
    recorded, gap = recorded[order], gap[order]
    reach, moving = _FOLLOWING.similar_speed + ROUNDING_M, _FOLLOWING.moving_speed
    first = np.searchsorted(recorded, speed - reach)
    last = np.searchsorted(recorded, speed + reach, side="right")
    ranges = np.column_stack((first, last)).ravel()

    def least(values: Floats) -> Floats:
        """Return the least of the values (m,) at similar speeds (k,), inf without one."""
        minima = np.minimum.reduceat(np.append(values, np.inf), ranges)[::2]
        return np.where(first < last, minima, np.inf)

    smallest = least(gap)
    time_gap = np.where(recorded > moving, gap / np.maximum(recorded, moving), np.inf)
    kept = np.minimum(limits.floor_share * smallest, _ample_gap(speed))
    kept = np.where(np.isfinite(smallest), kept, -np.inf)

    keeps_headway = least(time_gap) >= limits.least_headway - ROUNDING_S
    headway = limits.least_headway * speed
    return np.where((speed > moving) & keeps_headway, np.maximum(kept, headway), kept)


def _ample_gap(speed: Floats) -> Floats:
    """Return the gaps (k,) [m] that are ample at speeds (k,) [m/s]."""
    return _FOLLOWING.ample_gap + _FOLLOWING.ample_time_gap * speed


def light_violations(
    scenario: Scenario, at_red: Collection[int], stops: Sequence[SignalStop]
) -> Iterator[Violation]:
    """Yield the vehicles that cross a stop line at red, and those that do not wait at red.

    Args:
        scenario: the vehicles, with the lights of the road.
        at_red: vehicles that may run red, as they do in the template.
        stops: of the template, for lights.
    """
    lights = scenario.facts.lights
    if not lights:
        return
    for n, vehicle in enumerate(scenario.vehicles):
        for light in () if vehicle.kind.walks or n in at_red else lights:
            # The light may not be red within 2 ms of the crossing either.
            time = runs_red(scenario, n, light, 0.002)
            if not math.isnan(time):
                message = f"vehicle {vehicle.id}: crosses the stop line of light {light.id} at red"
                yield Violation(Cause.TRAFFIC_RULE, time, (n,), message)
    for stop in stops:
        passed = _light_without_wait(scenario, stop)
        if passed is not None:
            message = (
                f"vehicle {scenario.vehicles[stop.who].id}: does not wait while light {passed.id} "
                "is red, as it does in the recording"
            )
            yield Violation(Cause.STOP_NOT_KEPT, 0.0, (stop.who,), message)


def _light_without_wait(scenario: Scenario, stop: SignalStop) -> TrafficLight | None:
    """Return the light for which a vehicle should wait at red but does not."""
    faced = faced_light(scenario, stop.who, scenario.facts.lights) if stop.stands else None
    if faced is None:
        return None
    light, crosses = faced
    waits = scenario.is_present[stop.who] & (scenario.speed[stop.who] < WAIT_SPEED_MPS)
    times = scenario.time[waits & (scenario.time <= crosses)].tolist()
    return None if any(light.schedule.at(time).stops for time in times) else light
