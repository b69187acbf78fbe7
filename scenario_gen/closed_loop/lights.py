# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Traffic lights in the closed loop: red phases of the others, and the lights that an ego sees."""

from itertools import product
import math
from typing import NamedTuple

import numpy as np

from scenario_gen.numerics import Floats
from scenario_gen.situation import runs_red
from scenario_gen.types import Scenario, SignalState, TrafficLight


class ObservedLight(NamedTuple):
    """A light as the ego observes it.

    Attributes:
        id: its name in the map.
        state: what it shows.
        line: (2, 2) metres, its stop line from left to right.
        yaw: direction [rad] of its traffic.
    """

    id: str
    state: SignalState
    line: Floats
    yaw: float


def observed(lights: tuple[TrafficLight, ...], time: float) -> tuple[ObservedLight, ...]:
    """Return what lights show at a time [s]."""
    return tuple(
        ObservedLight(light.id, light.schedule.at(time), light.line, light.yaw) for light in lights
    )


def crosses_at_red(
    lights: tuple[TrafficLight, ...], before: Floats, after: Floats, time: float
) -> bool:
    """Return whether a front (2,) [m] moves over a stop line that is red at a time [s].

    The line is red if the lights of all movements are.
    """
    crossed = [
        light
        for light in lights
        if float(light.before(before)) > 0.0 >= float(light.before(after))
        and float(light.distance_to_side(after)) == 0.0
    ]
    return bool(crossed) and all(light.schedule.at(time).stops for light in crossed)


def ran_red(motion: Scenario, ego: int, driven: int) -> float:
    """Return the first time [s] at which an ego crosses a stop line at red; NaN if it never does.

    Args:
        motion: of all vehicles.
        ego: its index.
        driven: number of instants before a jump, which crosses nothing.
    """
    lights = motion.facts.lights
    alone = motion.of_vehicles([ego])
    if lights and driven < len(motion.time):
        alone = alone.between(0, max(driven - 1, 1))
    times = [runs_red(alone, 0, light, 0.0) for light in lights]
    return min((time for time in times if not math.isnan(time)), default=math.nan)


def red_phases(scenario: Scenario) -> Floats:
    """Return the phases in which each vehicle waits at a stop line (N, R, 3) [s].

    Each is the clock at which its front is at the line, and begin and end of red; the clock of
    rows that do not exist is 0. A vehicle that runs red in the scenario waits at no line.
    """
    rows: list[list[tuple[float, float, float]]] = [[] for _ in scenario.vehicles]
    last = 10.0 * float(scenario.time[-1])
    for (n, vehicle), light in product(enumerate(scenario.vehicles), scenario.facts.lights):
        clock = math.nan if vehicle.kind.walks else light.crossing(scenario, n)
        if math.isnan(clock) or light.schedule.at(clock).stops:
            continue
        rows[n] += [(clock - 0.01, *phase) for phase in light.schedule.red_phases(0.0, last)]
    out = np.zeros((len(rows), max(map(len, rows), default=0), 3))
    for n, phases_of_vehicle in enumerate(rows):
        out[n, : len(phases_of_vehicle)] = np.reshape(phases_of_vehicle, (-1, 3))
    return out
