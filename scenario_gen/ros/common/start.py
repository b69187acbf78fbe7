# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The executables: one for each node, and `suite`, which runs all nodes in one process.

`python -m scenario_gen.ros.common.start NODE` does the same.
"""

import importlib
import os
from pathlib import Path
import signal
import sys
from typing import Any

from scenario_gen.base.errors import InputError, print_error
from scenario_gen.base.working_directory import without_dds_profiles
from scenario_gen.ros.node_names import COMPOSABLE, SUITE

SUITE_HELP = """\
suite: all nodes in one process with one executor, for small machines.

A parameter applies to every node that has it:
`--ros-args -p log_path:=LOG -p road_name:=straight -p seed:=7`.
For one node, write it into a parameter file, or, without a namespace, after the node's name:
`-p recorder:bag:=BAG`.
`--nodes segmenter,planner` starts only these nodes. `player` starts only if `--nodes` names it.
"""


def node_class(name: str) -> Any:
    """Return the class of a node: GpSampler of `gp_sampler`."""
    module = importlib.import_module(f"scenario_gen.ros.nodes.{name}")
    return getattr(module, name.title().replace("_", ""))


def chosen_nodes(arguments: list[str]) -> tuple[list[str], list[str]]:
    """Return the suite's nodes in the order in which they start, and the other arguments."""
    if "--nodes" not in arguments:
        return list(SUITE), list(arguments)
    position = arguments.index("--nodes")
    names = [name.strip() for name in "".join(arguments[position + 1 : position + 2]).split(",")]
    if unknown := [name for name in names if name not in COMPOSABLE]:
        raise SystemExit(
            f"usage: --nodes NAME,NAME of {', '.join(COMPOSABLE)}; unknown: {', '.join(unknown)!r}"
        )
    rest = arguments[:position] + arguments[position + 2 :]
    return [name for name in COMPOSABLE if name in names], rest


def start(name: str) -> None:
    """Load the node `name`, or the suite, and run it."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # no traceback while the libraries load
    # Before numpy is loaded: the matrices are small, and BLAS threads would only wait.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    without_dds_profiles()
    names, arguments = [name], sys.argv
    if name == "suite":
        names, arguments = chosen_nodes(sys.argv)

    from scenario_gen.ros.common.process import asks_for_help, print_help, run_nodes

    try:
        if name == "suite" and asks_for_help(arguments):
            print_help(SUITE_HELP)
            sys.exit()
        sys.exit(run_nodes([node_class(each) for each in names], arguments))
    except InputError as error:
        sys.exit(print_error(error))


def main() -> None:
    """Start the node after which the executable is named."""
    start(Path(sys.argv[0]).stem)


if __name__ == "__main__":
    start(sys.argv.pop(1))
