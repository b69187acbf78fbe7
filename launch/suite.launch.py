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
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
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
    "rviz": ("false", "open RViz"),
}


def argument(name, kind):
    return ParameterValue(LaunchConfiguration(name), value_type=kind)


def node(name, condition=None, **parameters):
    return Node(
        package="scenario_gen",
        executable=name,
        name=name,
        namespace=LaunchConfiguration("namespace"),
        parameters=[LaunchConfiguration("params"), parameters],
        output="screen",
        condition=condition,
    )


def generate_launch_description():
    seed = argument("seed", int)
    recording = IfCondition(PythonExpression(["'", LaunchConfiguration("bag"), "' != ''"]))
    return LaunchDescription(
        [
            *(DeclareLaunchArgument(name, default_value=value, description=text) for name, (value, text) in ARGUMENTS.items()),
            node("recorder", recording, bag=argument("bag", str)),
            node("road_server", road_name=argument("road", str), wait_for_tracks=True),
            node("segmenter", seed=seed),
            node("planner", seed=seed),
            node("gp_sampler", seed=seed, count=argument("count", int)),
            node("evaluator"),
            node("log_player", log_path=argument("log", str), encounter=argument("encounter", int)),
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
