# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""CommonRoad scenarios (XML, 2018b and 2020a): the dynamic obstacles' trajectories.

| quantity | element | unit |
|---|---|---|
| vehicle | obstacle, dynamicObstacle: attribute id | |
| class | type: car, truck, bus, taxi, … | |
| length, width | shape/rectangle/length, width | m |
| time | initialState, trajectory/state: time/exact, times commonRoad: timeStepSize | s |
| position | position/point/x, y; the rectangle's middle | m |
| heading | orientation/exact | rad, counter-clockwise from +x |
| speed | velocity/exact | m/s |

Source: CommonRoad's documentation of the XML format, 2018b and 2020a. An interval
(intervalStart, intervalEnd) counts as its middle.
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
from scenario_gen.logs.raw import (
    check_size,
    check_vehicles,
    Observations,
    only_file,
    RawLog,
    Segment,
)


def read(paths: Sequence[Path], config: LogConfig) -> RawLog:
    """Read the trajectories of one scenario.

    Raises:
        InputError: it is broken, has no trajectories, or a state lacks its position or time; names file and line.
    """
    path = only_file(paths, config)
    root = read_xml(path, str(path))
    if root.tag != "commonRoad":
        raise InputError(f"{root.place}: the root of a CommonRoad file is <commonRoad>")
    step = root.number("timeStepSize")
    if not 1e-3 <= step <= 10.0:
        raise InputError(f"{root.place}: timeStepSize is {step:g} s; 0.001 to 10 are read")
    vehicles: list[Observations] = []
    left_out: Counter[str] = Counter()
    row = 0
    obstacles = [*root.findall("obstacle"), *root.findall("dynamicObstacle")]
    check_vehicles(str(path), len(obstacles), config)
    for obstacle in obstacles:
        kind = obstacle.find("type")
        name = kind.content if kind is not None else ""
        trajectory = obstacle.find("trajectory")
        if trajectory is None:
            left_out[name or "unknown"] += 1
            continue
        states = [*obstacle.findall("initialState"), *trajectory.findall("state")]
        check_size(str(path), 0, row + len(states), config)
        vehicles.append(replace(_observations(obstacle, states, step, row), kind=name))
        row += len(states)
    if not vehicles:
        raise InputError(f"{path}: no road user with a trajectory in it")
    counted = ", ".join(f"{count} × {name}" for name, count in sorted(left_out.items()))
    notes = (
        "read as CommonRoad",
        *((f"left out, without a trajectory: {counted}",) if counted else ()),
    )
    return RawLog(
        path.stem, False, tuple(vehicles), row, (Segment(0, str(path), "state", 1),), notes
    )


def _observations(obstacle: Element, states: list[Element], step: float, row: int) -> Observations:
    values = np.array([_state(state) for state in states]).reshape(-1, 5)
    stamps = np.round(values[:, 0] * (step * 1e9)).astype(np.int64)
    box, disc = obstacle.find("shape/rectangle"), obstacle.find("shape/circle")
    length, width = (
        box.child(name).value() if box is not None else math.nan for name in ("length", "width")
    )
    if disc is not None:
        length = width = 2.0 * disc.child("radius").value()
    return Observations.of_rows(
        obstacle.attribute("id"),
        stamps,
        values[:, 1:],
        np.arange(row, row + len(states)),
        (length, width),
    )


def _state(state: Element) -> tuple[float, float, float, float, float]:
    """Return steps, x, y, heading, speed; NaN for heading and speed where they are missing."""
    point = state.first_of("position/point", "position/rectangle/center")
    if point is None:
        raise InputError(f"{state.place} has no position that is a point")
    heading, speed = _exact(state, "orientation"), _exact(state, "velocity")
    time = _exact(state, "time")
    if math.isnan(time):
        raise InputError(f"{state.place} has no time")
    return time, point.child("x").value(), point.child("y").value(), heading, abs(speed)


def _exact(state: Element, tag: str) -> float:
    element = state.find(tag)
    if element is None:
        return math.nan
    value = element.find("exact")
    if value is not None:
        return value.value()
    return (element.child("intervalStart").value() + element.child("intervalEnd").value()) / 2.0
