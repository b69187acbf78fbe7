# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The executables: each a node, and `suite`: all nodes in one process with one executor, `ros2 run scenario_gen suite`.

Each listens to signals before anything else is loaded, so that Ctrl-C while the libraries load ends it at once.
`python -m scenario_gen.ros.plumbing.start NODE` does the same.
"""

from functools import partial
import gc
import importlib
import os
import sys
from typing import Any

from scenario_gen.base.errors import InputError, print_error
from scenario_gen.base.interrupts import hear

NODES = (
    "recorder",
    "evaluator",
    "preview",
    "gp_sampler",
    "planner",
    "segmenter",
    "road_server",
    "log_player",
    "player",
)
SUITE = """\
suite: all nodes in one process with one executor, for small machines: `ros2 run scenario_gen suite`.

A parameter is that of every node that has it: `--ros-args -p log_path:=LOG -p road_name:=straight -p seed:=7`; one node's own
stands in a parameter file, or, where there is no namespace, behind its name: `-p recorder:bag:=BAG`.
`--nodes segmenter,planner` takes only some; `player` must be asked for.
"""


def node_class(name: str) -> Any:
    """Return the class of a node: GpSampler of `gp_sampler`."""
    return getattr(
        importlib.import_module(f"scenario_gen.ros.nodes.{name}"), name.title().replace("_", "")
    )


def chosen(arguments: list[str]) -> tuple[list[str], list[str]]:
    """Return the names of the suite's nodes, in the order in which they start, and the other arguments."""
    names, rest = ",".join(NODES[:-1]), list(arguments)  # who listens stands before who publishes
    if "--nodes" in rest:
        at = rest.index("--nodes")
        names = rest[at + 1] if at + 1 < len(rest) else ""
        del rest[at : at + 2]
    wanted = [name.strip() for name in names.split(",")]
    if unknown := [name for name in wanted if name not in NODES]:
        raise SystemExit(
            f"usage: --nodes NAME,NAME of {', '.join(NODES)}; unknown: {', '.join(unknown)!r}"
        )
    return [name for name in NODES if name in wanted], rest


def start(name: str) -> None:
    """Load the node `name`, or the suite, and run it."""
    hear()
    os.environ.setdefault(
        "OPENBLAS_NUM_THREADS", "1"
    )  # before numpy is loaded: matrices are small here, and threads only wait
    names, arguments = chosen(sys.argv) if name == "suite" else ([name], sys.argv)
    gc.disable()  # what the libraries make while they load stays: to look for garbage in it takes a sixth of the time
    from scenario_gen.ros.plumbing.process import asks_for_help, run_nodes, show

    nodes = [node_class(node) for node in names]
    gc.freeze()
    gc.enable()
    try:
        if name == "suite" and asks_for_help(arguments):
            show(SUITE)
        sys.exit(run_nodes(nodes, arguments))
    except InputError as error:
        sys.exit(print_error(error))


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


if __name__ == "__main__":
    start(sys.argv.pop(1))
