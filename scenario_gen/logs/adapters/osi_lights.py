# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Traffic lights in GroundTruth messages of ASAM OSI: the bulbs that are assigned to a lane.

| quantity | field | unit |
|---|---|---|
| light | traffic_light.classification.assigned_lane_id; each bulb is an object | |
| state | classification.color of the bulbs whose mode is constant or counting | |
| stop line | lane.classification.centerline; its end in the direction of traffic | m |

A flashing bulb, or none that is lit, is a light that is off. Lights for people, bicycles, buses
and trams are left out. A lane with a green arrow beside red is green.

Source: OSI 3.8, osi_trafficlight.proto and osi_lane.proto.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from scenario_gen.logs.signals import line_across, RawSignal, sampled_schedule
from scenario_gen.numerics import Floats, NS_PER_S
from scenario_gen.types import SignalState


@dataclass
class LightTrace:
    """The lights of a trace: states by lane and stamp [ns], and stop lines by lane."""

    states: dict[int, dict[int, SignalState]] = field(default_factory=dict)
    lines: dict[int, Floats] = field(default_factory=dict)

    def add(self, message: Any, nanoseconds: int) -> None:
        """Add the lights and lanes of a message."""
        bulbs: dict[int, list[Any]] = {}
        for light in message.traffic_light:
            bulb = light.classification
            if bulb is not None and not bulb.icon.name.startswith(_ICONS_OF_OTHERS):
                for lane in bulb.assigned_lane_id:
                    bulbs.setdefault(lane.value, []).append(bulb)
        for number, assigned in bulbs.items():
            self.states.setdefault(number, {})[nanoseconds] = _state(assigned)
        for lane in message.lane:
            if lane.id is not None and lane.classification is not None:
                self.lines.setdefault(lane.id.value, _line(lane.classification))

    def signals(self, path: str, notes: list[str]) -> Iterator[RawSignal]:
        """Yield the lights; a note on those that are left out is appended."""
        without_lane = []
        for number, states in sorted(self.states.items()):
            line = self.lines.get(number, np.zeros((0, 2)))
            if not len(line):
                without_lane.append(str(number))
                continue
            times = sorted(states)
            schedule = sampled_schedule(
                [time / NS_PER_S for time in times],
                [states[time] for time in times],
                f"{path}: traffic light of lane {number}",
            )
            yield RawSignal(f"lane {number}", schedule, path, line, (str(number),))
        if without_lane:
            notes.append(
                "traffic lights are left out, since their lanes have no centre line in the trace: "
                f"{', '.join(without_lane)}"
            )


_ICONS_OF_OTHERS = ("PEDESTRIAN", "WALK", "DONT_WALK", "BICYCLE", "TRAM", "BUS")


def _state(bulbs: list[Any]) -> SignalState:
    """Return what the bulbs of a lane show together."""
    modes = {bulb.mode.name for bulb in bulbs}
    if modes <= {"UNKNOWN", "OTHER"}:
        return SignalState.UNKNOWN
    lit = {bulb.color.name for bulb in bulbs if bulb.mode.name in ("CONSTANT", "COUNTING")}
    if "GREEN" in lit:
        return SignalState.GREEN
    if "RED" in lit:
        return SignalState.RED_YELLOW if "YELLOW" in lit else SignalState.RED
    return SignalState.YELLOW if "YELLOW" in lit else SignalState.OFF


def _line(lane: Any) -> Floats:
    """Return the stop line (2, 2) [m] at the end of a lane; (0, 2) without a centre line."""
    points = np.array([[point.x, point.y] for point in lane.centerline]).reshape(-1, 2)
    if not lane.centerline_is_driving_direction:
        points = points[::-1]
    steps = np.diff(points, axis=0)
    moved = np.flatnonzero(np.hypot(*steps.T) > 0.0)
    if not len(moved) or not np.isfinite(points).all():
        return np.zeros((0, 2))
    last = steps[moved[-1]]
    return line_across(points[-1], float(np.arctan2(last[1], last[0])))
