# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What a traffic light shows over time."""

from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
import math
import re
from typing import Any, Self

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Floats, freeze


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
