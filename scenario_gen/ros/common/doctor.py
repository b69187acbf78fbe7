# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""doctor: find what an environment lacks for this suite.

`ros2 doctor` examines network, middleware and QoS.

It imports only the standard library, so `python -m scenario_gen.ros.common.doctor` also runs
where the command cannot start.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
import importlib.util
import os
import subprocess
import sys

OK, WARNING, ERROR = "ok", "warning", "error"
MIN_PYTHON_VERSION = (3, 11)
MAX_PYTHON_VERSION = (3, 13)
MODULES = (
    "numpy", "scipy", "numba", "ompl", "daqp", "clarabel", "mcap", "rosbags", "pandas", "pyarrow",
    "shapely", "PIL", "yaml", "jinja2", "typer", "rich",
)  # fmt: skip
INTERFACES = (
    "builtin_interfaces", "diagnostic_msgs", "geometry_msgs", "lifecycle_msgs", "nav_msgs",
    "rcl_interfaces", "rosgraph_msgs", "sensor_msgs", "std_msgs", "std_srvs", "trajectory_msgs",
    "visualization_msgs",
)  # fmt: skip
NODE_PROGRAM = """\
import rclpy
rclpy.init()
rclpy.create_node("doctor")
print(rclpy.get_rmw_implementation_identifier())
"""


@dataclass(frozen=True)
class Finding:
    """The result of one check: `level` is "ok", "warning" or "error".

    The message has the remedy.
    """

    level: str
    subject: str
    message: str

    def line(self) -> str:
        """Return the finding in one line."""
        return f"{self.level:<8} {self.subject:<12} {self.message}"


def examine(environment: Mapping[str, str] | None = None) -> Iterator[Finding]:
    """Yield the findings for an environment's variables, by default this process's."""
    environment = os.environ if environment is None else environment
    yield python(sys.version_info[:2])
    yield packages("packages", MODULES, "`make install`")
    if importlib.util.find_spec("rclpy") is None:
        advice = (
            "not here: everything works but the nodes and `demo --ros`. Source a Jazzy "
            "installation, or `make install`"
        )
        yield Finding(WARNING, "ROS 2", advice)
        return
    yield packages(
        "interfaces",
        INTERFACES,
        "install ros-jazzy-common-interfaces, or source a Jazzy installation",
    )
    action = importlib.util.find_spec("scenario_gen_interfaces")
    message = "scenario_gen_interfaces is here"
    if not (action and action.origin):
        message = (
            "scenario_gen_interfaces is not built: gp_sampler has no action generate_scenarios, "
            "only the service"
        )
    yield Finding(OK, "action", message)
    run = subprocess.run(
        [sys.executable, "-P", "-c", NODE_PROGRAM],
        capture_output=True,
        text=True,
        check=False,
        env=dict(environment),
    )
    if run.returncode:
        lines = [line.strip() for line in run.stderr.splitlines() if line.strip()]
        cause = lines[-1] if lines else "without an error message"
        yield Finding(ERROR, "ROS 2", f"no node starts: {cause}")
    else:
        domain = environment.get("ROS_DOMAIN_ID") or "0"
        message = (
            f"a node starts: {run.stdout.strip()}, domain {domain}; for the network and QoS see "
            "`ros2 doctor --report` and `ros2 doctor hello`"
        )
        yield Finding(OK, "ROS 2", message)


def python(version: tuple[int, ...]) -> Finding:
    """Check the version of Python."""
    supported = (MIN_PYTHON_VERSION, MAX_PYTHON_VERSION)
    low, high, text = (".".join(map(str, numbers)) for numbers in (*supported, version))
    if MIN_PYTHON_VERSION <= tuple(version) <= MAX_PYTHON_VERSION:
        return Finding(OK, "Python", f"{text} in {sys.prefix}")
    return Finding(ERROR, "Python", f"{text} is not supported; {low} to {high} is")


def packages(subject: str, modules: tuple[str, ...], remedy: str) -> Finding:
    """Check which modules are missing."""
    missing = [name for name in modules if importlib.util.find_spec(name) is None]
    if missing:
        return Finding(ERROR, subject, f"missing: {', '.join(missing)}; {remedy}")
    return Finding(OK, subject, f"all {len(modules)} are there")


if __name__ == "__main__":
    findings = list(examine())
    print("\n".join(finding.line() for finding in findings))
    sys.exit(int(any(finding.level == ERROR for finding in findings)))
