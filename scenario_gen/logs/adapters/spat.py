# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Traffic lights in messages of SAE J2735: SPaT has the states, MAP the stop lines.

| quantity | key | unit |
|---|---|---|
| time | SPaT: metadata as in other messages; timeStamp | ms of the minute |
| state | SPaT: states: signalGroup, eventState | |
| stop line | MAP: refPoint; laneSet: nodeList, beginning at the line; laneWidth | degrees, cm |
| light | MAP: laneSet: connectsTo: signalGroup | |

A stop line is across the first edge of its lane. Lanes whose signal groups differ show the most
permissive state. Both the documents of the ODE (`intersectionStateList`) and those that J2735's
own names give (`intersections`) are read.

Source: SAE J2735; samples of the US DOT's ODE.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
import math
import re
from typing import Any

import numpy as np

from scenario_gen.base.errors import guarded
from scenario_gen.logs.geodesy import geodetic
from scenario_gen.logs.signals import (
    line_across,
    most_permissive,
    RawSignal,
    sampled_schedule,
    unknown_states,
)
from scenario_gen.numerics import Floats
from scenario_gen.types import SignalState

_STATES = {
    "stopandremain": SignalState.RED,
    "stopthenproceed": SignalState.OFF,
    "premovement": SignalState.RED_YELLOW,
    "permissivemovementallowed": SignalState.GREEN,
    "protectedmovementallowed": SignalState.GREEN,
    "permissiveclearance": SignalState.YELLOW,
    "protectedclearance": SignalState.YELLOW,
    "cautionconflictingtraffic": SignalState.OFF,
    "dark": SignalState.OFF,
    "unavailable": SignalState.UNKNOWN,
}
"""States by the names of J2735's MovementPhaseState without punctuation."""


@dataclass(frozen=True)
class _Lane:
    """An ingress lane: its signal groups, and its stop line (2, 2) [degrees]."""

    groups: frozenset[int]
    line: Floats


@dataclass
class SignalMessages:
    """The SPaT and MAP messages of a log, by junction."""

    samples: dict[str, dict[float, dict[int, SignalState]]] = field(default_factory=dict)
    lanes: dict[str, dict[str, _Lane]] = field(default_factory=dict)
    unknown: set[str] = field(default_factory=set)  # states

    def add(self, record: Any, clock: Callable[[Any], float], place: str) -> bool:
        """Add a message; return False if it is neither SPaT nor MAP.

        Args:
            record: the document.
            clock: returns the stamp [s] by the milliseconds of the minute.
            place: file and record, for messages.

        Raises:
            InputError: the message is incomplete.
        """
        problem = f"{place} is not a known SPaT or MAP message"
        with guarded(problem, AttributeError, LookupError, TypeError, ValueError, OverflowError):
            junctions = _junctions(record)
            for junction in junctions:
                self._add(junction, clock)
        return bool(junctions)

    def _add(self, junction: Mapping[str, Any], clock: Callable[[Any], float]) -> None:
        name = str(junction["id"]["id"])
        if "laneSet" in junction:
            self.lanes.setdefault(name, {}).update(_lanes(junction))
            return
        time = clock(junction.get("timeStamp"))
        if math.isfinite(time):
            self.samples.setdefault(name, {})[time] = dict(self._states(junction))

    def _states(self, junction: Mapping[str, Any]) -> Iterator[tuple[int, SignalState]]:
        for movement in _entries(junction["states"]):
            events = movement.get("state_time_speed") or movement["state-time-speed"]
            event = _entries(events)[0]["eventState"]
            word = next(iter(event)) if isinstance(event, dict) else str(event)
            state = _STATES.get(re.sub("[^a-z]", "", word.lower()))
            if state is None:
                self.unknown.add(word)
            yield int(movement["signalGroup"]), state or SignalState.UNKNOWN

    def signals(self, place: str, notes: list[str]) -> Iterator[RawSignal]:
        """Yield the lights; notes on those that are left out are appended.

        Raises:
            InputError: a light has two states at one time.
        """
        notes += unknown_states(self.unknown)
        missing = sorted(set(self.samples) - set(self.lanes))
        if missing:
            notes.append(
                f"traffic lights of junctions {', '.join(missing)} are left out: give their MAP "
                "messages, too, which have the stop lines"
            )
        for junction, samples in self.samples.items():
            times = sorted(samples)
            for name, lane in self.lanes.get(junction, {}).items():
                states = [
                    most_permissive(
                        samples[time].get(group, SignalState.UNKNOWN) for group in lane.groups
                    )
                    for time in times
                ]
                label = f"{junction}/{name}"
                schedule = sampled_schedule(times, states, f"{place}: traffic light {label}")
                yield RawSignal(label, schedule, place, lane.line, (name,), geographic=True)


def _junctions(record: Any) -> list[Any]:
    """Return the junctions of a SPaT or MAP message; none of other messages."""
    data = record.get("payload", {}).get("data", {}) if isinstance(record, dict) else {}
    value = data.get("value") or (record.get("value") if isinstance(record, dict) else None) or {}
    body = value.get("SPAT") or value.get("MapData") or data
    return _entries(body.get("intersectionStateList") or body.get("intersections"))


def _lanes(junction: Mapping[str, Any]) -> Iterator[tuple[str, _Lane]]:
    """Yield the lanes of a junction that end at a light, by their ids."""
    reference = junction["refPoint"]
    if "latitude" in reference:
        origin = (float(reference["latitude"]), float(reference["longitude"]))
    else:
        origin = (float(reference["lat"]) * 1e-7, float(reference["long"]) * 1e-7)
    width = 0.01 * float(junction.get("laneWidth") or 350.0)
    for lane in _entries(junction["laneSet"]):
        links = _entries(lane.get("connectsTo"))
        groups = {
            int(link["signalGroup"]) for link in links if link.get("signalGroup") is not None
        }
        nodes: list[dict[str, float]] = [
            next((place for place in node["delta"].values() if place is not None), {})
            for node in _entries(lane["nodeList"]["nodes"])[:2]
        ]
        if not groups or len(nodes) < 2 or not all("x" in node for node in nodes):
            continue
        steps = 0.01 * np.array([[node["x"], node["y"]] for node in nodes], dtype=float)
        yaw = float(np.arctan2(-steps[1, 1], -steps[1, 0]))
        line = geodetic(line_across(steps[0], yaw, width), origin)
        yield str(lane["laneID"]), _Lane(frozenset(groups), np.column_stack(line))


def _entries(value: Any) -> list[Any]:
    """Return a list, which may be the only value of an object; of None, no entries."""
    while isinstance(value, dict) and len(value) == 1:
        value = next(iter(value.values()))
    if value is None:
        return []
    return value if isinstance(value, list) else [value]
