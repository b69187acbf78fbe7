# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Traffic lights with their stop lines, what they show over time, and stops for them."""

from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
import math
import re
from typing import Any, Self

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.numerics import angle_between, Floats, freeze, frozen, Ints, unit
from scenario_gen.types.motion import Motion


class SignalState(StrEnum):
    """What a light shows to the traffic of its stop line."""

    GREEN = "green"
    YELLOW = "yellow"
    RED = "red"
    RED_YELLOW = "red_yellow"
    OFF = "off"  # the signs apply
    UNKNOWN = "unknown"  # not recorded: nobody is held to it

    @property
    def stops(self) -> bool:
        """Whether nobody may cross the stop line."""
        return self in (SignalState.RED, SignalState.RED_YELLOW)

    @classmethod
    def of_word(cls, word: str) -> "SignalState | None":
        """Return the state that a log or a map calls by a word; None if it is not known."""
        name = re.sub(r"[^a-z]", "", word.lower())
        return next((state for state, names in _WORDS.items() if name in names), None)


_WORDS = {
    SignalState.GREEN: frozenset(("green", "g", "go")),
    SignalState.YELLOW: frozenset(("yellow", "amber", "y", "caution")),
    SignalState.RED: frozenset(("red", "r", "stop")),
    SignalState.RED_YELLOW: frozenset(("redyellow", "redamber", "u")),
    SignalState.OFF: frozenset(("off", "inactive", "dark", "o")),
    SignalState.UNKNOWN: frozenset(("", "unknown", "unavailable")),
}


@dataclass(frozen=True)
class SignalSchedule:
    """The states of a light over time, on one clock with its encounter or scenario.

    Attributes:
        starts: seconds at which the phases begin, ascending.
        states: what the light shows in each phase.
        end: seconds at which the last phase ends. Before the first and after the last phase the
            state is unknown, unless the schedule repeats.
        repeats: whether the phases are a cycle, before and after.

    Raises:
        InputError: the phases are empty, not finite, not ascending, or of an unknown state.

    Example:
        >>> schedule = SignalSchedule.cycle((20.0, 3.0, 17.0), ("green", "yellow", "red"))
        >>> schedule.at(21.0).value, schedule.at(-1.0).value
        ('yellow', 'red')
    """

    starts: tuple[float, ...]
    states: tuple[SignalState, ...]
    end: float
    repeats: bool = False

    def __post_init__(self) -> None:
        times = np.array([*self.starts, self.end], dtype=np.float64)
        unknown = [state for state in self.states if state not in SignalState]
        if unknown:
            known = ", ".join(SignalState)
            raise InputError(f"signal state {unknown[0]!r} is not known; there are {known}")
        if not self.states or len(self.states) != len(self.starts):
            raise InputError(f"{len(self.starts)} phases have {len(self.states)} states")
        if not np.isfinite(times).all() or (np.diff(times) <= 0.0).any():
            raise InputError("its phases do not follow each other in time")
        freeze(
            self,
            starts=tuple(times[:-1].tolist()),
            states=tuple(map(SignalState, self.states)),
            end=float(times[-1]),
        )

    @classmethod
    def cycle(cls, durations: Sequence[float], states: Sequence[str], offset: float = 0.0) -> Self:
        """Return a cycle whose first phase begins at `offset` [s], of durations [s]."""
        times = offset + np.concatenate([[0.0], np.cumsum(durations)])
        return cls(tuple(times[:-1]), tuple(map(SignalState, states)), float(times[-1]), True)

    @classmethod
    def of_samples(cls, times: Sequence[float], states: Sequence[str], end: float) -> Self:
        """Return the schedule of states that were recorded at ascending times [s]."""
        kept = [k for k, state in enumerate(states) if k == 0 or state != states[k - 1]]
        chosen = [SignalState(states[k]) for k in kept]
        return cls(tuple(float(times[k]) for k in kept), tuple(chosen), end)

    def at(self, time: float) -> SignalState:
        """Return the state at a time [s]."""
        first = self.starts[0]
        if self.repeats:
            time = first + (time - first) % (self.end - first)
        elif not first <= time < self.end:
            return SignalState.UNKNOWN
        return self.states[bisect_right(self.starts, time) - 1]

    def between(self, first: float, last: float) -> "SignalSchedule":
        """Return the same states from `first` to `last` [s] without a cycle."""
        if not self.repeats:
            return self
        period = self.end - self.starts[0]
        cycles = range(
            math.floor((first - self.starts[0]) / period),
            math.ceil((last - self.starts[0]) / period),
        )
        if len(cycles) * len(self.states) > 100_000:
            raise InputError(f"a cycle of {period:g} s is repeated {len(cycles)} times")
        starts = [start + k * period for k in cycles for start in self.starts]
        end = self.starts[0] + cycles.stop * period
        return SignalSchedule(tuple(starts), self.states * len(cycles), end)

    def retimed(self, clock: Callable[[Floats], Floats]) -> "SignalSchedule":
        """Return the same states at the times to which an ascending clock maps theirs."""
        *starts, end = clock(np.array([*self.starts, self.end])).tolist()
        return replace(self, starts=tuple(starts), end=end)

    def moved(self, by: float) -> "SignalSchedule":
        """Return the same states `by` [s] later."""
        return self.retimed(lambda times: times + by)

    def stops_within(self, first: float, last: float) -> bool:
        """Return whether the light forbids to cross its line at any time in an interval [s]."""
        inside = [t for t in self.between(first, last).starts if first < t <= last]
        return any(self.at(t).stops for t in (first, *inside))

    def red_phases(self, first: float, last: float) -> list[tuple[float, float]]:
        """Return begin and end [s] of the phases in which nobody may cross, as of `between`."""
        phases = self.between(first, last)
        ends = (*phases.starts[1:], phases.end)
        return [
            (start, end)
            for start, end, state in zip(phases.starts, ends, phases.states, strict=True)
            if state.stops
        ]

    def slack(self, time: float) -> float:
        """Return how far [s] a time is from the nearest one at which nobody may cross."""
        red = self.red_phases(time - 300.0, time + 300.0)
        return min((max(start - time, time - end, 0.0) for start, end in red), default=math.inf)

    def document(self) -> dict[str, Any]:
        """Return a JSON document."""
        document = {"starts": list(self.starts), "states": list(self.states), "end": self.end}
        return document | ({"repeats": True} if self.repeats else {})

    @classmethod
    def of_document(cls, document: Mapping[str, Any]) -> Self:
        """Return the schedule of a JSON document.

        Raises:
            InputError, KeyError, TypeError, ValueError: it is damaged.
        """
        states = tuple(map(SignalState, document["states"]))
        starts = tuple(map(float, document["starts"]))
        return cls(starts, states, float(document["end"]), document.get("repeats", False) is True)


