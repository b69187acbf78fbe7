# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Traffic lights of a log: recorded states, and the lights of encounters that are cut from it."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import combinations
import math
from typing import TYPE_CHECKING

import numpy as np

from scenario_gen.base.documents import shown
from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Floats, Ints, unit, unit_left, wrap_angle
from scenario_gen.types import (
    Encounter,
    fronts,
    SignalSchedule,
    SignalState,
    TrafficLight,
)

if TYPE_CHECKING:
    from pandas import DataFrame


@dataclass(frozen=True)
class _Limits:
    """Bounds of reading lights.

    Attributes:
        half_lane_m: of a stop line, beyond the vehicles that cross it.
        max_gap_s: a state is not known in longer gaps between its samples, but for
        held_s: before its first and after its last sample, in which its vehicle crosses the line.
        crossing_rad: least and greatest angle between traffic that needs alternate greens.
        straight_rad: turning traffic may meet other traffic at green.
        common_green_s: shorter common greens are rounding.
        far_m: lights farther from all vehicles do not belong to an encounter.
        beyond_m: least and greatest distance at which vehicles stand beyond a misplaced line.
        standstill_mps: slower vehicles stand.
        before_line_m: at which drivers stop before a line.
    """

    half_lane_m: float = 1.75
    max_gap_s: float = 3.0
    held_s: float = 2.0
    crossing_rad: tuple[float, float] = (math.radians(60.0), math.radians(120.0))
    straight_rad: float = math.radians(30.0)
    common_green_s: float = 0.5
    far_m: float = 100.0
    beyond_m: tuple[float, float] = (3.0, 15.0)
    standstill_mps: float = 0.3
    before_line_m: float = 0.5


_LIMITS = _Limits()


@dataclass(frozen=True, eq=False)
class RawSignal:
    """A light of a log.

    Attributes:
        id: its name in the log.
        schedule: in seconds on the log's clock.
        place: file and line, for messages.
        line: (2, 2) metres in the log's frame, the stop line from left to right; (0, 2): it is
            where the front of vehicles is that last saw the light.
        lanes: ids of its lanes.
        seen: until when [s] each vehicle saw it, of those that went on without it.
        turns: as of `TrafficLight`.
    """

    id: str
    schedule: SignalSchedule
    place: str
    line: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    lanes: tuple[str, ...] = ()
    seen: Mapping[str, float] = field(default_factory=dict)
    turns: tuple[str, ...] = ()


def signals_of_table(frame: "DataFrame", place: str) -> tuple[list[RawSignal], list[str]]:
    """Return the lights of a table with a state in each row, and notes.

    A vehicle's row has the state of the light in front of it, and none behind the stop line. The
    light of a vehicle without a column for it has its name.

    Args:
        frame: with the columns time [ns], vehicle, signal, and maybe signal_id.
        place: the file, for messages.

    Raises:
        InputError: a light has two states at one time.
    """
    words = frame["signal"].unique()
    known = {word: SignalState.of_word(word) for word in words}
    unknown = [word for word, state in known.items() if state is None]
    notes = unknown_states(unknown)
    seen = frame[frame["signal"].map(lambda word: bool(word) and known[word] is not None)]
    names = "vehicle " + seen["vehicle"].astype(str)
    if "signal_id" in seen:
        names = names.where(seen["signal_id"] == "", seen["signal_id"])
    signals = []
    for name, rows in seen.sort_values("time", kind="stable").groupby(names, sort=True):
        times = (rows["time"].to_numpy(np.int64) * 1e-9).tolist()
        states = [state for word in rows["signal"] if (state := known[word]) is not None]
        schedule = sampled_schedule(times, states, f"{place}: traffic light {name}")
        signals.append(RawSignal(str(name), schedule, place, seen=_passes(frame, rows)))
    without_line = [signal.id for signal in signals if not signal.seen]
    if without_line:
        notes.append(
            f"no vehicle passes traffic lights {', '.join(without_line)}, so they have no stop "
            "line and are left out"
        )
    return [signal for signal in signals if signal.seen], notes


def _passes(frame: "DataFrame", rows: "DataFrame") -> dict[str, float]:
    """Return when [s] each vehicle passes a light: between its last row with it and the next."""
    times = {}
    for vehicle, last in rows.groupby(rows["vehicle"].astype(str))["time"].max().items():
        later = frame["time"][(frame["vehicle"] == vehicle) & (frame["time"] > last)]
        if len(later):
            times[str(vehicle)] = 0.5e-9 * float(last + later.min())
    return times


def unknown_states(words: Iterable[str]) -> list[str]:
    """Return a note on the words for states that are not known; none without words."""
    listed = ", ".join(sorted(shown(word, 20) for word in words))
    return [f"unknown signal states are left out: {listed}"] if listed else []


