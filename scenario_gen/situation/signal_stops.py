# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Stops for traffic lights, and reactions that a light explains better than another vehicle."""

from collections.abc import Sequence
from dataclasses import dataclass
import math

import numpy as np

from scenario_gen.numerics import angle_between, Ints
from scenario_gen.situation.tracks import STANDSTILL_SPEED_MPS, Wait
from scenario_gen.types import (
    Encounter,
    FOLLOW,
    fronts,
    Motion,
    Reaction,
    SignalState,
    SignalStop,
    TrafficLight,
)


@dataclass(frozen=True)
class _Limits:
    """When a light explains a stop or a departure.

    Attributes:
        approach_m: before the line, in which a vehicle faces the light.
        overrun_m: beyond the line, where a vehicle that waits still faces it.
        beside_m: of the line's ends; a vehicle farther aside faces another light.
        heading_rad: between a vehicle that faces the light and its traffic.
        anticipation_s: a driver departs at most so long before green.
        start_up_s: the first driver departs at most so long after green (HCM: 1 to 2 s), and
        queue_s: later by this for each vehicle that stands before it (saturation headway 1.9 s).
        slowing_mps: smaller drops of speed are no slowing.
        crossing_rad: angles between lights that separate the traffic that crosses.
    """

    approach_m: float = 80.0
    overrun_m: float = 3.0
    beside_m: float = 1.5
    heading_rad: float = math.radians(40.0)
    anticipation_s: float = 1.0
    start_up_s: float = 4.0
    queue_s: float = 3.0
    slowing_mps: float = 1.0
    crossing_rad: tuple[float, float] = (math.radians(30.0), math.radians(150.0))


_LIMITS = _Limits()


def faced_light(
    motion: Motion, n: int, lights: Sequence[TrafficLight]
) -> tuple[TrafficLight, float] | None:
    """Return the first light that vehicle n crosses or approaches, and when [s] it crosses it.

    The time is inf if it does not cross the line. None: it faces no light.
    """
    times = [(light.crossing(motion, n), light) for light in lights]
    crossed = [(time, k) for k, (time, _) in enumerate(times) if not math.isnan(time)]
    if crossed:
        time, k = min(crossed)
        return lights[k], time
    last = int(motion.present[n, 1])
    facing = [light for light in lights if len(_facing(motion, n, light, last))]
    if not facing:
        return None
    front = fronts(motion, n)[last]
    return min(facing, key=lambda light: abs(float(light.before(front)))), math.inf


def _facing(motion: Motion, n: int, light: TrafficLight, until: int) -> Ints:
    """Return the samples up to `until` at which vehicle n is before a line, if at the last one."""
    rows = np.arange(int(motion.present[n, 0]), until + 1)
    front = fronts(motion, n)[rows]
    before = light.before(front)
    is_facing = (before > -_LIMITS.overrun_m) & (before < _LIMITS.approach_m)
    is_facing &= light.distance_to_side(front) < _LIMITS.beside_m
    is_facing &= np.cos(motion.heading[n, rows] - light.yaw) > math.cos(_LIMITS.heading_rad)
    return rows[is_facing] if is_facing[-1] else rows[:0]


def runs_red(motion: Motion, n: int, light: TrafficLight, tolerance: float) -> float:
    """Return when [s] vehicle n crosses a line at red, to a tolerance [s]; NaN if it does not."""
    time = light.crossing(motion, n)
    if math.isnan(time) or not light.schedule.stops_within(time - tolerance, time + tolerance):
        return math.nan
    return time


def red_runners(encounter: Encounter) -> frozenset[int]:
    """Return the vehicles that cross a line at red in a recording."""
    return frozenset(
        n
        for n in range(len(encounter.vehicles))
        for light in encounter.lights
        if not math.isnan(runs_red(encounter, n, light, 0.0))
    )


def find_signal_stops(encounter: Encounter, waits: Sequence[Wait]) -> tuple[SignalStop, ...]:
    """Return the stops and slowdowns for lights, ordered by vehicle."""
    stops = []
    for n, vehicle in enumerate(encounter.vehicles):
        faced = None if vehicle.kind.walks else faced_light(encounter, n, encounter.lights)
        if faced is None:
            continue
        light, crosses = faced
        stands = [wait for wait in waits if wait.vehicle == n and wait.start < crosses]
        stop = _stop(encounter, light, stands[-1]) if stands else None
        stop = stop or _slowdown(encounter, n, light, crosses)
        if stop is not None:
            stops.append(stop)
    return tuple(stops)


