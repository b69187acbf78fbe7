# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One `generate` by its parts, in this process: `python -m benchmarks._warm_parts LOG OUT` ends with a line of JSON.

Each part has seconds of the CPU and of the clock; what it spends in the loading of kernels counts for the kernels.
"""

from collections.abc import Callable
import json
import sys
from time import perf_counter, process_time
from typing import Any

STARTED = process_time()
PARTS = {  # by the module that calls them
    "scenario_gen.cli.folder": {"read_log": "read", "write_results": "figures"},
    "scenario_gen.pipeline": {
        "road_and_template": "road",
        "segment": "segment",
        "evaluate": "evaluate",
        "coverage_of": "evaluate",
    },
    "scenario_gen.method.chain": {
        "fit_template": "fit and plan",
        "plan_routes": "fit and plan",
        "sample_scenarios": "sample",
    },
    "scenario_gen.output.results": {"add_results": "bag", "write_report": "page"},
}
spent: dict[str, list[float]] = {}
_inside: list[list[float]] = []


def timed(function: Callable[..., Any], part: str) -> Callable[..., Any]:
    """Count what a function takes for a part, less what other parts take inside of it."""

    def measured(*values: Any, **named: Any) -> Any:
        began = process_time(), perf_counter()
        _inside.append([0.0, 0.0])
        try:
            return function(*values, **named)
        finally:
            took, others = [process_time() - began[0], perf_counter() - began[1]], _inside.pop()
            known = spent.setdefault(part, [0.0, 0.0])
            for k in (0, 1):
                known[k] += took[k] - others[k]
                if _inside:
                    _inside[-1][k] += took[k]

    return measured


def imports() -> None:
    """Import what the command imports, and have its parts timed."""
    from importlib import import_module

    from numba.core.caching import Cache

    import scenario_gen.cli.commands  # noqa: F401 - as the command does

    Cache._load_overload = timed(Cache._load_overload, "kernels")
    for module, functions in PARTS.items():
        for name, part in functions.items():
            home = import_module(module)
            setattr(home, name, timed(getattr(home, name), part))


def main() -> None:
    """Generate as a user does."""
    log, out, count = sys.argv[1:]
    timed(imports, "imports")()
    from scenario_gen.cli.commands import app

    sys.argv[1:] = [
        "generate",
        log,
        "--road",
        "four_way",
        "--count",
        count,
        "--seed",
        "7",
        "--out",
        out,
    ]
    try:
        timed(app, "command line, folder, and what is imported late")()
    finally:
        spent["interpreter"] = [STARTED, STARTED]
        print("\n" + json.dumps(spent))


if __name__ == "__main__":
    main()
