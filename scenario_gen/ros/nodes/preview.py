# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""preview: the last published scenario in motion, on /tf and `preview`.

It is for people who look: it keeps nobody waiting, and of many scenarios it takes the newest when
the one that is shown ends. Frames are `preview/vehicle_<id>`, so that a player of the same
vehicles is not disturbed.
"""

from dataclasses import dataclass
from time import monotonic

import numpy as np

from msg_conventions.pictures import vehicle_markers
from msg_conventions.poses import encode_frames
from scenario_gen.bags.recordings.scenario_decoder import ScenarioDecoder, TOPICS
from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.ros.common.stage_node import StageNode
from scenario_gen.ros.common.timers import create_steady_timer
from scenario_gen.ros.common.topics import create_frames_publisher
from scenario_gen.types import Scenario, tokens

IDLE_PERIOD_S = 1.0  # between two looks whether there is something to show, to somebody


@dataclass(frozen=True)
class Config(Parameters):
    """The preview's parameters."""

    frame_rate: float = parameter(20.0, "frames a second", unit="Hz", low=1.0, high=100.0)
    pause: float = parameter(
        1.0, "how long the end is shown before it begins again", unit="s", low=0.0, high=60.0
    )


class Preview(StageNode):
    """Shows the newest scenario."""

    INPUTS = TOPICS
    OUTPUTS = ("preview",)

    def __init__(self, namespace: str | None = None) -> None:
        super().__init__("preview", Config(), namespace)
        self._tf = create_frames_publisher(self)
        self.stopped()
        self._timer = create_steady_timer(self, IDLE_PERIOD_S, self._tick)

    def stopped(self) -> None:
        """Forget what was shown."""
        self._arriving = ScenarioDecoder()
        self._newest: Scenario | None = None
        self._shown: Scenario | None = None
        self._since = 0.0  # start of the shown one on the steady clock [s]

    def received(self, topic: str, data: bytes) -> None:
        """Take each scenario once all of its messages have come."""
        if decoded := self._arriving.add(topic, data):
            self._newest = decoded[2]

    def _pace_ticks(self) -> None:
        """Tick at the frame rate while a scenario is watched."""
        period = IDLE_PERIOD_S
        if self._newest and (self.count_subscribers("preview") or self.count_subscribers("/tf")):
            period = 1.0 / self.config.frame_rate
        period_ns = round(period * 1e9)
        if period_ns != self._timer.timer_period_ns:
            self._timer.timer_period_ns = period_ns
            self._timer.reset()

    def _tick(self) -> None:
        """Publish where everybody is."""
        self._pace_ticks()
        now, shown = monotonic(), self._shown
        if shown is None or now - self._since > float(shown.time[-1]) + self.config.pause:
            if self._newest is None:
                return
            self._shown = shown = self._newest.with_trailers()
            self._since = now
        self._publish(shown, min(now - self._since, float(shown.time[-1])))

    def _publish(self, scenario: Scenario, time: float) -> None:
        """Publish the frames and markers of the vehicles that are present at a time [s]."""
        stamp_ns = self.get_clock().now().nanoseconds
        states = scenario.at(time)
        names = tokens(scenario.ids)
        children = [f"preview/vehicle_{names[n]}" for n in np.flatnonzero(states.is_present)]
        frames = encode_frames(
            states.poses[states.is_present], children, scenario.frame_id, stamp_ns
        )
        self.outputs.publish(self._tf, frames)
        markers = vehicle_markers(
            scenario.vehicles, states.poses, states.is_present, -1, scenario.frame_id, stamp_ns
        )
        self.outputs.send("preview", markers)