def _stop(encounter: Encounter, light: TrafficLight, wait: Wait) -> SignalStop | None:
    """Return the stop at red in which a vehicle waits; None if it waits for something else."""
    n = wait.vehicle
    k = int(np.searchsorted(encounter.time, wait.start - 1e-9))
    front = fronts(encounter, n)[k]
    is_near = -_LIMITS.overrun_m < light.before(front) < _LIMITS.approach_m
    if not is_near or not light.schedule.stops_within(wait.start, wait.end):
        return None
    queue = _queue_before(encounter, n, light, k)
    is_last = wait.end >= float(encounter.time[encounter.present[n, 1]]) - 1e-9
    green = _green(light, wait.start, wait.end + _LIMITS.anticipation_s)
    latest = green + _LIMITS.start_up_s + _LIMITS.queue_s * queue
    if not is_last and not wait.end <= latest:
        return None
    rows = (encounter.time >= wait.start) & (encounter.time <= wait.end)
    standing = encounter.time[rows & (encounter.speed[n] <= STANDSTILL_SPEED_MPS)]
    departs = float(standing[-1]) if len(standing) else wait.end
    return SignalStop(n, light.id, wait.start, departs, green, queue)


def _green(light: TrafficLight, first: float, last: float) -> float:
    """Return when [s] a light turned green for the last time in an interval; inf: never."""
    phases = light.schedule.between(first - 1.0, last + 1.0)
    greens = [
        start
        for start, state in zip(phases.starts, phases.states, strict=True)
        if state is SignalState.GREEN and first < start <= last
    ]
    return max(greens, default=math.inf)


def _queue_before(encounter: Encounter, n: int, light: TrafficLight, k: int) -> int:
    """Return how many vehicles are between vehicle n and a line at sample k."""
    before = float(light.before(fronts(encounter, n)[k]))
    count = 0
    for m, vehicle in enumerate(encounter.vehicles):
        if m == n or vehicle.kind.walks or not encounter.is_present[m, k]:
            continue
        ahead = float(light.before(fronts(encounter, m)[k]))
        in_lane = float(light.distance_to_side(fronts(encounter, m)[k])) < _LIMITS.beside_m
        count += -_LIMITS.overrun_m < ahead < before and in_lane
    return count


def _slowdown(
    encounter: Encounter, n: int, light: TrafficLight, crosses: float
) -> SignalStop | None:
    """Return how a vehicle slows for a red light without a wait; None if it does not."""
    rows = np.flatnonzero(encounter.is_present[n] & (encounter.time <= crosses))
    if len(rows) < 2:
        return None
    speed, time = encounter.speed[n, rows], encounter.time[rows]
    low = int(np.argmin(speed))
    top = int(np.argmax(speed[: low + 1]))
    if speed[top] - speed[low] < _LIMITS.slowing_mps:
        return None
    since, until = float(time[top]), float(time[low])
    before = float(light.before(fronts(encounter, n)[rows[low]]))
    green = _green(light, since, until + _LIMITS.anticipation_s)
    at_red = light.schedule.stops_within(since, until)
    answers = until <= green + _LIMITS.start_up_s
    if math.isinf(green):
        answers = light.schedule.at(until).stops
    if not at_red or not answers or not -_LIMITS.overrun_m < before < _LIMITS.approach_m:
        return None
    return SignalStop(n, light.id, since, until, green, stands=False)


class SignalExplanations:
    """Which reactions of an encounter its lights explain."""

    def __init__(self, encounter: Encounter, stops: Sequence[SignalStop]) -> None:
        """Find the light that each vehicle faces."""
        self._stops = {stop.who: stop for stop in stops}
        self._faced = {
            n: faced
            for n in range(len(encounter.vehicles))
            if (faced := faced_light(encounter, n, encounter.lights)) is not None
        }

    @property
    def crossings(self) -> tuple[tuple[int, float, float], ...]:
        """Vehicles that cross a line, when [s], and how long [s] before or after red."""
        return tuple(
            (n, time, light.schedule.slack(time))
            for n, (light, time) in self._faced.items()
            if math.isfinite(time)
        )

    def explain(self, reaction: Reaction) -> bool:
        """Return whether a light explains what looks like a reaction to another vehicle.

        A vehicle that stops or slows at red does not yield to the traffic that crosses, and
        between vehicles of crossing lights the lights decide, until they are behind their lines.
        """
        if reaction.kind == FOLLOW:
            return False
        stop = self._stops.get(reaction.who)
        if (
            stop is not None
            and reaction.since <= stop.until
            and reaction.until <= stop.until + 1.0
        ):
            return True
        faced, other = self._faced.get(reaction.who), self._faced.get(reaction.whom)
        if faced is None or other is None:
            return False
        low, high = _LIMITS.crossing_rad
        angle = abs(angle_between(faced[0].yaw, other[0].yaw))
        drives_on = reaction.since >= reaction.until
        return low < angle < high and (drives_on or reaction.until <= faced[1] + 0.5)
