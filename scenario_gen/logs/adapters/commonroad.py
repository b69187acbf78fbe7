# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""CommonRoad scenarios (XML, 2018b and 2020a): the trajectories of dynamic obstacles.

| quantity | element | unit |
|---|---|---|
| vehicle | obstacle, dynamicObstacle: attribute id | |
| class | type: car, truck, bus, taxi, … | |
| length, width | shape/rectangle/length, width | m |
| time | initialState, trajectory/state: time/exact, times commonRoad: timeStepSize | s |
| position | position/point/x, y; the centre of the rectangle | m |
| heading | orientation/exact | rad, counter-clockwise from +x |
| speed | velocity/exact | m/s |

| light's cycle | trafficLight: cycle/cycleElement: duration, color; cycle/timeOffset | steps |
| its movements | trafficLight: direction | |

An interval (intervalStart, intervalEnd) counts as its middle.

Source: CommonRoad's documentation of the XML format, 2018b and 2020a.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
import math
from pathlib import Path

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.base.xml_reader import Element, read_xml
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.kinds import counted
from scenario_gen.logs.raw import (
    check_size,
    check_vehicles,
    Observations,
    only_file,
    RawLog,
    Segment,
)
from scenario_gen.logs.signals import naming, RawSignal, state_of
from scenario_gen.numerics import Floats
from scenario_gen.types import rightwards, SignalSchedule, SignalState, TURNS


def read(paths: Sequence[Path], config: LogConfig) -> RawLog:
    """Read the trajectories of one scenario.

    Raises:
        InputError: the file is damaged, has no trajectories, or a state lacks its position or
            time; names the line.
    """
    path = only_file(paths, config)
    root = read_xml(path, str(path))
    if root.tag != "commonRoad":
        raise InputError(f"{root.place}: the root of a CommonRoad file is <commonRoad>")
    step_s = root.number("timeStepSize")
    if not 1e-3 <= step_s <= 10.0:
        raise InputError(f"{root.place}: timeStepSize is {step_s:g} s; 0.001 to 10 can be read")
    obstacles = [*root.findall("obstacle"), *root.findall("dynamicObstacle")]
    check_vehicles(str(path), len(obstacles), config)

    vehicles: list[Observations] = []
    without_trajectory: Counter[str] = Counter()
    row = 0
    for obstacle in obstacles:
        kind = obstacle.find("type")
        name = kind.content if kind is not None else ""
        trajectory = obstacle.find("trajectory")
        if trajectory is None:
            without_trajectory[name or "unknown"] += 1
            continue
        states = [*obstacle.findall("initialState"), *trajectory.findall("state")]
        check_size(str(path), 0, row + len(states), config)
        vehicles.append(replace(_observations(obstacle, states, step_s, row), kind=name))
        row += len(states)
    if not vehicles:
        raise InputError(f"{path}: no road user has a trajectory")
    notes = ["read as CommonRoad"]
    if without_trajectory:
        notes.append(f"left out, without a trajectory: {counted(without_trajectory)}")
    if static := len(root.findall("staticObstacle")):
        notes.append(
            f"{static} static obstacles belong to the road: give this file as the map, too"
        )
    segment = Segment(0, str(path), "state", 1)
    signals: list[RawSignal] = []
    if config.signals == "recorded":
        signals, without_lane = _signals(root, step_s)
        if without_lane:
            notes.append(f"traffic lights without a lane are left out: {', '.join(without_lane)}")
    return RawLog(
        path.stem,
        False,
        tuple(vehicles),
        row,
        (segment,),
        tuple(notes),
        signals=tuple(signals),
    )


