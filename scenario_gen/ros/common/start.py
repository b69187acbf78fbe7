# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The executables: one for each node, and `suite`, which runs all nodes in one process.

`python -m scenario_gen.ros.common.start NODE` does the same.
"""

from contextlib import suppress
import importlib
import os
from pathlib import Path
import signal
import sys
from typing import Any, NoReturn

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


def end_process(code: int) -> NoReturn:
    """End this process, whose nodes have ended and whose bags are closed.

    `os._exit`, because Python frees numba and the nodes' libraries object by object otherwise:
    half a second of CPU, so processes that end together outlast the 5 s that launch waits.
    """
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError):  # e.g. a closed pipe
            stream.flush()
    os._exit(code)


def start(name: str) -> None:
    """Load the node `name`, or the suite, and run it."""
    for number in (signal.SIGINT, signal.SIGTERM):  # a clean end while the libraries load
        signal.signal(number, lambda *_: end_process(0))
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
            end_process(0)
        end_process(run_nodes([node_class(each) for each in names], arguments))
    except InputError as error:
        end_process(print_error(error))


def main() -> None:
    """Start the node after which the executable is named."""
    start(Path(sys.argv[0]).stem)


if __name__ == "__main__":
    start(sys.argv.pop(1))
