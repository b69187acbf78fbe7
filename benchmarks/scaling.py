# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What size costs: `generate` by vehicles, horizon and scenarios; grids by cells, maps by lanes; the inventory of an archive.

Each size is measured in a process of its own (`_scaling_case`): CPU seconds, kernels loaded, and the peak of its memory.
Exponents are least-squares slopes of log CPU over log size. Vehicles come from two arms of a crossing and go straight on.
"""

import json
from pathlib import Path
import subprocess
import sys
import tempfile
from time import process_time

import numpy as np

from benchmarks._size import sized
from benchmarks.row import lower, Row
from scenario_gen.corpus.inventory import inventory

COUNT, SECONDS, CELL = 50, 20.0, 0.2
COARSE = 0.5  # m: with cells of 0.2 m, 300 s of a crossing at 10 m/s are more than `road.max_cells` may be
TARGETS = {8: 6.0, 12: 15.0}  # CPU seconds, by the number of vehicles
FILES = 100_000


def run() -> list[Row]:
    """The cost of groups, grids, maps, and of the inventory of many files."""
    rows = [*_vehicles(sized((2, 4, 8, 12), quick=(2, 3)))]
    fine = ((CELL, (20.0, 40.0, 60.0)), (COARSE, (20.0, 60.0, 300.0)))
    for cell, horizons in sized(fine, quick=((COARSE, (20.0, 25.0)),)):
        count = sized(COUNT, quick=2)
        found = {seconds: _measured("generate", 2, seconds, count, cell) for seconds in horizons}
        rows += _rows(
            "horizon", f"s, 2 vehicles, {count} scenarios, cells of {cell:g} m", found, 1.2
        )
    sizes = sized((50, 1000, 100_000), quick=(2, 4))
    found = {n: _measured("generate", 2, SECONDS, n, CELL) for n in sizes}
    rows += _rows("scenarios", f"scenarios, 2 vehicles, {SECONDS:g} s", found, 1.0)
    found = {
        n * n: _measured("grid", n) for n in sized((200, 1000, 3000, 10_000), quick=(200, 300))
    }
    rows += _rows("cells", "cells: drawing, distances, first path", found, 1.0)
    found = {n: _measured("map", n) for n in sized((1000, 3000, 10_000), quick=(400, 500))}
    rows += _rows("lanes", "lanes: reading, best place of two vehicles", found)
    return [*rows, _inventory(sized(FILES, quick=200))]


def _vehicles(sizes: tuple[int, ...]) -> list[Row]:
    """Rows of groups, and which shares of their cost generation and evaluation are."""
    count = sized(COUNT, quick=2)
    found = {n: _measured("generate", n, SECONDS, count, CELL) for n in sizes}
    rows = _rows("vehicles", f"vehicles, {SECONDS:g} s, {count} scenarios", found, 1.5, TARGETS)
    for n in sized((2, 8), quick=(2,)):
        for stage in ("generation", "references", "evaluation"):
            rows.append(
                lower(
                    f"{n} vehicles: share of {stage}",
                    100.0 * found[n][stage] / found[n]["all"],
                    "%",
                )
            )
    return rows


def _rows(
    name: str,
    what: str,
    found: dict[int, dict[str, float]] | dict[float, dict[str, float]],
    target: float | None = None,
    targets: dict[int, float] | None = None,
) -> list[Row]:
    """Rows of what was measured at each size, and of the exponent."""
    rows = []
    for size, case in found.items():
        parts = ", ".join(
            f"{part} {value:.3g} s"
            for part, value in case.items()
            if part not in ("all", "mebibytes")
        )
        rows.append(
            lower(
                f"{size:,g} {what}",
                case["all"],
                "CPU s",
                (targets or {}).get(int(size)),
                parts or None,
            )
        )
        rows.append(lower(f"{size:,g} {what}: peak memory", case["mebibytes"], "MiB"))
    slope = np.polyfit(np.log(list(found)), np.log([case["all"] for case in found.values()]), 1)[0]
    return [
        *rows,
        lower(f"exponent in {name}", slope, "", target, f"{min(found):g} to {max(found):g}"),
    ]


def _measured(*words: object) -> dict[str, float]:
    """CPU seconds and MiB of one size, in a process of its own."""
    command = [sys.executable, "-m", "benchmarks._scaling_case", *map(str, words)]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    found: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return found


def _inventory(files: int) -> Row:
    """Seconds that it takes to see what lies in an archive."""
    line = ",".join(["1"] * 19) + "\n"
    with tempfile.TemporaryDirectory() as place:
        for k in range(files):
            path = Path(place, f"{k // 1000:03}", f"{k}.csv")
            path.parent.mkdir(exist_ok=True)
            path.write_text(line)
        begun = process_time()
        found = len(inventory([Path(place)])[0])
        seconds = process_time() - begun
    assert found == files
    return lower(f"inventory of {files} files", seconds, "CPU s", 10.0)
