# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A planner under test among the vehicles of a bag: ros2 launch scenario_gen drive.launch.py bag:=out/demo/bag ego:=2."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from scenario_gen.cli.launching import declared, DriveArguments, read_drive, refuse_misspelt

SHARE = Path(get_package_share_directory("scenario_gen"))
IN_DRIVE = ("policy", "step")  # parameters of the drive, named drive.…
OF_NODE = ("bag", "ego", "index", "policy", "rate", "lock_step", "step", "results")


def drive(context, given):
    """Return the processes; whatever is wrong with an argument is said before there is one."""
    arguments = read_drive(
        {name: LaunchConfiguration(name).perform(context) for name in declared(DriveArguments) if name in given}
    )
    values = {f"drive.{name}" if name in IN_DRIVE else name: getattr(arguments, name) for name in OF_NODE if name in given}
    files = [arguments.params] if arguments.params else []
    started = [
        Node(
            package="scenario_gen",
            executable="traffic",
            name="traffic",
            namespace=arguments.namespace,
            parameters=[*files, values],
            output="screen",
        )
    ]
    if arguments.rviz:
        started.append(
            Node(
                package="rviz2",
                executable="rviz2",
                arguments=["-d", str(SHARE / "config" / "suite.rviz")],
                parameters=[{"use_sim_time": True}],
            )
        )
    return started


def generate_launch_description():
    given = set()

    def begin(context):
        given.update(getattr(context, "launch_configurations", context))  # what the command line says, before any default
        refuse_misspelt(given, DriveArguments)

    arguments = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, (default, text) in declared(DriveArguments).items()
    ]
    return LaunchDescription(
        [OpaqueFunction(function=begin), *arguments, OpaqueFunction(function=lambda context: drive(context, given))]
    )
