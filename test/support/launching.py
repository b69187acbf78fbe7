# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What the launch files start: the launch package is not among the wheels, so stand-ins take its place."""

import sys
import tempfile
from types import SimpleNamespace
from unittest import mock

from support.suite_processes import ROOT

LOGS = tempfile.TemporaryDirectory(prefix="launches_of_tests_")


def launched(file: str = "suite.launch.py", **arguments: str) -> list[SimpleNamespace]:
    """What a launch file would start."""

    def node(**keywords):
        return SimpleNamespace(
            **{"name": None, "respawn": False, "arguments": [], "parameters": [], **keywords}
        )

    def declare(name, *, default_value, description):
        assert description and default_value == ""
        return name

    stand_ins = {
        "launch": mock.MagicMock(LaunchDescription=list),
        "launch.actions": mock.MagicMock(
            DeclareLaunchArgument=declare, OpaqueFunction=lambda *, function: function
        ),
        "launch.logging": mock.MagicMock(launch_config=SimpleNamespace(log_dir=LOGS.name)),
        "launch_ros": mock.MagicMock(),
        "launch_ros.actions": mock.MagicMock(Node=node),
        "ament_index_python.packages": mock.MagicMock(
            get_package_share_directory=lambda _: str(ROOT)
        ),
    }
    given = [f"{name}:={value}" for name, value in arguments.items()]
    line = ["ros2", "launch", "scenario_gen", file, *given]
    with mock.patch.dict(sys.modules, stand_ins), mock.patch.object(sys, "argv", line):
        scope: dict[str, object] = {}
        exec(compile((ROOT / "launch" / file).read_text(), file, "exec"), scope)
        *declared, begin = scope["generate_launch_description"]()
        return begin(
            SimpleNamespace(launch_configurations=dict.fromkeys(declared, "") | arguments)
        )


def words(node: SimpleNamespace) -> list[str]:
    """The command line with which launch_ros starts a node, behind its executable."""
    names = ["-r", f"__node:={node.name}"] if node.name else []
    files = [word for path in node.parameters for word in ("--params-file", path)]
    return [
        "--ros-args",
        *node.ros_arguments,
        *names,
        "-r",
        f"__ns:={node.namespace or '/'}",
        *files,
    ]
