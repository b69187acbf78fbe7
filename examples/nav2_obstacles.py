# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Scenarios as moving obstacles for nav2: the newest of `scenarios`, again and again, as the point cloud `obstacles`.

A costmap of nav2 reads it as a source of its obstacle layer, in the frame of the map:

    obstacle_layer:
      plugin: nav2_costmap_2d::ObstacleLayer
      observation_sources: scenario
      scenario: {topic: /obstacles, data_type: PointCloud2, marking: true, clearing: true, max_obstacle_height: 2.0}
"""

from contextlib import suppress
from functools import partial
import sys

import numpy as np
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import PointCloud2, PointField

from scenario_gen.bags.recordings.scenario_decoder import ScenarioDecoder, TOPICS
from scenario_gen.ros.common.topics import create_subscription
from scenario_gen.types import Scenario

PERIOD_S, SPACING_M, HEIGHT_M = 0.1, 0.2, 0.5


def footprint_points(scenario: Scenario, time: float) -> np.ndarray:
    """Return the points (M, 3) [m] that cover the footprints of the vehicles that are present at a time [s]."""
    states = scenario.at(time)
    clouds = [np.zeros((0, 3))]
    for n in np.flatnonzero(states.is_present):
        vehicle, (x, y, yaw) = scenario.vehicles[n], states.poses[n]
        half = np.array([vehicle.length, vehicle.width]) / 2.0
        axes = [np.linspace(-side, side, max(2, round(2.0 * side / SPACING_M))) for side in half]
        ahead, left = (grid.ravel() for grid in np.meshgrid(*axes))
        across = [
            ahead * np.cos(yaw) - left * np.sin(yaw),
            ahead * np.sin(yaw) + left * np.cos(yaw),
        ]
        clouds.append(
            np.column_stack([x + across[0], y + across[1], np.full(ahead.shape, HEIGHT_M)])
        )
    return np.concatenate(clouds)


class Obstacles(Node):
    """Shows the newest scenario to nav2."""

    def __init__(self) -> None:
        super().__init__("nav2_obstacles")
        self.decoder, self.scenario, self.start_ns = ScenarioDecoder(), None, 0
        self.cloud = self.create_publisher(PointCloud2, "obstacles", 1)
        for topic in TOPICS:
            create_subscription(self, topic, partial(self.receive, topic))
        self.create_timer(PERIOD_S, self.publish)

    def receive(self, topic: str, data: bytes) -> None:
        """Keep the newest scenario; a new one begins at once."""
        for _, _, scenario in self.decoder.add(topic, data):
            self.scenario, self.start_ns = scenario, self.get_clock().now().nanoseconds

    def publish(self) -> None:
        """Publish where the vehicles are now."""
        if self.scenario is None:
            return
        now = self.get_clock().now()
        elapsed = (now.nanoseconds - self.start_ns) * 1e-9
        points = footprint_points(self.scenario, elapsed % self.scenario.time[-1])
        message = PointCloud2(height=1, width=len(points), point_step=12, is_dense=True)
        message.header.frame_id, message.header.stamp = self.scenario.frame_id, now.to_msg()
        message.fields = [
            PointField(name=name, offset=4 * k, datatype=PointField.FLOAT32, count=1)
            for k, name in enumerate("xyz")
        ]
        message.row_step = 12 * len(points)
        message.data = points.astype("<f4").tobytes()
        self.cloud.publish(message)


if __name__ == "__main__":
    rclpy.init(args=sys.argv)
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(Obstacles())
