# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Cost of `generate` by vehicles, horizon and scenarios, and of maps by lanes.

Each size is measured in its own process (`_scaling_case`): CPU seconds with loaded kernels, and
the peak memory. Exponents are least-squares slopes of log CPU over log size. Vehicles come from two
arms of a crossing and go straight on.
"""

import json
import subprocess
import sys

import numpy as np

from benchmarks._size import sized
from benchmarks.row import lower, Row

COUNT, SECONDS = sized(50, quick=2), 20.0
TARGETS_S = {8: 6.0, 12: 15.0}
"""CPU seconds by the number of vehicles."""


def run() -> list[Row]:
    """Measure groups, horizons, sets and maps."""
    vehicles = sized((2, 4, 8, 12), quick=(2, 3))
    horizons = sized((20.0, 40.0, 60.0), quick=(20.0, 25.0))
    counts = sized((50, 1000, 100_000), quick=(2, 4))
    lanes = sized((1000, 3000, 10_000), quick=(400, 500))
    return [
        *_rows("vehicles", {n: _measured("generate", n, SECONDS, COUNT) for n in vehicles}, 1.5),
        *_rows("s of horizon", {t: _measured("generate", 2, t, COUNT) for t in horizons}, 1.2),
        *_rows("scenarios", {n: _measured("generate", 2, SECONDS, n) for n in counts}, 1.0),
        *_rows("lanes", {n: _measured("map", n) for n in lanes}),
    ]


def _rows(
    name: str,
    found: dict[int, dict[str, float]] | dict[float, dict[str, float]],
    target: float | None = None,
) -> list[Row]:
    """Return the cost at each size, and the exponent."""
    rows = []
    for size, case in found.items():
        limit = TARGETS_S.get(int(size)) if name == "vehicles" else None
        rows.append(lower(f"{size:,g} {name}", case["seconds"], "CPU s", limit))
        rows.append(lower(f"{size:,g} {name}: peak memory", case["mebibytes"], "MiB"))
    seconds = [case["seconds"] for case in found.values()]
    slope = np.polyfit(np.log(list(found)), np.log(seconds), 1)[0]
    return [*rows, lower(f"exponent in {name}", slope, "", target)]


def _measured(*words: object) -> dict[str, float]:
    """Return CPU seconds and MiB of one size."""
    command = [sys.executable, "-m", "benchmarks._scaling_case", *map(str, words)]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    found: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return found
