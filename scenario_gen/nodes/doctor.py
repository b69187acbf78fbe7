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

"""doctor: what is wrong with an environment, and what to do about it; works without ROS, and says so.

Only the standard library is imported here: `python -m scenario_gen.nodes.doctor` still answers where `scenario-gen doctor` cannot
start for want of a package. What needs rclpy or numba runs in processes of its own (doctor_probe.py): a crash there is a finding.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib import metadata
import importlib.util
import json
import os
from pathlib import Path
import subprocess
import sys
from typing import Any

OK, WARNING, ERROR = "ok", "warning", "error"
PYTHONS = ((3, 11), (3, 13))
MODULES = (
    *("numpy", "scipy", "numba", "ompl", "daqp", "clarabel", "mcap", "mcap_ros2", "rosbags", "pandas", "pyarrow"),
    *("shapely", "PIL", "yaml", "jinja2", "plotly", "typer", "rich"),
)
INTERFACES = (
    *("builtin_interfaces", "diagnostic_msgs", "geometry_msgs", "lifecycle_msgs", "nav_msgs", "rcl_interfaces", "rosgraph_msgs"),
    *("sensor_msgs", "std_msgs", "std_srvs", "trajectory_msgs", "visualization_msgs"),
)
RANGES = ("SUBNET", "LOCALHOST", "OFF", "SYSTEM_DEFAULT")
PROFILES = ("FASTDDS_DEFAULT_PROFILES_FILE", "FASTRTPS_DEFAULT_PROFILES_FILE", "CYCLONEDDS_URI")
PATIENCE = 20.0  # seconds for two processes to start and to meet


@dataclass(frozen=True)
class Finding:
    """One thing looked at: `level` is "ok", "warning" or "error"; the message says what to do."""

    level: str
    subject: str
    message: str


def examine(environment: Mapping[str, str] | None = None) -> Iterator[Finding]:
    """Yield the findings, quick ones first; variables are those of `environment`, this process's if None."""
    environment = os.environ if environment is None else environment
    yield python(sys.version_info[:2])
    yield packages("packages", MODULES, "install requirements.lock (`make install`)")
    yield _kernels()
    if importlib.util.find_spec("rclpy") is None:
        words = "not here: everything works but the nodes and `demo --ros`. Source a Jazzy installation, or `make install`"
        yield Finding(WARNING, "ROS 2", words)
        return
    yield installation(environment)
    yield packages("interfaces", INTERFACES, "install ros-jazzy-common-interfaces, or source a Jazzy installation")
    yield from variables(environment)
    yield from meeting(environment)


def python(version: tuple[int, ...]) -> Finding:
    """Judge the version of Python."""
    low, high = (".".join(map(str, bound)) for bound in PYTHONS)
    text = ".".join(map(str, version))
    if PYTHONS[0] <= tuple(version) <= PYTHONS[1]:
        return Finding(OK, "Python", f"{text} in {sys.prefix}")
    return Finding(ERROR, "Python", f"{text} is not supported; {low} to {high} is")


def packages(subject: str, modules: tuple[str, ...], remedy: str) -> Finding:
    """Say which modules cannot be found."""
    missing = [name for name in modules if importlib.util.find_spec(name) is None]
    if missing:
        return Finding(ERROR, subject, f"missing: {', '.join(missing)}; {remedy}")
    return Finding(OK, subject, f"all {len(modules)} are there")


def installation(environment: Mapping[str, str]) -> Finding:
    """Say whose rclpy is imported: the wheels' or a sourced installation's."""
    origin = Path(getattr(importlib.util.find_spec("rclpy"), "origin", "") or "")
    distribution = environment.get("ROS_DISTRO", "")
    if Path(sys.prefix) in origin.parents:
        version = next((metadata.version(name) for name in ("ros-jazzy-rclpy",) if _installed(name)), "of unknown version")
        if distribution:
            words = f"the wheels' rclpy ({version}) hides that of the sourced ROS ({distribution}); use a shell with one of both"
            return Finding(WARNING, "ROS 2", words)
        return Finding(OK, "ROS 2", f"Jazzy wheels, rclpy {version}")
    if distribution != "jazzy":
        return Finding(
            WARNING, "ROS 2", f"{distribution or 'an unknown distribution'} at {origin.parent}; this is made for jazzy"
        )
    return Finding(OK, "ROS 2", f"{distribution}, sourced: {origin.parent}")


def _installed(name: str) -> bool:
    return any(True for _ in metadata.distributions(name=name))


