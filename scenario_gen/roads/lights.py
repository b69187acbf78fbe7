# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Traffic lights of roads: their stop lines and schedules, recorded or of a fixed program."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from scenario_gen.numerics import Floats, place
from scenario_gen.numerics.curve import Curve
from scenario_gen.roads.config import RoadConfig
from scenario_gen.situation import driver_rows, faced_light, Situation
from scenario_gen.types import (
    DrawnFor,
    Encounter,
    Lane,
    LaneNetwork,
    rightwards,
    RuleKind,
    SignalSchedule,
    SignalState,
    TrafficLight,
    TrafficRule,
)

LIT = ("auto", "signals")  # values of `RoadConfig.priority` with which recorded lights are drawn
_UNRECORDED = SignalSchedule((0.0,), (SignalState.UNKNOWN,), 1.0)


def arm_lights(
    name: str,
    lanes: Sequence[int],
    recorded: Sequence[TrafficLight | None],
    mouth: Floats,
    line: Curve,
    config: RoadConfig,
) -> Iterator[TrafficRule]:
    """Yield the lights of an arm of a drawn road: the recorded ones, and one for other lanes.

    A fixed program has two phases of 20 s, 3 s of yellow, and 1 s of red for all.

    Args:
        name: of a light that was not recorded.
        lanes: indices of the lanes inward, from the dividing line.
        recorded: the light of each lane, with its stop line about the plan's origin.
        mouth: (2, 2) [m] the stop line of lanes without a recorded light.
        line: the dividing line, inward.
        config: names the states, the lane width and the traffic side.
    """
    ids = [name if light is None else light.id for light in recorded]
    for light_id in dict.fromkeys(ids):
        first, last = ids.index(light_id), len(ids) - ids[::-1].index(light_id)
        light = recorded[first]
        across = mouth if light is None else light.line
        station, _ = line.project(across.mean(axis=0)[None])
        side = -1.0 if config.traffic_side == "right" else 1.0
        offsets = side * config.lane_width * np.array([first, last])
        ends = line.at_offset(np.repeat(station, 2), offsets)[:, :2]
        schedule = None if light is None else light.schedule
        if config.signals == "fixed":
            yaw = float(line.points[0, 2])
            states = (SignalState.GREEN, SignalState.YELLOW, SignalState.RED)
            offset = 24.0 * (abs(np.sin(yaw)) > abs(np.cos(yaw)))
            schedule = SignalSchedule.cycle((20.0, 3.0, 25.0), states, offset)
        chosen = tuple(lanes[first:last])
        yield TrafficRule(light_id, RuleKind.TRAFFIC_LIGHT, chosen, (), ends, schedule)


def recorded_rules(
    encounter: Encounter, lanes: Sequence[Lane], priority: str
) -> Iterator[TrafficRule]:
    """Yield the recorded lights of lanes in the recording's frame, if a priority has lights."""
    for light in encounter.lights if priority in LIT else ():
        led = tuple(k for k, lane in enumerate(lanes) if light.leads_over(lane.centre))
        if led:
            schedule = light.schedule.between(0.0, encounter.duration)
            kind = RuleKind.TRAFFIC_LIGHT
            yield TrafficRule(light.id, kind, led, (), light.line, schedule, light.turns)


def lights_of(network: LaneNetwork) -> tuple[TrafficLight, ...]:
    """Return the lights of a road, one for each stop line; their states may be unknown.

    A light without a stop line has the end of each of its lanes.
    """
    lights = []
    for rule in network.rules:
        if rule.kind is not RuleKind.TRAFFIC_LIGHT:
            continue
        schedule = rule.schedule or _UNRECORDED
        ends = [
            np.stack((network.lanes[k].left[-1], network.lanes[k].right[-1])) for k in rule.lanes
        ]
        ids = [network.lanes[k].id for k in rule.lanes]
        if len(rule.line):
            line = rightwards(rule.line[[0, -1]], ends[0])
            lights.append(TrafficLight(rule.id, schedule, line, tuple(ids), rule.turns))
            continue
        lights += [
            TrafficLight(rule.id, schedule, end, (name,), rule.turns)
            for name, end in zip(ids, ends, strict=True)
        ]
    return tuple(lights)


def recorded_lights(
    situation: Situation,
    lane_of: Mapping[tuple[int, bool], tuple[int, int]],
    drawn_for: DrawnFor | None,
) -> dict[tuple[int, int], TrafficLight]:
    """Return the recorded lights in the frame of a road that is drawn for a recording.

    Args:
        situation: of the recording.
        lane_of: arm and lane of the ends of the drivers' tracks.
        drawn_for: where the recording lies.

    Returns:
        The light of each arm and lane; of several, the one that is known longest.
    """
    encounter = situation.encounter
    lights: dict[tuple[int, int], TrafficLight] = {}
    if drawn_for is None:
        return lights
    for n, driver in driver_rows(encounter).items():
        faced = faced_light(encounter, n, encounter.lights)
        lane = lane_of.get((driver, True))
        if faced is None or lane is None:
            continue
        schedule = faced[0].schedule.between(0.0, encounter.duration)
        if lane not in lights or lights[lane].schedule.end < schedule.end:
            line = place(drawn_for.frame, *faced[0].line.T)
            lights[lane] = replace(faced[0], line=line, schedule=schedule)
    return lights
