# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""doctor: what is wrong with an environment, and what to do about it; works without ROS, and says so.

Only the standard library is imported here: `python -m scenario_gen.ros.plumbing.doctor` still answers where
`scenario-gen doctor` cannot start for want of a package. What needs rclpy or numba runs in processes of its own, the probes: a
crash there is a finding. Each is `python -m scenario_gen.ros.plumbing.doctor PROBE TOPIC`, and answers with a line of JSON.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from importlib import metadata
import importlib.util
import json
import os
from pathlib import Path
import subprocess
import sys
import time
from typing import Any

OK, WARNING, ERROR = "ok", "warning", "error"
PYTHONS = ((3, 11), (3, 13))
MODULES = (
    *("numpy", "scipy", "numba", "ompl", "daqp", "clarabel", "mcap", "rosbags", "pandas", "pyarrow"),
    *("shapely", "PIL", "yaml", "jinja2", "typer", "rich"),
)
INTERFACES = (
    *("builtin_interfaces", "diagnostic_msgs", "geometry_msgs", "lifecycle_msgs", "nav_msgs", "rcl_interfaces", "rosgraph_msgs"),
    *("sensor_msgs", "std_msgs", "std_srvs", "trajectory_msgs", "visualization_msgs"),
)
RANGES = ("SUBNET", "LOCALHOST", "OFF", "SYSTEM_DEFAULT")
PROFILES = ("FASTDDS_DEFAULT_PROFILES_FILE", "FASTRTPS_DEFAULT_PROFILES_FILE", "CYCLONEDDS_URI")
PATIENCE = 20.0  # seconds for two processes to start and to meet
WANTED = 5  # messages
LOOK = 1.5  # seconds in which other participants' topics come up


@dataclass(frozen=True)
class Finding:
    """One thing looked at: `level` is "ok", "warning" or "error"; the message says what to do."""

    level: str
    subject: str
    message: str

    def line(self) -> str:
        """Return the finding in one line."""
        return f"{self.level:<8} {self.subject:<12} {self.message}"


def examine(environment: Mapping[str, str] | None = None) -> Iterator[Finding]:
    """Yield the findings, quick ones first; variables are those of `environment`, this process's if None."""
    environment = os.environ if environment is None else environment
    yield python(sys.version_info[:2])
    yield packages("packages", MODULES, "`make install`")
    yield _kernels()
    if importlib.util.find_spec("rclpy") is None:
        message = "not here: everything works but the nodes and `demo --ros`. Source a Jazzy installation, or `make install`"
        yield Finding(WARNING, "ROS 2", message)
        return
    yield installation(environment)
    yield packages("interfaces", INTERFACES, "install ros-jazzy-common-interfaces, or source a Jazzy installation")
    yield _action()
    yield from variables(environment)
    yield from discovery(environment)


def _action() -> Finding:
    """Say whether the type of the sampler's action is here."""
    found = importlib.util.find_spec("scenario_gen_interfaces")
    here = found is not None and found.origin is not None  # a checkout holds a folder of that name
    missing = "scenario_gen_interfaces is not built: gp_sampler has the service generate, and no action generate_scenarios"
    return Finding(OK, "action", "scenario_gen_interfaces is here" if here else missing)


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
            message = (
                f"the wheels' rclpy ({version}) hides that of the sourced ROS ({distribution}); use a shell with one of both"
            )
            return Finding(WARNING, "ROS 2", message)
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


def discovery(environment: Mapping[str, str]) -> Iterator[Finding]:
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
        yield Finding(ERROR, "DDS", f"rclpy does not start: {_last_line(errors + silence)}")
        return
    yield from judged(json.loads(output.splitlines()[-1]))


def judged(seen: Mapping[str, Any]) -> Iterator[Finding]:
    """Judge what the listener received and saw."""
    yield Finding(OK, "RMW", seen["rmw"])
    if seen["received"]:
        yield Finding(OK, "loop-back", f"two processes met after {seen['seconds']:.1f} s and {seen['received']} messages arrived")
    else:
        message = (
            "two processes on this host do not hear each other: look at the firewall, multicast on the loopback device, /dev/shm"
        )
        yield Finding(ERROR, "loop-back", message)
    for fault in seen["faults"]:
        yield Finding(ERROR, "QoS", fault)
    if not seen["faults"]:
        yield Finding(OK, "QoS", f"no mismatch among {seen['topics']} visible topics")


