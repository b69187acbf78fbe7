# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A planner under test among the vehicles of a bag: ros2 launch scenario_gen drive.launch.py bag:=out/demo/bag ego:=2."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch_ros.actions import Node

from scenario_gen.cli.launching import DRIVE, meanings, read

SHARE = Path(get_package_share_directory("scenario_gen"))


def start(launch):
    """Return the processes."""
    own, display = launch.own, ["-d", str(SHARE / "config" / "suite.rviz")]
    traffic = Node(
        package="scenario_gen",
        executable="traffic",
        name="traffic",
        namespace=own.namespace,
        parameters=launch.parameter_files(),
        ros_arguments=["--log-level", own.log_level],
        output="screen",
        respawn=own.respawn,
    )
    rviz = Node(
        package="rviz2", executable="rviz2", arguments=display, parameters=[{"use_sim_time": True}]
    )
    return [traffic, rviz] if own.rviz else [traffic]


def generate_launch_description():
    arguments = [
        DeclareLaunchArgument(name, default_value="", description=text)
        for name, text in meanings(DRIVE).items()
    ]
    begin = OpaqueFunction(
        function=lambda context: start(read(DRIVE, context.launch_configurations))
    )
    return LaunchDescription([*arguments, begin])