TURNS = ("left", "straight", "right")
_STRAIGHT_RAD = math.radians(30.0)
_BESIDE_LINE_M = 1.5  # from a line's end to a path that leads over it
_JUNCTION_M = 30.0  # behind the line, in which a vehicle turns
_SEARCH_SHARES = np.linspace(0.0, 1.0, 33)  # three such refinements make 3 µs of 0.1 s


@dataclass(frozen=True, eq=False)
class TrafficLight:
    """A light with its stop line and its schedule.

    Attributes:
        id: its name in the map or the log; the lights of several lanes may share it.
        schedule: what it shows.
        line: (2, 2) metres, the stop line: the left end, as its traffic sees it, and the right.
        lanes: ids of its lanes in the map or the log; () if they are not known.
        turns: the movements it is for, of TURNS; (): all.
    """

    id: str
    schedule: SignalSchedule
    line: Floats
    lanes: tuple[str, ...] = ()
    turns: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        line = np.asarray(self.line, dtype=np.float64)
        usable = line.shape == (2, 2) and np.isfinite(line).all()
        if not usable or np.hypot(*(line[1] - line[0])) < 0.1:
            raise InputError(f"traffic light {self.id} names no stop line")
        freeze(self, line=frozen(line))

    @property
    def yaw(self) -> float:
        """The direction [rad] in which its traffic crosses the line."""
        across = self.line[1] - self.line[0]
        return float(np.arctan2(across[0], -across[1]))

    def before(self, points: Floats) -> Floats:
        """Return how far [m] points (..., 2) are before the line; negative behind it."""
        return np.asarray((self.line[0] - points) @ unit(self.yaw))

    def distance_to_side(self, points: Floats) -> Floats:
        """Return how far [m] points (..., 2) are beside the line's traffic; 0 within its ends."""
        across = self.line[1] - self.line[0]
        width = float(np.hypot(*across))
        along = (points - self.line[0]) @ (across / width)
        return np.asarray(np.maximum(np.maximum(-along, along - width), 0.0))

    def leads_over(self, points: Floats) -> bool:
        """Return whether a path of points (M, 2) leads over the line, or closely beside it."""
        before = self.before(points)
        crosses = np.flatnonzero((before[:-1] > 0.0) & (before[1:] <= 0.0))
        return bool((self.distance_to_side(points[crosses]) < _BESIDE_LINE_M).any())

    def crossing(self, motion: Motion, n: int) -> float:
        """Return when [s] the front of vehicle n crosses the line; NaN if it never does.

        A vehicle whose movement the light is not for does not cross its line.
        """
        rows = np.flatnonzero(motion.is_present[n])
        if len(rows) < 2:
            return math.nan
        depth = -self.before(fronts(motion, n)[rows])
        steps = np.flatnonzero((depth[:-1] < 0.0) & (depth[1:] >= 0.0))
        for k in steps.tolist():
            first, last = motion.time[rows[k]], motion.time[rows[k + 1]]
            for _ in range(3):
                times = first + (last - first) * _SEARCH_SHARES
                moved = motion.of_vehicles([n]).at(times)
                half = 0.5 * motion.vehicles[n].length
                front = moved.position[0] + half * unit(moved.heading[0])
                behind = int(np.argmax(-self.before(front) >= 0.0)) or len(times) - 1
                first, last = times[behind - 1], times[behind]
            along = math.cos(float(moved.heading[0, behind]) - self.yaw)
            if self.distance_to_side(front[behind]) == 0.0 and along > 0.5:
                is_for_it = not self.turns or self._turn(motion, n, rows[k:]) in self.turns
                return float(last) if is_for_it else math.nan
        return math.nan

    def _turn(self, motion: Motion, n: int, rows: Ints) -> str:
        """Return the movement of vehicle n at samples from its crossing on."""
        steps = np.hypot(*np.diff(motion.position[n, rows], axis=0).T)
        near = rows[np.concatenate([[True], np.cumsum(steps) < _JUNCTION_M])]
        turned = angle_between(float(motion.heading[n, near[-1]]), self.yaw)
        if abs(turned) < _STRAIGHT_RAD:
            return "straight"
        return "left" if turned > 0.0 else "right"

    def retimed(self, clock: Callable[[Floats], Floats]) -> "TrafficLight":
        """Return the light on another clock."""
        return replace(self, schedule=self.schedule.retimed(clock))

    def document(self) -> dict[str, Any]:
        """Return a JSON document."""
        return {
            "id": self.id,
            "line": self.line.tolist(),
            "lanes": list(self.lanes),
            **({"turns": list(self.turns)} if self.turns else {}),
            **self.schedule.document(),
        }

    @classmethod
    def of_document(cls, document: Mapping[str, Any]) -> Self:
        """Return the light of a JSON document.

        Raises:
            InputError, KeyError, TypeError, ValueError: it is damaged.
        """
        line = np.array(document["line"], dtype=np.float64)
        schedule = SignalSchedule.of_document(document)
        lanes, turns = (tuple(map(str, document.get(key, ()))) for key in ("lanes", "turns"))
        return cls(str(document["id"]), schedule, line, lanes, turns)


