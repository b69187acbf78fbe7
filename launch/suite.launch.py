# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The whole suite: ros2 launch scenario_gen suite.launch.py log:=/path/to/log road:=t_intersection count:=50 seed:=7."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, GroupAction
from launch.conditions import IfCondition, UnlessCondition
from launch.substitutions import LaunchConfiguration, PythonExpression
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

SHARE = Path(get_package_share_directory("scenario_gen"))

ARGUMENTS = {
    "log": ("", "log to read: a file, a bag or a folder of files"),
    "encounter": ("0", "which encounter of the log, from 0"),
    "road": ("t_intersection", "straight, t_intersection, four_way, corridor, or a map_server YAML file"),
    "count": ("50", "scenarios to generate"),
    "seed": ("0", "seed of every stage"),
    "namespace": ("", "namespace of all nodes"),
    "params": (str(SHARE / "config" / "suite.yaml"), "parameter file"),
    "bag": ("", "folder to record to; empty records nothing"),
    "composed": ("false", "all nodes in one process, for small machines"),
    "stream": ("false", "play the log as fixes and speeds of each vehicle, with /clock, instead of as tracks"),
    "rate": ("1.0", "how many times as fast as it was recorded the stream is"),
    "use_sim_time": ("false", "the nodes follow /clock"),
    "rviz": ("false", "open RViz"),
}


def argument(name, kind):
    return ParameterValue(LaunchConfiguration(name), value_type=kind)


def settings(**parameters):
    return [LaunchConfiguration("params"), parameters | {"use_sim_time": argument("use_sim_time", bool)}]


def node(name, condition=None, **parameters):
    return Node(
        package="scenario_gen",
        executable=name,
        name=name,
        namespace=LaunchConfiguration("namespace"),
        parameters=settings(**parameters),
        output="screen",
        condition=condition,
    )


def generate_launch_description():
    road = {"road_name": argument("road", str), "wait_for_tracks": True}
    seed = {"seed": argument("seed", int)}
    count = {"count": argument("count", int)}
    log = {
        "log_path": argument("log", str),
        "encounter": argument("encounter", int),
        "stream": argument("stream", bool),
        "rate": argument("rate", float),
    }
    bag = {"bag": argument("bag", str)}
    apart = [
        node("recorder", IfCondition(PythonExpression(["'", LaunchConfiguration("bag"), "' != ''"])), **bag),
        node("road_server", **road),
        node("segmenter", **seed),
        node("planner", **seed),
        node("gp_sampler", **seed, **count),
        node("evaluator"),
        node("log_player", **log),
    ]
    # without a name, for it would be that of every node in the process; what a parameter is called says whose it is
    together = Node(
        package="scenario_gen",
        executable="suite",
        namespace=LaunchConfiguration("namespace"),
        parameters=settings(**road, **seed, **count, **log, **bag),
        output="screen",
        condition=IfCondition(LaunchConfiguration("composed")),
    )
    return LaunchDescription(
        [
            *(DeclareLaunchArgument(name, default_value=value, description=text) for name, (value, text) in ARGUMENTS.items()),
            GroupAction(apart, condition=UnlessCondition(LaunchConfiguration("composed"))),
            together,
            # tracks lie in local_enu: shown on the map's origin, so that RViz can show both
            Node(
                package="tf2_ros",
                executable="static_transform_publisher",
                arguments=["--frame-id", "map", "--child-frame-id", "local_enu"],
                condition=IfCondition(LaunchConfiguration("rviz")),
            ),
            Node(
                package="rviz2",
                executable="rviz2",
                arguments=["-d", str(SHARE / "config" / "suite.rviz")],
                namespace=LaunchConfiguration("namespace"),
                condition=IfCondition(LaunchConfiguration("rviz")),
            ),
        ]
    )