def variables(environment: Mapping[str, str]) -> Iterator[Finding]:
    """Judge the variables that decide who meets whom."""
    domain = environment.get("ROS_DOMAIN_ID", "") or "0"
    if not domain.isdigit() or int(domain) > 232:
        yield Finding(ERROR, "domain", f"ROS_DOMAIN_ID is {domain!r}; it must be a whole number from 0 to 232, better up to 101")
    elif int(domain) > 101:
        yield Finding(WARNING, "domain", f"ROS_DOMAIN_ID is {domain}: its ports may be taken by other programs; choose 0 to 101")
    else:
        yield Finding(OK, "domain", f"{domain}; processes with another ROS_DOMAIN_ID are not seen")
    reach = environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "") or "SUBNET"
    peers = environment.get("ROS_STATIC_PEERS", "")
    if environment.get("ROS_LOCALHOST_ONLY") == "1":
        yield Finding(WARNING, "discovery", "ROS_LOCALHOST_ONLY is out of date; set ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST")
    elif reach.upper() not in RANGES:
        yield Finding(ERROR, "discovery", f"ROS_AUTOMATIC_DISCOVERY_RANGE is {reach!r}; choose one of {', '.join(RANGES)}")
    elif reach.upper() == "OFF" and not peers:
        yield Finding(ERROR, "discovery", "ROS_AUTOMATIC_DISCOVERY_RANGE is OFF: no two processes meet; set LOCALHOST or SUBNET")
    else:
        yield Finding(OK, "discovery", f"range {reach.upper()}{f', static peers {peers}' if peers else ''}")
    for name in PROFILES:
        path = environment.get(name, "").removeprefix("file://")
        if path and not path.lstrip().startswith("<") and not Path(path).is_file():
            yield Finding(ERROR, "DDS profile", f"{name} names {path}, which is not there")


def meeting(environment: Mapping[str, str]) -> Iterator[Finding]:
    """Let two processes talk on the domain, and look at the topics that are visible there."""
    topic = f"scenario_gen_doctor_{os.getpid()}"
    speaker = _child("speak", topic, environment)
    listener = _child("listen", topic, environment)
    try:
        output, errors = listener.communicate(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        listener.kill()
        output, errors = listener.communicate()
    finally:
        speaker.kill()
        _, silence = speaker.communicate()
    if not output.strip():
        last = [line for line in (errors + silence).splitlines() if line.strip()][-1:]
        yield Finding(ERROR, "DDS", f"rclpy does not start: {last[0].strip() if last else 'no word of it'}")
        return
    yield from judged(json.loads(output.splitlines()[-1]))


def judged(heard: Mapping[str, Any]) -> Iterator[Finding]:
    """Judge what the listener heard and saw."""
    yield Finding(OK, "RMW", heard["rmw"])
    if heard["received"]:
        yield Finding(
            OK, "loop-back", f"two processes met after {heard['seconds']:.1f} s and {heard['received']} messages arrived"
        )
    else:
        words = (
            "two processes on this host do not hear each other: look at the firewall, multicast on the loopback device, /dev/shm"
        )
        yield Finding(ERROR, "loop-back", words)
    for fault in heard["faults"]:
        yield Finding(ERROR, "QoS", fault)
    if not heard["faults"]:
        yield Finding(OK, "QoS", f"no mismatch among {heard['topics']} visible topics")


def _kernels() -> Finding:
    child = _child("kernels", "", os.environ)
    output, errors = child.communicate()
    if not output.strip():
        last = [line for line in errors.splitlines() if line.strip()][-1:]
        return Finding(ERROR, "kernels", f"cannot be loaded: {last[0].strip() if last else 'no word of it'}")
    heard = json.loads(output.splitlines()[-1])
    if heard["missing"]:
        words = f"{heard['missing']} of {heard['kernels']} are not compiled; `python -m scenario_gen.compiling` does it now"
        return Finding(WARNING, "kernels", words)
    return Finding(OK, "kernels", f"all {heard['kernels']} are compiled")


def _child(part: str, topic: str, environment: Mapping[str, str]) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, "-m", "scenario_gen.nodes.doctor_probe", part, topic],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=dict(environment),
    )


def main() -> int:
    """Print the findings; return 1 if one is an error."""
    worst = 0
    for finding in examine():
        print(f"{finding.level:<8} {finding.subject:<12} {finding.message}", flush=True)
        worst |= finding.level == ERROR
    return worst


if __name__ == "__main__":
    sys.exit(main())
