# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The whole suite: ros2 launch scenario_gen suite.launch.py log:=/path/to/log road:=t_intersection count:=50 seed:=7."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch_ros.actions import Node

from scenario_gen.cli.launching import meanings, NODES, read, SUITE

SHARE = Path(get_package_share_directory("scenario_gen"))


def start(launch):
    """Return the processes."""
    own = launch.own
    common = {
        "package": "scenario_gen",
        "namespace": own.namespace,
        "parameters": launch.parameter_files(SHARE / "config" / "suite.yaml"),
        "ros_arguments": ["--log-level", own.log_level],
        "output": "screen",
        "respawn_delay": 2.0,
    }
    names = [name for name in NODES if name not in launch.left_out]
    if own.composed:  # without a name, for it would be that of every node in the process
        started = [Node(executable="suite", arguments=["--nodes", ",".join(names)], **common)]
    else:  # a bag is begun once
        started = [
            Node(executable=name, name=name, respawn=own.respawn and name != "recorder", **common)
            for name in names
        ]
    if own.rviz:
        # tracks lie in local_enu: shown on the map's origin, so that RViz can show both
        frames = ["--frame-id", "map", "--child-frame-id", "local_enu"]
        display = ["-d", str(SHARE / "config" / "suite.rviz")]
        started += [
            Node(package="tf2_ros", executable="static_transform_publisher", arguments=frames),
            Node(package="rviz2", executable="rviz2", arguments=display, namespace=own.namespace),
        ]
    return started


def generate_launch_description():
    arguments = [
        DeclareLaunchArgument(name, default_value="", description=text)
        for name, text in meanings(SUITE).items()
    ]
    begin = OpaqueFunction(
        function=lambda context: start(read(SUITE, context.launch_configurations))
    )
    return LaunchDescription([*arguments, begin])
