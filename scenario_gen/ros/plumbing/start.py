# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The executables: each a node, and `suite`: all nodes in one process with one executor, `ros2 run scenario_gen suite`.

Each listens to signals before anything else is loaded, so that Ctrl-C while the libraries load ends it at once.

`python -m scenario_gen.ros.plumbing.start fork SPECIFICATION.json` runs several nodes as separate processes, forked from one
that has loaded the libraries and the kernels once; the file holds a list of {"node", "arguments", "log"}. Events are written to
standard output as JSON lines. Ctrl-C, SIGTERM, or the end of standard input ends all nodes.
"""

from functools import partial
import gc
import importlib
import json
import os
from pathlib import Path
import select
import signal
import sys
import traceback
from typing import Any

from scenario_gen.base.interrupts import hear

PATIENCE = 20.0  # seconds that a node has to end by itself; far more than it needs, for machines that are busy
NODES = ("recorder", "evaluator", "preview", "gp_sampler", "planner", "segmenter", "road_server", "log_player", "player")
WATCHER = "watcher"  # reports to the runner of a suite; no executable
SUITE = """\
suite: all nodes in one process with one executor, for small machines: `ros2 run scenario_gen suite`.

A parameter is that of every node that has it: `--ros-args -p log_path:=LOG -p road_name:=straight -p seed:=7`; one node's own
stands in a parameter file, or, where there is no namespace, behind its name: `-p recorder:bag:=BAG`.
`--nodes segmenter,planner` takes only some; `player` must be asked for.
"""


def node_class(name: str) -> Any:
    """Return the class of a node: GpSampler of `gp_sampler`."""
    module = "plumbing.diagnostics" if name == WATCHER else f"nodes.{name}"
    return getattr(importlib.import_module(f"scenario_gen.ros.{module}"), name.title().replace("_", ""))


def chosen(arguments: list[str]) -> tuple[list[str], list[str]]:
    """Return the names of the suite's nodes, in the order in which they start, and the other arguments."""
    names, rest = ",".join(NODES[:-1]), list(arguments)  # who listens stands before who publishes
    if "--nodes" in rest:
        at = rest.index("--nodes")
        names = rest[at + 1] if at + 1 < len(rest) else ""
        del rest[at : at + 2]
    wanted = [name.strip() for name in names.split(",")]
    if unknown := [name for name in wanted if name not in NODES]:
        raise SystemExit(f"usage: --nodes NAME,NAME of {', '.join(NODES)}; unknown: {', '.join(unknown)!r}")
    return [name for name in NODES if name in wanted], rest


def start(name: str) -> None:
    """Load the node `name`, or the suite, and run it."""
    hear()
    names, arguments = chosen(sys.argv) if name == "suite" else ([name], sys.argv)
    gc.disable()  # what the libraries make while they load stays: to look for garbage in it takes a sixth of the time
    from scenario_gen.ros.plumbing.process import asks_for_help, run_nodes, show

    nodes = [node_class(node) for node in names]
    gc.freeze()
    gc.enable()
    if name == "suite" and asks_for_help(arguments):
        show(SUITE)
    sys.exit(run_nodes(nodes, arguments))


segmenter = partial(start, "segmenter")
planner = partial(start, "planner")
gp_sampler = partial(start, "gp_sampler")
road_server = partial(start, "road_server")
log_player = partial(start, "log_player")
evaluator = partial(start, "evaluator")
preview = partial(start, "preview")
recorder = partial(start, "recorder")
player = partial(start, "player")
traffic = partial(start, "traffic")
suite = partial(start, "suite")


# --- several nodes, each a process ----------------------------------------------------------------------------


def emit(**event: object) -> None:
    """Write one event; a line is short enough to arrive unbroken from any process."""
    os.write(sys.__stdout__.fileno() if sys.__stdout__ else 1, (json.dumps(event) + "\n").encode())


def _become(node: str, arguments: list[str], log: str) -> None:
    """Turn the forked process into a node; never returns."""
    code = 1
    try:
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda number, _: os._exit(128 + number))  # until the node sets its own
        os.setpgid(0, 0)  # the terminal's Ctrl-C reaches the suite, which ends its nodes in order
        descriptor = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
        os.dup2(descriptor, 2)
        if node != WATCHER:
            os.dup2(descriptor, 1)
        null = os.open(os.devnull, os.O_RDONLY)
        os.dup2(null, 0)
        sys.argv = [node, *arguments]
        start(node)
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 1
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stderr.flush()
        os._exit(code)


def _load(nodes: list[str]) -> None:
    """Import the nodes and compile, or load, the kernels of their stages: what every fork will share."""
    from scenario_gen.ros.plumbing.process import kernels_ready

    stages = dict.fromkeys(stage for node in nodes for stage in getattr(node_class(node), "STAGES", ()))
    emit(event="loaded", kernels=kernels_ready(stages))


def fork(specification: list[dict[str, Any]]) -> None:
    """Fork the nodes, report those that end, and end them all after a signal or the end of standard input."""
    signals = (signal.SIGINT, signal.SIGTERM)
    for number in signals:
        signal.signal(number, lambda number, _: os._exit(128 + number))  # there is nobody to be ended yet
    _load([entry["node"] for entry in specification])
    requested: list[bool] = []
    for number in signals:
        signal.signal(number, lambda *_: requested.append(True))
    children: dict[int, str] = {}
    for entry in specification:
        pid = os.fork()
        if pid == 0:
            _become(entry["node"], entry["arguments"], entry["log"])
        children[pid] = entry["node"]
        emit(event="started", node=entry["node"], pid=pid)
    while not requested and children:
        readable, _, _ = select.select([0], [], [], 0.1)
        if readable and not os.read(0, 1):
            break
        _reap(children)
    for number in (signal.SIGINT, signal.SIGKILL):
        for pid in children:
            os.kill(pid, number)
        for _ in range(int(PATIENCE / 0.05)):
            if children:
                select.select([], [], [], 0.05)
                _reap(children)


def _reap(children: dict[int, str]) -> None:
    for pid in list(children):
        done, status = os.waitpid(pid, os.WNOHANG)
        if done:
            emit(event="exited", node=children.pop(pid), code=os.waitstatus_to_exitcode(status))


if __name__ == "__main__":
    if sys.argv[1] == "fork":
        fork(json.loads(Path(sys.argv[2]).read_text(encoding="utf-8")))
    else:
        start(sys.argv.pop(1))
