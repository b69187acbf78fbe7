# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A user's way: a workspace built with links, another project's bag while the clock stands first, a live drive of a request, Ctrl-C."""

from collections.abc import Iterator
import os
from pathlib import Path
import shutil
import signal
import subprocess
import sys
import time

from figures import Figure, ROOT
from rosbags.rosbag2 import Writer
from rosbags.typesys import get_typestore, Stores
from support.suite_processes import Client

from scenario_gen.base.ros_domain import free_domain, this_host_only

PACKAGES = (ROOT, ROOT / "scenario_gen_interfaces")
TOPICS, RATE_HZ, SECONDS = 4, 50, 6
LOG = ROOT / "scenario_gen" / "resources" / "synthetic_b"


def run(state: Path) -> Iterator[Figure]:
    """Build afresh, then do what a user does."""
    folder = (state / "workspace").resolve()
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    built = build(folder)
    yield Figure("both packages are built with links", "0", str(built), built == 0)
    if built:
        return
    with free_domain() as domain:
        environment = sourced(folder) | this_host_only() | {"ROS_DOMAIN_ID": str(domain)}
        workspace = Workspace(folder, environment)
        client = Client(domain)
        try:
            yield from played(workspace, client)
            yield from driven(workspace, client)
        finally:
            codes = workspace.end()
            client.close()
    yield Figure("exit codes after Ctrl-C", "all 0", str(codes), not any(codes))


def build(folder: Path) -> int:
    """Build both packages as docs/howto_ros.md does; return colcon's exit code."""
    programs = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    prefix = os.environ["AMENT_PREFIX_PATH"]
    command = ["colcon", "--log-base", folder / "log", "build", "--symlink-install"]
    command += ["--build-base", folder / "build", "--install-base", folder / "install"]
    command += [
        "--base-paths",
        *PACKAGES,
        "--cmake-args",
        f"-DPython3_EXECUTABLE={sys.executable}",
    ]
    command += [f"-DCMAKE_PROJECT_INCLUDE={ROOT / 'test' / 'ros' / 'wheels.cmake'}"]
    found = {"PATH": programs, "CMAKE_PREFIX_PATH": prefix.replace(":", ";")}
    return subprocess.run(command, env=os.environ | found, check=False).returncode


def sourced(folder: Path) -> dict[str, str]:
    """Return the environment after `source install/setup.bash`."""
    command = f"source {folder / 'install' / 'setup.bash'} && env -0"
    text = subprocess.run(
        ["bash", "-c", command], capture_output=True, text=True, check=True
    ).stdout
    pairs = (entry.partition("=") for entry in text.split("\0") if entry)
    return {name: value for name, _, value in pairs}


class Workspace:
    """Starts executables of the workspace, and ends them all."""

    def __init__(self, folder: Path, environment: dict[str, str]) -> None:
        self.folder, self.environment = folder, environment
        self.processes: list[subprocess.Popen[bytes]] = []

    def start(self, name: str, *words: str, **parameters: object) -> subprocess.Popen[bytes]:
        """Start a node as `ros2 run scenario_gen` does."""
        program = self.folder / "install" / "scenario_gen" / "lib" / "scenario_gen" / name
        values = [word for key, value in parameters.items() for word in ("-p", f"{key}:={value}")]
        return self.run([str(program), *words, "--ros-args", *values])

    def run(self, command: list[str]) -> subprocess.Popen[bytes]:
        """Start a program in the sourced environment."""
        self.processes.append(subprocess.Popen(command, env=self.environment))
        return self.processes[-1]

    def end(self) -> list[int]:
        """End all processes as Ctrl-C does; return their exit codes."""
        for process in self.processes:
            process.send_signal(signal.SIGINT)
        return [process.wait(180.0) for process in self.processes]


def write_bag(folder: Path) -> None:
    """Write a bag as another project does: topics of depth 10."""
    types = get_typestore(Stores.ROS2_JAZZY)
    kind = "std_msgs/msg/String"
    data = types.serialize_cdr(types.types[kind](data="x" * 200), kind)
    with Writer(folder, version=9) as writer:
        topics = [writer.add_connection(f"/t{k}", kind, typestore=types) for k in range(TOPICS)]
        for k in range(SECONDS * RATE_HZ):
            for topic in topics:
                writer.write(topic, 10**18 + k * 10**9 // RATE_HZ, data)


def played(workspace: Workspace, client: Client) -> Iterator[Figure]:
    """Play the bag to a recorder that lives in the bag's time, which stands at first."""
    from std_srvs.srv import Trigger

    bag = workspace.folder / "foreign"
    write_bag(bag)
    client.hear("/diagnostics")
    recorder = {"bag": workspace.folder / "copy", "topics": "/t.", "use_sim_time": True}
    workspace.start("recorder", **recorder)
    player = workspace.start("player", bag=bag, clock=True, paused=True)
    client.until(lambda: client.node.count_subscribers("/t0") == 1, "the recorder's subscription")
    started = time.monotonic()
    assert client.call(Trigger, "/player/resume_playing", Trigger.Request()).success
    assert player.wait(180.0) == 0
    seconds = time.monotonic() - started
    expected = SECONDS * RATE_HZ
    counts = [client.counted(f"/t{k}") for k in range(TOPICS)]
    deadline = time.monotonic() + 30.0
    while min(counts) < expected and time.monotonic() < deadline:
        time.sleep(0.5)
        counts = [client.counted(f"/t{k}") for k in range(TOPICS)]
    name = f"another project's bag, {TOPICS} topics at {RATE_HZ} Hz, depth 10"
    yield Figure(f"{name}: recorded", str(expected), str(counts), min(counts) == expected)
    limit = SECONDS + 6  # the last messages are acknowledged at a heartbeat
    yield Figure(f"{name}: [s]", f"<= {limit}", f"{seconds:.1f}", seconds <= limit)


def driven(workspace: Workspace, client: Client) -> Iterator[Figure]:
    """Drive the scenarios of one request, not those of another before it, with the example."""
    from std_srvs.srv import Trigger

    from msg_conventions.diagnostics import decode_diagnostics

    roads = {"road_name": "t_intersection", "wait_for_tracks": True, "generate_on_input": False}
    nodes = ("--nodes", "log_player,road_server,segmenter,planner,gp_sampler")
    workspace.start("suite", *nodes, log_path=LOG, **roads)
    assert client.call(Trigger, "/gp_sampler/wait_until_ready", Trigger.Request()).success
    answers = [client.generate(count=2, ego="1", request="first")]
    workspace.start("traffic", lock_step=True, request="mine")
    client.hear("verdicts")
    client.until(lambda: client.node.count_publishers("verdicts") == 1, "traffic")
    answers.append(client.generate(count=2, ego="1", request="mine"))
    example = [sys.executable, str(ROOT / "examples" / "ego_consumer.py")]
    workspace.run([*example, "--ros-args", "-p", "lock_step:=true"])
    verdicts = [
        decode_diagnostics(data)[1][0].subject for data in client.wait("verdicts", 2, 300.0)
    ]
    expected = ["scenario mine 0", "scenario mine 1"]
    yield Figure("a live drive of one request", str(expected), str(verdicts), verdicts == expected)
    yield Figure(
        "requests answered",
        "2",
        "; ".join(answer.reason for answer in answers),
        all(answer.successful for answer in answers),
    )
