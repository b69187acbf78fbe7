# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Traffic lights of OpenSCENARIO: the phases of controllers, and the signals of the road file.

| quantity | element: attribute | unit |
|---|---|---|
| cycle | TrafficSignalController: delay; Phase: duration | s |
| state | TrafficSignalState: trafficSignalId, state: a colour, or on;off;off of the bulbs | |
| stop line | OpenDRIVE: signal: positionInertial: x, y, hdg; validity: its lanes | m, rad |

Only signals with `positionInertial` have a stop line, which is across that position.

Source: ASAM OpenSCENARIO XML 1.2, "Traffic signals"; ASAM OpenDRIVE 1.7, "Signals".
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.base.xml_reader import Element, read_xml
from scenario_gen.logs.signals import line_across, naming, RawSignal, unknown_states
from scenario_gen.numerics import Floats
from scenario_gen.types import SignalSchedule, SignalState

_BULBS = {
    "on;off;off": SignalState.RED,
    "on;on;off": SignalState.RED_YELLOW,
    "off;on;off": SignalState.YELLOW,
    "off;off;on": SignalState.GREEN,
    "off;off;off": SignalState.OFF,
}


def read_lights(root: Element, path: Path, notes: list[str]) -> Iterator[RawSignal]:
    """Yield the lights of a scenario; notes on those that are left out are appended.

    Raises:
        InputError: a duration is damaged, or the road file cannot be read; names the line.
    """
    controllers = root.findall("RoadNetwork/TrafficSignals/TrafficSignalController")
    if not controllers:
        return
    lines = _stop_lines(root, path)
    unknown: set[str] = set()
    ids = [(each, name) for each in controllers for name in _ids(each)]
    for controller, name in ids:
        if name in lines:
            schedule = _schedule(controller, name, unknown)
            yield RawSignal(name, schedule, str(path), lines[name])
    without_line = {name for _, name in ids} - set(lines)
    notes += unknown_states(unknown)
    if without_line:
        notes.append(
            "traffic lights are left out, since no signal in the road file has their id and a "
            f"positionInertial: {', '.join(sorted(without_line))}"
        )


def _ids(controller: Element) -> list[str]:
    states = controller.findall("Phase/TrafficSignalState")
    return list(dict.fromkeys(state.attribute("trafficSignalId") for state in states))


def _schedule(controller: Element, name: str, unknown: set[str]) -> SignalSchedule:
    """Return the cycle of a signal; words that are not known are added to `unknown`."""
    phases = controller.findall("Phase")
    states = [_state(phase, name, unknown) for phase in phases]
    durations = [phase.number("duration") for phase in phases]
    with naming(f"{controller.place}: traffic light {name}"):
        return SignalSchedule.cycle(durations, states, controller.number("delay", 0.0))


def _state(phase: Element, name: str, unknown: set[str]) -> SignalState:
    """Return the state of a signal in a phase."""
    for element in phase.findall("TrafficSignalState"):
        if element.get("trafficSignalId") == name:
            word = element.attribute("state")
            state = _BULBS.get(word.replace(" ", "").lower()) or SignalState.of_word(word)
            if state is None:
                unknown.add(word)
            return state or SignalState.UNKNOWN
    return SignalState.UNKNOWN


def _stop_lines(root: Element, path: Path) -> dict[str, Floats]:
    """Return the stop lines (2, 2) [m] of the signals in the road file, by their ids."""
    file = root.find("RoadNetwork/LogicFile")
    road = None if file is None else path.parent / file.attribute("filepath")
    if road is None or not road.is_file():
        raise InputError(
            f"{path} has traffic lights, and its road file {'' if road is None else road} is "
            "missing; put it in place, or set log.signals=ignored"
        )
    signals = read_xml(road, str(road)).findall("road/signals/signal[positionInertial]")
    return {signal.attribute("id"): _stop_line(signal) for signal in signals}


def _stop_line(signal: Element) -> Floats:
    """Return the stop line (2, 2) [m] across the position of a signal, as wide as its lanes."""
    place = signal.child("positionInertial")
    ranges = signal.findall("validity")
    lanes = [abs(each.number("toLane") - each.number("fromLane")) + 1.0 for each in ranges]
    point = np.array([place.number("x"), place.number("y")])
    return line_across(point, place.number("hdg", 0.0), 3.5 * max(lanes, default=1.0))
