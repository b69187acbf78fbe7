# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Traffic lights of a scenario as objects of OSI: bulbs with the lanes for which they are lit."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from scenario_gen.numerics.plane import unit
from scenario_gen.output.exchange.cases import Case
from scenario_gen.output.exchange.lights import light_of
from scenario_gen.types import Lane, Scenario, SignalState, TrafficLight

LANE_ID = 1_000_000_000  # of the first lane
_BULBS = {
    SignalState.GREEN: ("GREEN",),
    SignalState.YELLOW: ("YELLOW",),
    SignalState.RED: ("RED",),
    SignalState.RED_YELLOW: ("RED", "YELLOW"),
}

LaneLights = dict[int, TrafficLight]
"""The light of each lane of a road, by the lane's index."""


def lane_lights(case: Case, scenario: Scenario) -> LaneLights:
    """Return the light of each lane, as far as its states are known."""
    network = case.lane_map.network
    lights: LaneLights = {}
    for rule in network.rules:
        light = light_of(rule, network, scenario.facts.lights)
        if light is not None:
            lights |= dict.fromkeys(rule.lanes, light)
    return lights


def bulbs(lights: LaneLights, time: float) -> Iterator[Any]:
    """Yield the bulbs that are lit at a time [s], or one that is off or unknown, for each lane."""
    import betterosi as osi

    classes = osi.TrafficLight.Classification
    for k, light in lights.items():
        state = light.schedule.at(time)
        mode = "OFF" if state is SignalState.OFF else "UNKNOWN"
        for n, colour in enumerate(_BULBS.get(state, ("UNKNOWN",))):
            yield osi.TrafficLight(
                id=osi.Identifier(value=2 * LANE_ID + 2 * k + n),
                classification=classes(
                    color=classes.Color[colour],
                    mode=classes.Mode["CONSTANT" if state in _BULBS else mode],
                    icon=classes.Icon.NONE,
                    assigned_lane_id=[osi.Identifier(value=LANE_ID + k)],
                ),
            )


def lanes_with_lights(lights: LaneLights, case: Case) -> Iterator[Any]:
    """Yield the lanes that have a light, up to their stop lines."""
    import betterosi as osi

    classes = osi.Lane.Classification
    for k, light in lights.items():
        yield osi.Lane(
            id=osi.Identifier(value=LANE_ID + k),
            classification=classes(
                type=classes.Type.DRIVING,
                centerline=_up_to_line(case.lane_map.network.lanes[k], light),
                centerline_is_driving_direction=True,
            ),
        )


def _up_to_line(lane: Lane, light: TrafficLight) -> list[Any]:
    """Return the centre line of a lane up to a stop line."""
    import betterosi as osi

    before = light.before(lane.centre)
    rows = np.flatnonzero(before > 0.5)
    rows = rows if len(rows) else np.array([0])
    end = lane.centre[rows[-1]] + before[rows[-1]] * unit(light.yaw)
    points = np.concatenate([lane.centre[rows], end[None]])
    return [osi.Vector3d(x=x, y=y, z=0.0) for x, y in points.tolist()]
