# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`python -m benchmarks NAME [--json] [--quick]`: run one benchmark (or `all`); `--list` names them."""

import os

THREADS = dict.fromkeys(
    ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMEXPR_NUM_THREADS"), "1"
)
os.environ |= THREADS  # libraries read it once, when they are imported

# ruff: noqa: E402
import argparse
import importlib
import inspect
import json
import pkgutil
import platform
import signal
import sys
from typing import Any, NoReturn

import numpy
import scipy

import benchmarks
from benchmarks import row
from benchmarks._size import QUICK
from benchmarks.row import MADE, Row

FLAGS = {
    "list": "print the names of the benchmarks",
    "json": "end with one JSON object on the last line",
    "quick": "the smallest sizes, to see that it runs; the figures mean nothing",
    "held-out": "naturalness, interaction: the held-out encounters",
    "full": "bridges: all of the demo's scenarios, and every file before every judge",
}
OPTIONS: dict[str, tuple[type, str]] = {
    "count": (int, "number of scenarios or drives"),
    "cases": (int, "naturalness, interaction: only the first encounters"),
    "roads": (str, "naturalness, interaction: names of roads, separated by commas"),
    "drivers": (float, "naturalness, interaction: how much drivers differ"),
    "out": (str, "paper: the folder of the page"),
    "seed": (int, "paper: same seed, same page"),
    "part": (str, "corpus: mine or batch"),
    "rows": (str, "a file that gets each row as it is measured, a line of JSON each"),
}


def names() -> list[str]:
    """Return the names of all benchmarks: the public modules of this package."""
    return [
        module.name
        for module in pkgutil.iter_modules(benchmarks.__path__)
        if module.name not in ("__main__", "row") and not module.name.startswith("_")
    ]


def machine() -> dict[str, str | int]:
    """Describe the machine that the figures were measured on."""
    return {
        "cores": os.cpu_count() or 0,
        "architecture": platform.machine(),
        "system": platform.system(),
        "python": platform.python_version(),
        "numpy": numpy.__version__,
        "scipy": scipy.__version__,
        "threads": max((pool["num_threads"] for pool in _pools()), default=1),
    }


def _pools() -> list[dict[str, Any]]:
    """Return the thread pools of the loaded libraries; none if threadpoolctl is missing."""
    try:
        from threadpoolctl import threadpool_info
    except ImportError:
        return []
    found: list[dict[str, Any]] = threadpool_info()
    return found


def table(rows: list[Row]) -> str:
    """Return the rows as a text table."""
    lines = [f"{'figure':<58} {'value':>12} {'unit':<10} {'target':>12}  met  peer"]
    for one in rows:
        sign = "≥" if one.better == "higher" else "≤"
        target = "" if one.target is None else f"{sign} {one.target:g}"
        met = {None: "", True: "yes", False: "NO"}[one.met]
        lines.append(
            f"{one.id:<58} {one.value:>12.4g} {one.unit:<10} {target:>12}  {met:<4} {one.peer or ''}"
        )
    return "\n".join(lines)


def main() -> int:
    """Run what the command line names."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("name", nargs="?", help="a benchmark, or all")
    for flag, meaning in FLAGS.items():
        parser.add_argument(f"--{flag}", action="store_true", default=None, help=meaning)
    for option, (kind, meaning) in OPTIONS.items():
        parser.add_argument(f"--{option}", type=kind, help=meaning)
    parser.add_argument("--log", action="append", help="paper: a log to measure; repeatable")
    arguments = parser.parse_args()
    known = names()
    signal.signal(signal.SIGTERM, stop)
    if arguments.list or arguments.name is None:
        print("\n".join(known))
        return 0
    if arguments.name != "all" and arguments.name not in known:
        parser.error(f"unknown benchmark {arguments.name!r}; choose all, {', '.join(known)}")
    if arguments.quick:
        os.environ[QUICK] = "1"  # before the benchmarks are imported
    for name in known if arguments.name == "all" else [arguments.name]:
        run = importlib.import_module(f"benchmarks.{name}").run
        given = {key: value for key, value in vars(arguments).items() if value is not None}
        MADE.clear()
        row.FILE = arguments.rows
        stopped, rows = "", list[Row]()
        try:
            rows = run(
                **{key: given[key] for key in inspect.signature(run).parameters if key in given}
            )
        except BaseException as error:
            stopped, rows = f"{type(error).__name__}: {error}".rstrip(": "), MADE
            raise
        finally:
            report(name, rows, stopped, arguments)
    return 0


def report(name: str, rows: list[Row], stopped: str, arguments: argparse.Namespace) -> None:
    """Print the rows of a benchmark; of a stopped one the rows so far, and the reason."""
    if arguments.json:
        document = {
            "benchmark": name,
            "quick": bool(arguments.quick),
            "rows": [one.document() for one in rows],
            "machine": machine(),
        }
        print(
            json.dumps(document | ({"stopped": stopped} if stopped else {}), allow_nan=False),
            flush=True,
        )
    else:
        print(f"{name}{f' (stopped: {stopped})' if stopped else ''}\n{table(rows)}\n", flush=True)


def stop(*_: object) -> NoReturn:
    """End like Ctrl-C, so that the rows so far are printed."""
    raise KeyboardInterrupt


if __name__ == "__main__":
    sys.exit(main())
