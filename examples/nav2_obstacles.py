# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Scenarios as moving obstacles for nav2: the newest of `scenarios`, again and again, as the occupancy grid `obstacles`.

The grid has the cells of `map`. A costmap of nav2 reads it as a second static layer, after the one of the map:

    plugins: [static_layer, scenario_layer, inflation_layer]
    scenario_layer:
      plugin: nav2_costmap_2d::StaticLayer
      map_topic: /obstacles
      use_maximum: true

Each grid replaces the layer, so a vehicle that has moved leaves no trace. An obstacle layer would mark only what is near the robot.
"""

from contextlib import suppress
from functools import partial
import sys

import numpy as np
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

from msg_conventions.driving import encode_local_map
from msg_conventions.roads import decode_map
from scenario_gen.bags.recordings.scenario_decoder import ScenarioDecoder, TOPICS
from scenario_gen.ros.common.topics import create_subscription, message_class, qos
from scenario_gen.types import Quality, Road, Scenario

PERIOD_S = 0.1


def occupied_cells(scenario: Scenario, time: float, road: Road) -> np.ndarray:
    """Return which cells (H, W) of the map touch the footprint of a vehicle that is present at a time [s]."""
    states = scenario.at(time)
    rows, columns = np.indices(road.drivable.shape) + 0.5
    centres = road.origin + road.resolution * np.stack([columns, rows], axis=-1)
    margin = road.resolution / np.sqrt(2.0)  # from a cell's centre to its corners
    occupied = np.zeros(road.drivable.shape, dtype=bool)
    for n in np.flatnonzero(states.is_present):
        vehicle, (x, y, yaw) = scenario.vehicles[n], states.poses[n]
        dx, dy = centres[..., 0] - x, centres[..., 1] - y
        ahead, left = dx * np.cos(yaw) + dy * np.sin(yaw), dy * np.cos(yaw) - dx * np.sin(yaw)
        is_in_length = np.abs(ahead) <= vehicle.length / 2.0 + margin
        occupied |= is_in_length & (np.abs(left) <= vehicle.width / 2.0 + margin)
    return occupied


class Obstacles(Node):
    """Shows the newest scenario to nav2."""

    def __init__(self) -> None:
        super().__init__("nav2_obstacles")
        self.decoder, self.scenario, self.start_ns = ScenarioDecoder(), None, 0
        self.road = None
        latched = qos(Quality())  # the static layer asks for it
        grid = message_class("nav_msgs/msg/OccupancyGrid")
        self.grid = self.create_publisher(grid, "obstacles", latched)
        for topic in ("map", *TOPICS):
            create_subscription(self, topic, partial(self.receive, topic))
        self.create_timer(PERIOD_S, self.publish)

    def receive(self, topic: str, data: bytes) -> None:
        """Keep the newest map and the newest scenario; a new one begins at once."""
        if topic == "map":
            _, self.road = decode_map(data)
            return
        if decoded := self.decoder.add(topic, data):
            _, _, scenario = decoded
            self.scenario, self.start_ns = scenario, self.get_clock().now().nanoseconds

    def publish(self) -> None:
        """Publish where the vehicles are now."""
        if self.scenario is None or self.road is None:
            return
        now_ns = self.get_clock().now().nanoseconds
        elapsed = (now_ns - self.start_ns) * 1e-9
        occupied = occupied_cells(self.scenario, elapsed % self.scenario.time[-1], self.road)
        road = self.road
        self.grid.publish(
            encode_local_map(occupied, road.resolution, road.origin, road.frame_id, now_ns)
        )


if __name__ == "__main__":
    rclpy.init(args=sys.argv)
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(Obstacles())
