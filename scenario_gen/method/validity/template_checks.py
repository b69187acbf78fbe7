# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Checks of a scenario against its template and request: presence, states, waits and order.

The certificate of interaction: yielding, following, no tailgating, and waiting at red.
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
import math

import numpy as np

from scenario_gen.method.validity.limits import Limits
from scenario_gen.numerics import Bools, edge_lengths, Floats, runs
from scenario_gen.numerics.rounding import ROUNDING_M, ROUNDING_S
from scenario_gen.situation import (
    Abreast,
    Conflict,
    departure,
    faced_light,
    LaneGaps,
    MAX_CLEARANCE_CHANGE_M,
    passing,
    runs_red,
    time_gaps,
    Wait,
    WAIT_SPEED_MPS,
)
from scenario_gen.types import (
    at_ends,
    BoundaryStates,
    Cause,
    FOLLOW,
    Reaction,
    Scenario,
    SignalStop,
    TrafficLight,
    Violation,
)


def presence_violations(scenario: Scenario, ends: Bools) -> Iterator[Violation]:
    """Yield vehicles that enter or leave, though the template has them at its start or end.

    Otherwise a standing vehicle could vanish at once: its first and last state would be as
    requested, and no other vehicle would meet it.

    Args:
        scenario: the vehicles.
        ends: (N, 2) whether each is present at the template's first and last instant.
    """
    missing = ends & ~at_ends(scenario.present, len(scenario.time))
    for i, k in np.argwhere(missing).tolist():
        time = float(scenario.time[scenario.present[i, k]])
        fault = f"enters at {time:.3f} s; in the recording it is present from the start"
        if k == 1:
            fault = f"leaves at {time:.3f} s; in the recording it is present until the end"
        yield Violation(Cause.BOUNDARY_STATE, time, (i,), f"vehicle {i}: {fault}")


def state_violations(
    scenario: Scenario, requested: BoundaryStates, limits: Limits
) -> Iterator[Violation]:
    """Yield the start and end states that differ from the requested ones by too much."""
    for name, k, states in (("start", 0, requested.start), ("end", -1, requested.end)):
        # outside of its presence the first or last state of a vehicle is repeated
        position, speed = scenario.position[:, k], scenario.speed[:, k]
        distance = np.hypot(*(position - states[:, :2]).T)
        difference = np.abs(speed - states[:, 3])
        for i in range(len(states)):
            step_m, step_mps = _change_in_a_step(scenario, i, k)
            free_m, free_mps = requested.relaxed[i, k].tolist()
            far = step_m + free_m + limits.position_tolerance + ROUNDING_M
            fast = step_mps + free_mps + limits.speed_tolerance + ROUNDING_M
            if distance[i] <= far and difference[i] <= fast:  # NaN fails
                continue
            message = (
                f"vehicle {i}: {name} is {distance[i]:.3f} m and {difference[i]:.3f} m/s "
                "from the request"
            )
            if free_m or free_mps:
                message += f" ({free_m:.3f} m and {free_mps:.3f} m/s are free)"
            time = float(scenario.time[scenario.present[i, k]])
            yield Violation(Cause.BOUNDARY_STATE, time, (i,), message)


def _change_in_a_step(scenario: Scenario, i: int, k: int) -> tuple[float, float]:
    """Metres and m/s by which vehicle i changes in a step, where it enters or leaves; else 0.

    It enters and leaves between two samples, and is shown from the first sample after it entered
    until the last one before it left.
    """
    at = int(scenario.present[i, k])
    if at in {0, len(scenario.time) - 1}:
        return 0.0, 0.0
    beyond = at - 1 if k == 0 else at + 1
    step = abs(float(scenario.time[beyond] - scenario.time[at]))
    return step * float(scenario.speed[i, at]), step * abs(float(scenario.acceleration[i, at]))


def order_violations(
    recorded: Sequence[Conflict],
    required: Sequence[int | None],
    conflicts: Sequence[Conflict | None],
) -> Iterator[Violation]:
    """Yield the conflicts that are passed in another order than required.

    Args:
        recorded: the template's conflicts.
        required: the vehicle that must go first at each of them; None: either one.
        conflicts: the same conflicts in the scenario; None where the vehicles do not meet.
    """
    for template, first, conflict in zip(recorded, required, conflicts, strict=True):
        swapped = first == template.second
        expected = "the request is that" if swapped else "in the recording"
        if conflict is None:
            if swapped:
                a, b = template.pair
                message = (
                    f"vehicles {a} and {b} do not meet; {expected} vehicle {first} goes first"
                )
                yield Violation(Cause.PASSING_ORDER, 0.0, (a, b), message)
        elif first is not None and conflict.first != first:
            message = (
                f"vehicle {conflict.first} goes first ({conflict.entry_first:.2f} s, "
                f"vehicle {conflict.second} {conflict.entry_second:.2f} s); "
                f"{expected} vehicle {first} does"
            )
            pair = (conflict.first, conflict.second)
            yield Violation(Cause.PASSING_ORDER, conflict.entry_first, pair, message)


