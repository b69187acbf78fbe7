# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""doctor: what this suite misses in an environment; `ros2 doctor` looks at the network, the middleware and the QoS of topics.

Only the standard library is imported, so `python -m scenario_gen.ros.common.doctor` also runs where the command cannot start.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
import importlib.util
import os
import subprocess
import sys

OK, WARNING, ERROR = "ok", "warning", "error"
PYTHONS = ((3, 11), (3, 13))
MODULES = (
    *(
        "numpy",
        "scipy",
        "numba",
        "ompl",
        "daqp",
        "clarabel",
        "mcap",
        "rosbags",
        "pandas",
        "pyarrow",
    ),
    *("shapely", "PIL", "yaml", "jinja2", "typer", "rich"),
)
INTERFACES = (
    *(
        "builtin_interfaces",
        "diagnostic_msgs",
        "geometry_msgs",
        "lifecycle_msgs",
        "nav_msgs",
        "rcl_interfaces",
        "rosgraph_msgs",
    ),
    *("sensor_msgs", "std_msgs", "std_srvs", "trajectory_msgs", "visualization_msgs"),
)
NODE = "import rclpy; rclpy.init(); rclpy.create_node('doctor'); print(rclpy.get_rmw_implementation_identifier())"


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
    """Yield the findings; variables are those of `environment`, this process's if None."""
    environment = os.environ if environment is None else environment
    yield python(sys.version_info[:2])
    yield packages("packages", MODULES, "`make install`")
    if importlib.util.find_spec("rclpy") is None:
        advice = "not here: everything works but the nodes and `demo --ros`. Source a Jazzy installation, or `make install`"
        yield Finding(WARNING, "ROS 2", advice)
        return
    yield packages(
        "interfaces",
        INTERFACES,
        "install ros-jazzy-common-interfaces, or source a Jazzy installation",
    )
    action = importlib.util.find_spec("scenario_gen_interfaces")
    missing = "scenario_gen_interfaces is not built: gp_sampler has the service generate, and no action generate_scenarios"
    yield Finding(
        OK, "action", "scenario_gen_interfaces is here" if action and action.origin else missing
    )
    run = subprocess.run(
        [sys.executable, "-c", NODE],
        capture_output=True,
        text=True,
        check=False,
        env=dict(environment),
    )
    if run.returncode:
        why = next(
            (line for line in reversed(run.stderr.splitlines()) if line.strip()),
            "it does not say why",
        )
        yield Finding(ERROR, "ROS 2", f"no node starts: {why.strip()}")
    else:
        domain = environment.get("ROS_DOMAIN_ID") or "0"
        further = "for the network and QoS see `ros2 doctor --report` and `ros2 doctor hello`"
        yield Finding(
            OK, "ROS 2", f"a node starts: {run.stdout.strip()}, domain {domain}; {further}"
        )


def python(version: tuple[int, ...]) -> Finding:
    """Judge the version of Python."""
    low, high, text = (".".join(map(str, numbers)) for numbers in (*PYTHONS, version))
    if PYTHONS[0] <= tuple(version) <= PYTHONS[1]:
        return Finding(OK, "Python", f"{text} in {sys.prefix}")
    return Finding(ERROR, "Python", f"{text} is not supported; {low} to {high} is")


def packages(subject: str, modules: tuple[str, ...], remedy: str) -> Finding:
    """Say which modules cannot be found."""
    missing = [name for name in modules if importlib.util.find_spec(name) is None]
    if missing:
        return Finding(ERROR, subject, f"missing: {', '.join(missing)}; {remedy}")
    return Finding(OK, subject, f"all {len(modules)} are there")


if __name__ == "__main__":
    findings = list(examine())
    print("\n".join(finding.line() for finding in findings))
    sys.exit(int(any(finding.level == ERROR for finding in findings)))
