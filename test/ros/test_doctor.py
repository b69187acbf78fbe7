# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The doctor finds what is missing, and nothing where nothing is."""

import os
from pathlib import Path
import subprocess
import sys

import pytest

from scenario_gen.ros.common.doctor import ERROR, examine, OK, packages, python

ROOT = Path(__file__).resolve().parents[2]


def test_versions_and_packages_are_judged():
    assert [python(version).level for version in ((3, 10), (3, 12), (3, 14))] == [ERROR, OK, ERROR]
    assert (
        packages("packages", ("json", "no_such_module"), "install it").message
        == "missing: no_such_module; install it"
    )


@pytest.mark.dds
def test_a_sound_environment_is_sound_and_an_rmw_that_is_not_there_is_an_error(domain):
    environment = os.environ | {"ROS_DOMAIN_ID": str(domain)}
    assert {finding.level for finding in examine(environment)} == {OK}
    *_, last = examine(environment | {"RMW_IMPLEMENTATION": "rmw_no_such_cpp"})
    assert last.level == ERROR and "rmw" in last.message.lower()


def test_without_ros_and_without_packages_it_still_answers():
    """-S hides all that is installed."""
    command = [sys.executable, "-S", "-m", "scenario_gen.ros.common.doctor"]
    answer = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, timeout=120, check=False
    )
    assert answer.returncode == 1 and answer.stderr == ""
    assert "missing: numpy" in answer.stdout and "ROS 2        not here" in answer.stdout
