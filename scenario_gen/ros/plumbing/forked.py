# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Several nodes as separate processes, forked from one that has loaded the libraries and the kernels once.

`python -m scenario_gen.ros.plumbing.forked SPECIFICATION.json`, where the file holds a list of
{"node", "arguments", "log"}. Events are written to standard output as JSON lines. Ctrl-C, SIGTERM, or the end of
standard input ends all nodes.
"""

import json
import os
from pathlib import Path
import select
import signal
import sys
import traceback

from scenario_gen.ros.plumbing.process import kernels_ready
from scenario_gen.ros.plumbing.start import node_class, start

PATIENCE = 20.0  # seconds that a node has to end by itself; far more than it needs, for machines that are busy


def say(**event: object) -> None:
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
        if node != "watcher":
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
    stages = dict.fromkeys(stage for node in nodes for stage in getattr(node_class(node), "STAGES", ()))
    count, seconds = kernels_ready(stages)
    say(event="loaded", kernels=count, seconds=seconds)


def run(specification: list[dict[str, object]]) -> None:
    """Fork the nodes, report those that end, and end them all when asked."""
    signals = (signal.SIGINT, signal.SIGTERM)
    for number in signals:
        signal.signal(number, lambda number, _: os._exit(128 + number))  # there is nobody to be ended yet
    _load([str(entry["node"]) for entry in specification])
    asked: list[bool] = []
    for number in signals:
        signal.signal(number, lambda *_: asked.append(True))
    children: dict[int, str] = {}
    for entry in specification:
        pid = os.fork()
        if pid == 0:
            _become(str(entry["node"]), [str(a) for a in entry["arguments"]], str(entry["log"]))  # type: ignore[attr-defined]
        children[pid] = str(entry["node"])
        say(event="started", node=entry["node"], pid=pid)
    while not asked and children:
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
            say(event="exited", node=children.pop(pid), code=os.waitstatus_to_exitcode(status))


if __name__ == "__main__":
    run(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")))
