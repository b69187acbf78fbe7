# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The doctor finds what is wrong, and nothing where nothing is."""

import os
from pathlib import Path
import subprocess
import sys
import time

import pytest

from scenario_gen.ros.plumbing.doctor import discovery, ERROR, examine, OK, packages, python, variables, WARNING

ROOT = Path(__file__).resolve().parents[2]
MISFITS = """
import time, rclpy
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import String
rclpy.init()
node = rclpy.create_node("misfit")
node.create_publisher(String, "misfit", QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT))
node.create_subscription(String, "misfit", print, QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE))
print("ready", flush=True)
time.sleep(60)
"""


def levels(findings):
    return {finding.subject: finding.level for finding in findings}


def test_versions_and_packages_are_judged():
    assert python((3, 10)).level == ERROR
    assert python((3, 14)).level == ERROR
    assert python((3, 12)).level == OK
    assert packages("packages", ("json", "no_such_module"), "install it").message == "missing: no_such_module; install it"


def test_variables_are_judged():
    assert levels(variables({})) == {"domain": OK, "discovery": OK}
    assert levels(variables({"ROS_DOMAIN_ID": "x"}))["domain"] == ERROR
    assert levels(variables({"ROS_DOMAIN_ID": "233"}))["domain"] == ERROR
    assert levels(variables({"ROS_DOMAIN_ID": "150"}))["domain"] == WARNING
    assert levels(variables({"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"}))["discovery"] == ERROR
    assert levels(variables({"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF", "ROS_STATIC_PEERS": "10.0.0.2"}))["discovery"] == OK
    assert levels(variables({"ROS_AUTOMATIC_DISCOVERY_RANGE": "home"}))["discovery"] == ERROR
    assert levels(variables({"ROS_LOCALHOST_ONLY": "1"}))["discovery"] == WARNING
    assert levels(variables({"CYCLONEDDS_URI": "file:///no/such.xml"}))["DDS profile"] == ERROR


@pytest.mark.dds
def test_a_sound_environment_is_sound_and_a_misfit_on_the_domain_is_found(domain):
    environment = os.environ | {"ROS_DOMAIN_ID": str(domain)}
    found = list(examine(environment))
    assert {finding.level for finding in found} == {OK}, found
    assert {"loop-back", "RMW", "QoS", "kernels", "interfaces"} <= set(levels(found))
    misfit = subprocess.Popen([sys.executable, "-c", MISFITS], stdout=subprocess.PIPE, text=True, env=environment)
    try:
        assert misfit.stdout.readline() == "ready\n"
        for _ in range(20):  # discovery takes its time on a busy machine
            (fault,) = [finding for finding in discovery(environment) if finding.subject == "QoS"]
            if fault.level != OK:
                break
            time.sleep(0.5)
        assert fault.level == ERROR
        assert "/misfit" in fault.message and "eliab" in fault.message
    finally:
        misfit.kill()
        misfit.wait()


@pytest.mark.dds
def test_an_rmw_that_is_not_there_is_an_error(domain):
    (found,) = discovery(os.environ | {"ROS_DOMAIN_ID": str(domain), "RMW_IMPLEMENTATION": "rmw_no_such_cpp"})
    assert (found.level, found.subject) == (ERROR, "DDS")
    assert "rmw" in found.message.lower()


def test_without_ros_and_without_packages_it_still_answers():
    """-S hides all that is installed."""
    answer = subprocess.run(
        [sys.executable, "-S", "-m", "scenario_gen.ros.plumbing.doctor"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert answer.returncode == 1
    assert "missing: numpy" in answer.stdout
    assert "ROS 2        not here" in answer.stdout
    assert "Traceback" not in answer.stdout + answer.stderr
