# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`python -m benchmarks NAME [--json] [--quick]`: run one benchmark (or `all`); `--list` names them."""

import os

THREADS = dict.fromkeys(
    ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMEXPR_NUM_THREADS"), "1"
)
os.environ |= THREADS  # of ours, of every peer and of their processes; libraries read it once, as they are imported

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

FRAME = {"__main__", "row"}


def names() -> list[str]:
    """Return the names of all benchmarks: the modules of this package that define `run`."""
    return [
        module.name
        for module in pkgutil.iter_modules(benchmarks.__path__)
        if module.name not in FRAME and not module.name.startswith("_")
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
    """Return the pools of threads of the libraries that are loaded, those of peers too; none if threadpoolctl is missing."""
    try:
        from threadpoolctl import threadpool_info
    except ImportError:
        return []
    found: list[dict[str, Any]] = threadpool_info()
    return found


def table(rows: list[Row]) -> str:
    """Lay the rows out as a table for people."""
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
    parser.add_argument("--list", action="store_true", help="name the benchmarks")
    parser.add_argument(
        "--json", action="store_true", help="end with one JSON object on the last line"
    )
    parser.add_argument(
        "--count",
        type=int,
        help="how many, where a benchmark counts something (scenarios to re-check)",
    )
    parser.add_argument(
        "--cases",
        type=int,
        help="naturalness: the first encounters alone, on the corridor, for a look",
    )
    parser.add_argument(
        "--roads",
        help="naturalness: names of roads, separated by commas; map: the recording's own",
    )
    parser.add_argument(
        "--held-out",
        action="store_true",
        default=None,
        help="naturalness: the encounters that are kept apart",
    )
    parser.add_argument(
        "--details", help="naturalness: a file for the figures of every case, a line of JSON each"
    )
    parser.add_argument(
        "--pictures", help="naturalness: a folder for pictures of the first ten cases"
    )
    parser.add_argument(
        "--checkout", help="naturalness: the folder of another checkout to be measured"
    )
    parser.add_argument(
        "--variety", help="naturalness: the sampler's preset, wide (default) or narrow"
    )
    parser.add_argument(
        "--full",
        action="store_true",
        default=None,
        help="bridges: all of the demo's scenarios, and every file before every judge",
    )
    parser.add_argument("--out", help="paper: the folder of the page")
    parser.add_argument(
        "--log",
        action="append",
        help="paper: a file of a log instead of the bundled cases; repeatable",
    )
    parser.add_argument("--seed", type=int, help="paper: same seed, same page")
    parser.add_argument(
        "--part",
        help="corpus: mine, memory, store, recorded, batch, kills, library, peers; kills: a victim; that alone",
    )
    parser.add_argument(
        "--rows", help="a file that gets each row as it is measured, a line of JSON each"
    )
    parser.add_argument(
        "--quick",
        action="store_true",
        help="next to nothing of each, to see that it runs; figures say nothing",
    )
    arguments = parser.parse_args()
    known = names()
    signal.signal(signal.SIGTERM, stop)
    if arguments.list or arguments.name is None:
        print("\n".join(known))
        return 0
    if arguments.name != "all" and arguments.name not in known:
        print(
            f"unknown benchmark {arguments.name!r}; choose one of: all, {', '.join(known)}",
            file=sys.stderr,
        )
        return 2
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
    """Print the rows of a benchmark; of one that was stopped, those that were measured, and why it was."""
    if arguments.json:
        document = {
            "benchmark": name,
            "quick": arguments.quick,
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
    """End as Ctrl-C does, so that what was measured is printed."""
    raise KeyboardInterrupt


if __name__ == "__main__":
    sys.exit(main())
