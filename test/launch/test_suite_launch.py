# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The launch file as `ros2 launch` runs it: real launch, real processes; the suite comes up, generates, records and ends cleanly.

It runs where a Jazzy is sourced and this package is built (`colcon test` after `colcon build`); elsewhere
test/ros/test_launching.py runs the launch file with stand-ins.
"""

import os
from pathlib import Path
import tempfile
import unittest

import pytest
from support.bag_examples import bag_topics
from support.skips import NO_LAUNCH

launch_testing = pytest.importorskip("launch_testing", reason=NO_LAUNCH)
actions = pytest.importorskip("launch.actions", reason=NO_LAUNCH)
asserts = pytest.importorskip("launch_testing.asserts", reason=NO_LAUNCH)
LaunchDescription = pytest.importorskip("launch", reason=NO_LAUNCH).LaunchDescription
ReadyToTest = pytest.importorskip("launch_testing.actions", reason=NO_LAUNCH).ReadyToTest
sources = pytest.importorskip("launch.launch_description_sources", reason=NO_LAUNCH)
pytest.importorskip("launch_ros", reason=NO_LAUNCH)
index = pytest.importorskip("ament_index_python.packages", reason=NO_LAUNCH)

try:
    SHARE = Path(index.get_package_share_directory("scenario_gen"))
except index.PackageNotFoundError:
    pytest.skip(NO_LAUNCH, allow_module_level=True)

SCENARIOS, SPACE = 3, "/launched"
FOLDER = Path(tempfile.mkdtemp(prefix="scenario_gen_launch_"))
LOG = Path(__file__).resolve().parents[2] / "scenario_gen" / "resources" / "synthetic_c"


@pytest.mark.launch_test
def generate_test_description():
    arguments = {
        "log": LOG,
        "road": "straight",
        "count": SCENARIOS,
        "seed": 7,
        "namespace": SPACE,
        "bag": FOLDER / "bag",
    }
    suite = actions.IncludeLaunchDescription(
        sources.PythonLaunchDescriptionSource(str(SHARE / "launch" / "suite.launch.py")),
        launch_arguments=[(name, str(value)) for name, value in arguments.items()],
    )
    return LaunchDescription([suite, ReadyToTest()])


class TestTheSuite(unittest.TestCase):
    """While it runs."""

    def test_requested_scenarios_are_generated(self):
        from support.suite_processes import Client

        client = Client(int(os.environ.get("ROS_DOMAIN_ID", "0")))
        try:
            topics = [f"{SPACE}/{name}" for name in ("map", "tracks", "fit", "report")]
            client.hear(*topics, f"{SPACE}/scenarios")
            client.wait(f"{SPACE}/scenarios", SCENARIOS)
            for topic in topics:
                client.wait(topic)
        finally:
            client.close()


@launch_testing.post_shutdown_test()
class TestTheEnd(unittest.TestCase):
    """When all have ended."""

    def test_every_node_ends_with_0(self, proc_info):
        asserts.assertExitCodes(proc_info, allowable_exit_codes=[0])

    def test_the_bag_is_whole(self):
        counts = {topic.name: topic.count for topic in bag_topics(FOLDER / "bag")}
        self.assertEqual(counts[f"{SPACE}/scenarios"], SCENARIOS)
