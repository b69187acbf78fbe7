# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One warm command, as a user runs it: two vehicles, one road, 50 scenarios, kernels in the cache; the whole and its parts.

Seconds of the clock depend on what else the machine does, so those of the CPU stand beside them. The log is a bundled case as a
table, since most logs are tables.
"""

from collections.abc import Sequence
import csv
import json
import os
from pathlib import Path
from statistics import median
import subprocess
import sys
import tempfile
from time import perf_counter

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
        words = [
            "generate",
            str(log),
            "--road",
            "four_way",
            "--count",
            str(COUNT),
            "--seed",
            "7",
            "--out",
            out,
        ]
        command = [sys.executable, "-m", "scenario_gen", *words]
        _spent(command)
        whole = [_spent(command) for _ in range(RUNS)]
        plain = [_spent([sys.executable, "-c", "import scenario_gen"]) for _ in range(RUNS)]
        asked = [_spent([sys.executable, "-m", "scenario_gen", "--help"]) for _ in range(RUNS)]
        parts = _parts([sys.executable, "-m", "benchmarks._warm_parts", str(log), out, str(COUNT)])
    rows = [
        *_both("generate", whole, TARGET),
        *_both("--help", asked),
        *_both("import scenario_gen", plain),
    ]
    return rows + [
        row for name, spent in parts.items() for row in _both(f"generate, {name}", [spent])
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
    path = folder / "log.csv"
    with path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(
            ["t_s", "vehicle_id", "x_m", "y_m", "speed_mps", "heading_rad", "length_m", "width_m"]
        )
        for n, vehicle in enumerate(encounter.vehicles):
            columns = (
                encounter.time,
                encounter.position[n, :, 0],
                encounter.position[n, :, 1],
                encounter.speed[n],
                encounter.heading[n],
            )
            for t, *values in zip(*columns, strict=True):
                rows.writerow(
                    [
                        f"{t:.3f}",
                        vehicle.id,
                        *(f"{value:.4f}" for value in values),
                        vehicle.length,
                        vehicle.width,
                    ]
                )
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


def _parts(command: Sequence[str]) -> dict[str, list[float]]:
    ran = [
        subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()[-1]
        for _ in range(RUNS)
    ]
    told = [json.loads(line) for line in ran]
    return {name: [median(one[name][k] for one in told) for k in (0, 1)] for name in told[0]}
