# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One warm command, as a user runs it: two vehicles, one road, 50 scenarios, kernels in the cache.

Seconds of the clock depend on what else the machine does, so those of the CPU stand beside them. The log is a bundled case as a
table, since most logs are tables.
"""

from collections.abc import Sequence
import os
from pathlib import Path
from statistics import median
import subprocess
import sys
import tempfile
from time import perf_counter

import pandas as pd

from benchmarks._size import sized
from benchmarks.row import lower, Row
from scenario_gen import bundled, read_log

RUNS = sized(5, quick=1)
COUNT = sized(50, quick=2)
TARGET = 2.5  # s


def run() -> list[Row]:
    """Measure; one run before, which compiles what is not in the cache, is not counted."""
    with tempfile.TemporaryDirectory() as folder:
        log, out = _table(Path(folder)), f"{folder}/out"
        settings = f"--road four_way --count {COUNT} --seed 7 --out".split()
        words = ["generate", str(log), *settings, out]
        command = [sys.executable, "-m", "scenario_gen", *words]
        _spent(command)
        whole = [_spent(command) for _ in range(RUNS)]
        plain = [_spent([sys.executable, "-c", "import scenario_gen"]) for _ in range(RUNS)]
        asked = [_spent([sys.executable, "-m", "scenario_gen", "--help"]) for _ in range(RUNS)]
    return [
        *_both("generate", whole, TARGET),
        *_both("--help", asked),
        *_both("import scenario_gen", plain),
    ]


def _both(name: str, spent: Sequence[Sequence[float]], target: float | None = None) -> list[Row]:
    """Medians of the seconds of CPU and clock."""
    return [
        lower(f"{name}: {what}", median(each[k] for each in spent), "s", target)
        for k, what in enumerate(("CPU", "clock"))
    ]


def _table(folder: Path) -> Path:
    """Write the bundled case of two left turners as a CSV table."""
    (encounter,) = read_log(bundled("b")).encounters
    tables = [
        pd.DataFrame(
            {
                "t_s": encounter.time,
                "vehicle_id": vehicle.id,
                "x_m": encounter.position[n, :, 0],
                "y_m": encounter.position[n, :, 1],
                "speed_mps": encounter.speed[n],
                "heading_rad": encounter.heading[n],
                "length_m": vehicle.length,
                "width_m": vehicle.width,
            }
        )
        for n, vehicle in enumerate(encounter.vehicles)
    ]
    path = folder / "log.csv"
    pd.concat(tables).to_csv(path, index=False, float_format="%.4f")
    return path


def _spent(command: Sequence[str]) -> tuple[float, float]:
    """Run a command; return its seconds of the CPU and of the clock."""
    started = perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, command)
    return usage.ru_utime + usage.ru_stime, perf_counter() - started