def _signals(root: Element, step_s: float) -> tuple[list[RawSignal], list[str]]:
    """Return the lights whose states are known, one for each of their lanelets' stop lines.

    Returns:
        The lights, and the ids of those to which no lanelet refers.
    """
    signals, without_lane = [], []
    lanelets: dict[str, list[Element]] = {}
    for lanelet in root.findall("lanelet"):
        refs = [*lanelet.findall("trafficLightRef"), *lanelet.findall("stopLine/trafficLightRef")]
        for ref in dict.fromkeys(link.attribute("ref") for link in refs):
            lanelets.setdefault(ref, []).append(lanelet)
    for light in root.findall("trafficLight"):
        name = light.attribute("id")
        schedule = cycle_of(light, step_s)
        if schedule is None:
            continue
        if name not in lanelets:
            without_lane.append(name)
        for lanelet in lanelets.get(name, ()):
            line = stop_line(lanelet)
            signals.append(
                RawSignal(
                    name,
                    schedule,
                    light.place,
                    line,
                    (lanelet.attribute("id"),),
                    turns=turns_of(light),
                )
            )
    return signals, without_lane


def turns_of(light: Element) -> tuple[str, ...]:
    """Return the movements that a light is for, as `TrafficLight` has them."""
    direction = light.find("direction")
    words = "all" if direction is None else direction.content.lower()
    return tuple(turn for turn in TURNS if turn in words)


def cycle_of(light: Element, step_s: float) -> SignalSchedule | None:
    """Return the cycle of a light, None if it has no state or is never active.

    Raises:
        InputError: a duration or a colour is damaged.
    """
    elements = light.findall("cycle/cycleElement")
    durations = [step_s * element.child("duration").value() for element in elements]
    states = [
        state_of(element.child("color").content, element.child("color").place)
        for element in elements
    ]
    active = light.find("active")
    is_off = active is not None and active.content == "false"
    if is_off or all(state is SignalState.OFF for state in states):
        return None
    offset = light.find("cycle/timeOffset")
    start_s = 0.0 if offset is None else step_s * offset.value()
    with naming(f"{light.place}: traffic light {light.get('id', '?')}"):
        return SignalSchedule.cycle(durations, states, start_s)


def stop_line(lanelet: Element) -> Floats:
    """Return the stop line (2, 2) [m] of a lanelet from left to right; by default its end."""
    bounds = [lanelet.child(f"{side}Bound").findall("point") for side in ("left", "right")]
    ends = np.array([point_of(points[-1]) for points in bounds if points])
    points = np.array([point_of(point) for point in lanelet.findall("stopLine/point")])
    if len(points) < 2:
        return ends
    return rightwards(points[[0, -1]], ends)


def point_of(point: Element) -> tuple[float, float]:
    """Return x, y [m] of a point."""
    return point.child("x").value(), point.child("y").value()


def _observations(
    obstacle: Element, states: Sequence[Element], step_s: float, first_row: int
) -> Observations:
    """Return the states of an obstacle."""
    values = np.array([_state(state) for state in states]).reshape(-1, 5)
    stamps = np.round(values[:, 0] * (step_s * 1e9)).astype(np.int64)
    rows = np.arange(first_row, first_row + len(states))
    return Observations.of_rows(
        obstacle.attribute("id"), stamps, values[:, 1:], rows, _size(obstacle)
    )


def _size(obstacle: Element) -> tuple[float, float]:
    """Return length and width; NaN if unknown."""
    rectangle = obstacle.find("shape/rectangle")
    if rectangle is not None:
        return rectangle.child("length").value(), rectangle.child("width").value()
    circle = obstacle.find("shape/circle")
    diameter = math.nan if circle is None else 2.0 * circle.child("radius").value()
    return diameter, diameter


def _state(state: Element) -> tuple[float, float, float, float, float]:
    """Return step, x, y, heading, speed; NaN for an unknown heading or speed."""
    point = state.first_of("position/point", "position/rectangle/center")
    if point is None:
        raise InputError(f"{state.place}: its position is not a point")
    time = _value(state, "time")
    if math.isnan(time):
        raise InputError(f"{state.place} has no time")
    heading = _value(state, "orientation")
    speed = abs(_value(state, "velocity"))
    return time, *point_of(point), heading, speed


def _value(state: Element, tag: str) -> float:
    """Return an exact value, or the middle of an interval; NaN if missing."""
    element = state.find(tag)
    if element is None:
        return math.nan
    exact = element.find("exact")
    if exact is not None:
        return exact.value()
    start = element.child("intervalStart").value()
    return (start + element.child("intervalEnd").value()) / 2.0
