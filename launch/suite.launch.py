# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The whole suite: ros2 launch scenario_gen suite.launch.py log:=/path/to/log road:=t_intersection count:=50 seed:=7."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from scenario_gen.cli.launching import declared, NODES, read_arguments, refuse_misspelt

SHARE = Path(get_package_share_directory("scenario_gen"))


def suite(context, given):
    """Return the processes; whatever is wrong with an argument is said before there is one."""
    launch = read_arguments({name: LaunchConfiguration(name).perform(context) for name in declared() if name in given})
    arguments = launch.arguments
    common = {
        "package": "scenario_gen",
        "namespace": arguments.namespace,
        "parameters": launch.parameter_files(SHARE / "config" / "suite.yaml"),
        "ros_arguments": ["--log-level", arguments.log_level],
        "output": "screen",
        "respawn_delay": 2.0,
    }
    if arguments.composed:  # without a name, for it would be that of every node in the process
        started = [Node(executable="suite", respawn=arguments.respawn, **common)]
    else:
        names = [name for name in NODES[1:] if name not in launch.left_out]
        started = [Node(executable=name, name=name, respawn=arguments.respawn, **common) for name in names]
        if launch.records:  # a bag is begun once
            started.insert(0, Node(executable=NODES[0], name=NODES[0], **common))
    if arguments.rviz:
        # tracks lie in local_enu: shown on the map's origin, so that RViz can show both
        frames = ["--frame-id", "map", "--child-frame-id", "local_enu"]
        display = ["-d", str(SHARE / "config" / "suite.rviz")]
        started += [
            Node(package="tf2_ros", executable="static_transform_publisher", arguments=frames),
            Node(package="rviz2", executable="rviz2", arguments=display, namespace=arguments.namespace),
        ]
    return started


def generate_launch_description():
    given = set()

    def begin(context):
        given.update(getattr(context, "launch_configurations", context))  # what the command line says, before any default
        refuse_misspelt(given)

    arguments = [
        DeclareLaunchArgument(name, default_value=default, description=text) for name, (default, text) in declared().items()
    ]
    return LaunchDescription(
        [OpaqueFunction(function=begin), *arguments, OpaqueFunction(function=lambda context: suite(context, given))]
    )
