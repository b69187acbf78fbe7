# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Scenarios for Autoware's planners: PredictedObjects, /tf and /clock of the newest of `scenarios`, again and again.

It needs autoware_perception_msgs, and tf2_msgs for /tf. `traffic` with `autoware:=true` also lets the vehicles react to an ego.
"""

from functools import partial
import sys

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

from msg_conventions.autoware import AutowareEncoder, OBJECTS
from msg_conventions.driving import encode_clock
from msg_conventions.poses import encode_frames
from scenario_gen.bags.recordings.scenario_decoder import ScenarioDecoder, TOPICS
from scenario_gen.base.errors import InputError
from scenario_gen.ros.common.timers import create_steady_timer
from scenario_gen.ros.common.topics import (
    create_frames_publisher,
    create_publisher,
    create_subscription,
    publish,
)
from scenario_gen.types import tokens

PERIOD_S = 0.1


class AutowareObjects(Node):
    """Shows the newest scenario to Autoware; the clock of the drive runs on from one scenario to the next."""

    def __init__(self) -> None:
        super().__init__("autoware_objects")
        self.decoder, self.encoder = ScenarioDecoder(), None
        self.k, self.stamp_ns = 0, 1_000_000_000  # the next instant, and the clock
        self.out = {topic: create_publisher(self, topic) for topic in (OBJECTS, "/clock")}
        self.out["/tf"] = create_frames_publisher(self)
        for topic in TOPICS:
            create_subscription(self, topic, partial(self.receive, topic))
        create_steady_timer(self, PERIOD_S, self.step)  # /clock must not depend on /clock

    def receive(self, topic: str, data: bytes) -> None:
        """Keep the newest scenario; a new one begins at once."""
        if decoded := self.decoder.add(topic, data):
            _, _, scenario = decoded
            self.encoder, self.k = AutowareEncoder(scenario), 0

    def step(self) -> None:
        """Publish the next instant that is due, and the time."""
        if self.encoder is None:
            return
        scenario, times = self.encoder.scenario, self.encoder.time_ns
        present = self.encoder.present_at(self.k)
        children = [f"vehicle_{name}" for name in tokens(scenario.ids)]
        poses = self.encoder.states[present, self.k, :3]
        frames = encode_frames(
            poses, [children[n] for n in present], scenario.frame_id, self.stamp_ns
        )
        messages = {
            "/clock": encode_clock(self.stamp_ns),
            "/tf": frames,
            OBJECTS: self.encoder.predicted_objects(self.k, self.stamp_ns),
        }
        for topic, data in messages.items():
            publish(self, self.out[topic], data)
        self.stamp_ns += round(PERIOD_S * 1e9)
        due = times[self.k] + round(PERIOD_S * 1e9)
        self.k = int(times.searchsorted(due)) if due <= times[-1] else 0


if __name__ == "__main__":
    rclpy.init(args=sys.argv)
    try:
        rclpy.spin(AutowareObjects())
    except InputError as error:  # a package of messages is not installed
        sys.exit(f"skipped: {error}")
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