def rightwards(line: Floats, end: Floats) -> Floats:
    """Return a line (2, 2) from left to right, as the end (2, 2) of a lane is."""
    is_reversed = float(((line[1] - line[0]) * (end[1] - end[0])).sum()) < 0.0
    return line[::-1] if is_reversed else line


def fronts(motion: Motion, n: int) -> Floats:
    """Return the places (T, 2) [m] of the front of vehicle n."""
    ahead = 0.5 * motion.vehicles[n].length * unit(motion.heading[n])
    return np.asarray(motion.position[n] + ahead)


@dataclass(frozen=True)
class SignalStop:
    """A vehicle stops, or slows, for a light.

    Attributes:
        who: index of the vehicle.
        light: id of the light.
        since, until: seconds, the stand; or from the greatest speed to the least one.
        green: seconds, when the light lets it go; inf: not within the recording.
        queue: number of vehicles that stand between it and the line.
        stands: whether it stands.
    """

    who: int
    light: str
    since: float
    until: float
    green: float
    queue: int = 0
    stands: bool = True

    @property
    def lag(self) -> float:
        """Seconds from green to the departure; -inf if it does not depart."""
        return self.until - self.green

    def words(self, label: str) -> str:
        """Return the stop in words; `label` names the vehicle."""
        if not self.stands:
            return f"{label} slows for red"
        place = f" as number {self.queue + 1} in a queue" if self.queue else ""
        if math.isinf(self.green):
            return f"{label} stops at red{place}"
        when = f"{abs(self.lag):.1f} s {'after' if self.lag >= 0.0 else 'before'} green"
        return f"{label} stops at red{place}, leaves {when}"
