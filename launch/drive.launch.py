# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A planner under test among the vehicles of a bag: ros2 launch scenario_gen drive.launch.py bag:=out/demo/bag ego:=2."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

SHARE = Path(get_package_share_directory("scenario_gen"))
ARGUMENTS = {
    "bag": ("", "bag with scenarios; empty: live from the topics scenarios and map"),
    "ego": ("", "id of the vehicle in whose place the ego drives; empty: the first"),
    "index": ("0", "number of the first scenario, from 0"),
    "policy": ("reactive", "reactive or replay"),
    "rate": ("1.0", "how many times as fast as real time"),
    "lock_step": ("false", "one step for each call of traffic/step"),
    "step": ("0.1", "seconds of a step"),
    "results": ("", "folder for drives.json and junit.xml"),
    "namespace": ("", "of the node"),
    "params": ("", "a parameter file, read first"),
    "rviz": ("false", "start RViz, too"),
}
IN_DRIVE = ("policy", "step")  # parameters of the drive, named drive.…
NUMBERS = {"index": int, "rate": float, "step": float}


def drive(context):
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    values = {}
    for name in ("bag", "ego", "index", "policy", "rate", "lock_step", "step", "results"):
        value = given[name]
        if name in NUMBERS:
            value = NUMBERS[name](value)
        elif name == "lock_step":
            value = value.lower() in ("true", "1", "yes")
        values[f"drive.{name}" if name in IN_DRIVE else name] = value
    files = [given["params"]] if given["params"] else []
    started = [
        Node(
            package="scenario_gen",
            executable="traffic",
            name="traffic",
            namespace=given["namespace"],
            parameters=[*files, values],
            output="screen",
        )
    ]
    if given["rviz"].lower() in ("true", "1", "yes"):
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
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=text) for name, (default, text) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=drive)])