def clearance_violations(scenario: Scenario, abreast: Sequence[Abreast]) -> Iterator[Violation]:
    """Yield the pairs side by side in one lane that are nearer, farther or on the other side.

    A pair is not compared where it hardly shares a lane.
    """
    for each in abreast:
        a, b = each.pair
        first, second = (scenario.poses[n][scenario.is_present[n]] for n in each.pair)
        change = (each.offset_on(first, second) - each.offset) * np.sign(each.offset)
        if abs(change) > MAX_CLEARANCE_CHANGE_M:  # NaN passes
            message = (
                f"vehicle {b}: drives {each.clearance + change:.2f} m beside vehicle {a}; "
                f"{each.clearance:.2f} ± {MAX_CLEARANCE_CHANGE_M:g} m is allowed"
            )
            time = float(scenario.time[scenario.present[b, 0]])
            yield Violation(Cause.SIDE_CLEARANCE, time, each.pair, message)


def wait_violations(
    scenario: Scenario, waits: Sequence[Wait], requested: BoundaryStates | None, limits: Limits
) -> Iterator[Violation]:
    """Yield the vehicles that wait less often than in the template."""
    for i in sorted({wait.vehicle for wait in waits}):
        recorded = [wait for wait in waits if wait.vehicle == i]
        throughout = [tuple(scenario.present[i].tolist())]
        if (
            _waits_throughout(scenario, recorded[0], requested, limits)
            and _slow_spans(scenario, i, limits.stand_speed) != throughout
        ):
            k = int(np.argmax(scenario.speed[i]))
            message = (
                f"vehicle {i}: waits throughout in the recording, "
                f"but reaches {scenario.speed[i, k]:.3f} m/s"
            )
            yield Violation(Cause.STOP_NOT_KEPT, float(scenario.time[k]), (i,), message)
            continue
        standing = [wait for wait in recorded if not wait.moves_slowly]
        violation = _missing_wait(scenario, standing, "stands", limits.stand_speed, limits)
        if violation is None:
            violation = _missing_wait(scenario, recorded, "waits", limits.creep_speed, limits)
        if violation is not None:
            yield violation


def _missing_wait(
    scenario: Scenario, waits: Sequence[Wait], verb: str, speed: float, limits: Limits
) -> Violation | None:
    """Return the first of one vehicle's waits for which it is not below a speed [m/s].

    A stand serves as many consecutive waits as it is long: a short twitch may separate those of
    the template.
    """
    if not waits:
        return None
    i = waits[0].vehicle
    spans = _slow_spans(scenario, i, speed)
    lengths = [float(scenario.time[b] - scenario.time[a]) for a, b in spans]
    served = sum(int((length + ROUNDING_S) / limits.stand_duration) for length in lengths)
    if served >= len(waits):
        return None
    durations = ", ".join(f"{length:.1f} s" for length in lengths) or "less than two samples"
    message = (
        f"vehicle {i}: {verb} {len(waits)} time(s) in the recording, "
        f"but is below {speed:g} m/s for {durations}"
    )
    return Violation(Cause.STOP_NOT_KEPT, waits[served].start, (i,), message)


def _slow_spans(scenario: Scenario, i: int, limit: float) -> list[tuple[int, int]]:
    """First and last sample of each time in which neither speed nor displacement reach a limit."""
    slow = (scenario.speed[i] < limit) & scenario.is_present[i]
    moved = edge_lengths(scenario.position[i])
    still = slow[:-1] & slow[1:] & (moved < limit * np.diff(scenario.time))
    return runs(still)  # of steps, so the end of a run is a sample


def _waits_throughout(
    scenario: Scenario, wait: Wait, requested: BoundaryStates | None, limits: Limits
) -> bool:
    """Whether a vehicle waits from its arrival, and its request is to end where it starts."""
    i = wait.vehicle
    if requested is None or wait.start > float(scenario.time[scenario.present[i, 0]]):
        return False
    offset = requested.end[i, :2] - requested.start[i, :2]
    return bool(np.hypot(*offset) <= limits.position_tolerance + ROUNDING_M)


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
