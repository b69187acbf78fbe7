# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A planner under test in the traffic of a bag: ros2 launch scenario_gen drive.launch.py bag:=out/demo/bag ego:=2."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.logging import launch_config
from launch_ros.actions import Node

from scenario_gen.ros.launch_arguments import DRIVE_FILE, parse_arguments

SHARE = Path(get_package_share_directory("scenario_gen"))


def start(context):
    """Return the processes."""
    launch = parse_arguments(DRIVE_FILE, context.launch_configurations)
    options = launch.options
    traffic = Node(
        package="scenario_gen",
        executable="traffic",
        name="traffic",
        namespace=options.namespace,
        parameters=launch.parameter_files(launch_config.log_dir),
        ros_arguments=["--log-level", options.log_level],
        output="screen",
        respawn=options.respawn,
    )
    rviz = Node(
        package="rviz2",
        executable="rviz2",
        arguments=["-d", str(SHARE / "config" / "suite.rviz")],
        parameters=[{"use_sim_time": True}],
    )
    return [traffic, rviz] if options.rviz else [traffic]


def generate_launch_description():
    arguments = [
        DeclareLaunchArgument(name, default_value="", description=text)
        for name, text in DRIVE_FILE.descriptions().items()
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=start)])