@contextmanager
def naming(subject: str) -> Iterator[None]:
    """Begin the message of an error about a schedule with the file and the light."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{subject}: {error}") from error


def moved_signals(signals: Sequence[RawSignal], by_ns: Ints) -> list[RawSignal]:
    """Return lights on a clock that is `by_ns` (1,) nanoseconds ahead; (0,): on the same one."""
    by_s = 1e-9 * float(by_ns.sum())
    return [
        replace(
            signal,
            schedule=signal.schedule.moved(by_s),
            seen={vehicle: time + by_s for vehicle, time in signal.seen.items()},
        )
        for signal in signals
    ]


def state_of(word: str, place: str) -> SignalState:
    """Return the state that a log calls by a word.

    Raises:
        InputError: the word is not known; the message begins with `place`.
    """
    state = SignalState.of_word(word)
    if state is None:
        known = ", ".join(SignalState)
        raise InputError(f"{place}: signal state {shown(word, 40)!r}; there are {known}")
    return state


def sampled_schedule(
    times: Sequence[float], states: Sequence[SignalState], place: str
) -> SignalSchedule:
    """Return the schedule of states that were recorded at ascending times [s].

    It is known for 2 s more at both ends. In long gaps it is unknown.

    Raises:
        InputError: two states were recorded at one time.
    """
    steps = np.diff(times)
    clash = np.flatnonzero((steps <= 0.0) & (np.array(states[1:]) != np.array(states[:-1])))
    if len(clash):
        k = int(clash[0])
        raise InputError(f"{place} is {states[k]} and {states[k + 1]} at {times[k]:g} s")
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.1
    longest = max(_LIMITS.max_gap_s, 2.5 * usual)
    known_at, known = [times[0] - _LIMITS.held_s], [states[0]]
    for k, step in enumerate(steps.tolist(), 1):
        held = min(_LIMITS.held_s, 0.4 * step) if step > longest else 0.0
        if held > 0.0:
            known_at.append(times[k - 1] + max(held, usual))
            known.append(SignalState.UNKNOWN)
        if step > 0.0:
            known_at.append(times[k] - held)
            known.append(states[k])
    return SignalSchedule.of_samples(known_at, known, times[-1] + max(usual, _LIMITS.held_s))


def most_permissive(states: Iterable[SignalState]) -> SignalState:
    """Return the state that permits most, of lights for several directions from one lane."""
    order = [
        SignalState.UNKNOWN,
        SignalState.GREEN,
        SignalState.OFF,
        SignalState.YELLOW,
        SignalState.RED_YELLOW,
        SignalState.RED,
    ]
    return min(states, key=order.index)


def line_across(end: Floats, yaw: float, width: float = 3.5) -> Floats:
    """Return the stop line (2, 2) [m] of a lane that ends at a point (2,) [m], left end first.

    Its usual width [m] counts where a format has none.
    """
    sideways = 0.5 * width * unit_left(yaw)
    return np.stack((end + sideways, end - sideways))


def with_lights(encounter: Encounter, signals: Sequence[RawSignal]) -> Encounter:
    """Return an encounter with the lights of its log.

    Raises:
        InputError: a light has no stop line, ends before the encounter, or contradicts another
            one; names the file and the light.
    """
    lights = []
    straight = []  # lights whose traffic goes straight on, and their places in the log
    start_s = encounter.start_ns * 1e-9
    for signal in signals:
        subject = f"{signal.place}: traffic light {signal.id}"
        schedule = signal.schedule.moved(-start_s)
        line = _line_in(encounter, signal, start_s)
        if line is None:
            continue
        is_short = not schedule.repeats and schedule.end < encounter.duration - encounter.dt
        if is_short and not signal.seen:
            raise InputError(
                f"{subject} ends at {schedule.end:g} s, before {encounter.title} at "
                f"{encounter.duration:g} s; cut the log (log.end), or set log.signals=ignored"
            )
        light = TrafficLight(signal.id, schedule, line, signal.lanes, signal.turns)
        lights.append(light)
        if _goes_straight(encounter, light):
            straight.append((light, subject))
    for (a, _), (b, place) in combinations(straight, 2):
        time = _common_green(encounter, a, b)
        if not math.isnan(time):
            raise InputError(
                f"{place} and {a.id} are both green at {time:.1f} s, but their "
                "traffic crosses; set log.signals=ignored"
            )
    return replace(encounter, lights=tuple(lights))


def lines_where_vehicles_stop(
    signals: Sequence[RawSignal], encounters: Sequence[Encounter]
) -> tuple[list[RawSignal], list[str]]:
    """Return lights with their stop lines no nearer than where vehicles stop at red, and notes.

    In some maps lanes end before the painted line. Two vehicles or more show that.
    """
    by_light: dict[str, dict[str, float]] = {}
    for signal in (signal for signal in signals if len(signal.line)):
        for encounter in encounters:
            schedule = signal.schedule.moved(-encounter.start_ns * 1e-9)
            light = TrafficLight(signal.id, schedule, signal.line)
            by_light.setdefault(signal.id, {}).update(_beyond(encounter, light))
    shifts, notes = {}, []
    for name, beyond in by_light.items():
        if len(beyond) > 1:
            shifts[name] = max(beyond.values()) + _LIMITS.before_line_m
            notes.append(
                f"vehicles {', '.join(beyond)} stop at red {min(beyond.values()):.1f} to "
                f"{max(beyond.values()):.1f} m beyond the stop line of traffic light {name}, so "
                f"it is moved forward by {shifts[name]:.1f} m; correct it in the map"
            )
    moved = []
    for signal in signals:
        line = signal.line
        if signal.id in shifts and len(line):
            yaw = TrafficLight(signal.id, signal.schedule, line).yaw
            line = line + shifts[signal.id] * unit(yaw)
        moved.append(replace(signal, line=line))
    return moved, notes


def _beyond(encounter: Encounter, light: TrafficLight) -> dict[str, float]:
    """Return how far [m] beyond a line vehicles stand for red, by their ids."""
    low, high = _LIMITS.beyond_m
    depths = {}
    for n, name in enumerate(encounter.ids):
        front = fronts(encounter, n)
        depth = -light.before(front)
        stands = encounter.is_present[n] & (encounter.speed[n] < _LIMITS.standstill_mps)
        stands &= (depth > low) & (depth < high) & (light.distance_to_side(front) == 0.0)
        stands &= np.cos(encounter.heading[n] - light.yaw) > math.cos(_LIMITS.straight_rad)
        rows = np.flatnonzero(stands)
        if not len(rows):
            continue
        since, until = encounter.time[rows[[0, -1]]].tolist()
        departs = rows[-1] < encounter.present[n, 1]
        at_red = light.schedule.at(until).stops
        if light.schedule.stops_within(since, until) and not (departs and at_red):
            depths[name] = float(depth[rows[-1]])
    return depths


def _line_in(encounter: Encounter, signal: RawSignal, start_s: float) -> Floats | None:
    """Return the stop line (2, 2) [m] of a light; None if it is far from the encounter."""
    line = signal.line
    if not len(line):
        is_seen = any(vehicle in encounter.ids for vehicle in signal.seen)
        return _line_of(encounter, signal, start_s) if is_seen else None
    low = encounter.position.min(axis=(0, 1)) - _LIMITS.far_m
    high = encounter.position.max(axis=(0, 1)) + _LIMITS.far_m
    return line if bool(((line > low) & (line < high)).all()) else None


def _line_of(encounter: Encounter, signal: RawSignal, start_s: float) -> Floats:
    """Return the stop line (2, 2) [m]: where the fronts of vehicles are that last saw a light."""
    places, yaws = [], []
    for vehicle, time in signal.seen.items():
        if vehicle in encounter.ids:
            n = encounter.ids.index(vehicle)
            at = [time - start_s]
            front = fronts(encounter, n)
            places.append([np.interp(at, encounter.time, front[:, k])[0] for k in range(2)])
            yaws.append(np.interp(at, encounter.time, encounter.heading[n])[0])
    yaw = float(np.arctan2(np.sin(yaws).mean(), np.cos(yaws).mean()))
    points = np.array(places)
    middle = points.mean(axis=0)
    sideways = (points - middle) @ unit_left(yaw)
    ends = [sideways.max() + _LIMITS.half_lane_m, sideways.min() - _LIMITS.half_lane_m]
    return np.asarray(middle + np.array(ends)[:, None] * unit_left(yaw))


def _common_green(encounter: Encounter, a: TrafficLight, b: TrafficLight) -> float:
    """Return when [s] two lights are green whose traffic crosses; NaN: never."""
    low, high = _LIMITS.crossing_rad
    angle = abs(float(wrap_angle(np.array(a.yaw - b.yaw))))
    if not low < angle < high or not _cross(a, b):
        return math.nan
    phases = [light.schedule.between(0.0, encounter.duration) for light in (a, b)]
    starts = sorted({0.0, *phases[0].starts, *phases[1].starts})
    for first, last in zip(starts, [*starts[1:], encounter.duration], strict=True):
        both_green = all(each.at(first) is SignalState.GREEN for each in phases)
        if both_green and min(last, encounter.duration) - first > _LIMITS.common_green_s:
            return first
    return math.nan


def _cross(a: TrafficLight, b: TrafficLight) -> bool:
    """Return whether traffic that goes straight on from two lines crosses within 60 m."""
    middle = [light.line.mean(axis=0) for light in (a, b)]
    ways = np.column_stack([unit(a.yaw), -unit(b.yaw)])
    distance = np.linalg.solve(ways, middle[1] - middle[0])
    return bool(((distance > 0.0) & (distance < 60.0)).all())


def _goes_straight(encounter: Encounter, light: TrafficLight) -> bool:
    """Return whether vehicles cross a line and go straight on."""
    for n in range(len(encounter.vehicles)):
        time = light.crossing(encounter, n)
        if not math.isnan(time):
            last = float(encounter.heading[n, encounter.present[n, 1]])
            if abs(float(wrap_angle(np.array(last - light.yaw)))) < _LIMITS.straight_rad:
                return True
    return False