def _kernels() -> Finding:
    child = _child("kernels", "", os.environ)
    output, errors = child.communicate()
    if not output.strip():
        return Finding(ERROR, "kernels", f"cannot be loaded: {_last_line(errors)}")
    seen = json.loads(output.splitlines()[-1])
    if seen["missing"]:
        message = (
            f"{seen['missing']} of {seen['kernels']} are not compiled; `python -m scenario_gen.numerics.compiling` does it now"
        )
        return Finding(WARNING, "kernels", message)
    return Finding(OK, "kernels", f"all {seen['kernels']} are compiled")


def _last_line(text: str) -> str:
    return next((line.strip() for line in reversed(text.splitlines()) if line.strip()), "it does not say why")


def _child(probe: str, topic: str, environment: Mapping[str, str]) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, "-m", "scenario_gen.ros.plumbing.doctor", probe, topic],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=dict(environment),
    )


def _speak(topic: str) -> None:
    """Publish until killed."""
    import rclpy
    from std_msgs.msg import String

    rclpy.init()
    node = rclpy.create_node("doctor_speaker", enable_rosout=False, start_parameter_services=False)
    publisher = node.create_publisher(String, topic, 10)
    end = time.monotonic() + 60.0
    while time.monotonic() < end:
        publisher.publish(String(data="hear me"))
        time.sleep(0.05)


def _listen(topic: str) -> None:
    """Count received messages, look for peers, and report both."""
    import rclpy
    from rclpy.utilities import get_rmw_implementation_identifier
    from std_msgs.msg import String

    rclpy.init()
    node = rclpy.create_node("doctor_listener", enable_rosout=False, start_parameter_services=False)
    received: list[float] = []
    node.create_subscription(String, topic, lambda _: received.append(time.monotonic()), 10)
    begin = time.monotonic()
    while len(received) < WANTED and time.monotonic() - begin < 12.0:
        rclpy.spin_once(node, timeout_sec=0.1)
    time.sleep(max(0.0, begin + LOOK - time.monotonic()))
    topics = node.get_topic_names_and_types()
    answer = {
        "rmw": get_rmw_implementation_identifier(),
        "received": len(received),
        "seconds": received[0] - begin if received else 0.0,
        "topics": len(topics),
        "faults": sorted(set(_faults(node, topics))),
    }
    print(json.dumps(answer), flush=True)
    node.destroy_node()
    rclpy.shutdown()


def _faults(node: Any, topics: list[tuple[str, list[str]]]) -> Iterator[str]:
    """Yield a sentence for every publisher and subscription that do not suit each other."""
    from rclpy.qos import qos_check_compatible, QoSCompatibility

    for topic, kinds in topics:
        if len(kinds) > 1:
            yield f"{topic} has several types: {', '.join(kinds)}"
        for publisher in node.get_publishers_info_by_topic(topic):
            for subscription in node.get_subscriptions_info_by_topic(topic):
                level, reason = qos_check_compatible(publisher.qos_profile, subscription.qos_profile)
                if level == QoSCompatibility.ERROR:
                    ends = (f"{end.node_namespace.rstrip('/')}/{end.node_name}" for end in (publisher, subscription))
                    yield f"{topic}: {' → '.join(ends)} cannot connect: {reason}"


def _count_kernels(_topic: str) -> None:
    """Count the kernels that are not in the cache; none is compiled."""
    from scenario_gen.numerics import compiling
    from scenario_gen.numerics import kernels as all_kernels

    all_kernels.import_all()
    needed = all_kernels.registered()
    print(json.dumps({"kernels": len(needed), "missing": len(compiling.missing(needed))}), flush=True)


def main() -> int:
    """Print the findings; return 1 if one is an error."""
    worst = 0
    for finding in examine():
        print(finding.line(), flush=True)
        worst |= finding.level == ERROR
    return worst


PROBES: dict[str, Callable[[str], None]] = {"speak": _speak, "listen": _listen, "kernels": _count_kernels}

if __name__ == "__main__":
    if len(sys.argv) > 1:
        PROBES[sys.argv[1]](sys.argv[2])
    else:
        sys.exit(main())
