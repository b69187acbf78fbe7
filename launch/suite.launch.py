# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The whole suite: ros2 launch scenario_gen suite.launch.py log:=/path/to/log road:=t_intersection count:=50 seed:=7."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.logging import launch_config
from launch_ros.actions import Node

from scenario_gen.ros.launch_arguments import parse_arguments, SUITE_FILE
from scenario_gen.ros.node_names import RECORDER_END_S, SUITE

SHARE = Path(get_package_share_directory("scenario_gen"))


def start(context):
    """Return the processes."""
    launch = parse_arguments(SUITE_FILE, context.launch_configurations)
    options = launch.options
    common = {
        "package": "scenario_gen",
        "namespace": options.namespace,
        "parameters": launch.parameter_files(
            launch_config.log_dir, SHARE / "config" / "suite.yaml"
        ),
        "ros_arguments": ["--log-level", options.log_level],
        "output": "screen",
        "respawn_delay": 2.0,
    }
    names = [name for name in SUITE if name not in launch.excluded]
    if options.composed:  # without a name, which every node of the process would get
        nodes = [
            Node(
                executable="suite",
                arguments=["--nodes", ",".join(names)],
                sigterm_timeout=str(RECORDER_END_S),
                **common,
            )
        ]
    else:  # a recorder cannot continue a bag, so it does not respawn
        nodes = [
            Node(
                executable=name,
                name=name,
                respawn=options.respawn and name != "recorder",
                sigterm_timeout=str(RECORDER_END_S if name == "recorder" else 5.0),
                **common,
            )
            for name in names
        ]
    if options.rviz:
        # RViz shows the tracks' frame, local_enu, at the map's origin.
        frames = ["--frame-id", "map", "--child-frame-id", "local_enu"]
        display = ["-d", str(SHARE / "config" / "suite.rviz")]
        nodes += [
            Node(package="tf2_ros", executable="static_transform_publisher", arguments=frames),
            Node(
                package="rviz2",
                executable="rviz2",
                arguments=display,
                namespace=options.namespace,
            ),
        ]
    return nodes


def generate_launch_description():
    arguments = [
        DeclareLaunchArgument(name, default_value="", description=text)
        for name, text in SUITE_FILE.descriptions().items()
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=start)])
