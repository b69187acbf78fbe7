# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Long and large: memory over the number of scenarios, an encounter of 1,000 s, and one of 30 vehicles.

`SCENARIO_GEN_SOAK_COUNT` is the larger set (100,000 unless given; a million takes about half an hour and 14 GB of disk). What has
been measured is kept in `state`; a run that was stopped goes on with what is missing.
"""

from collections.abc import Iterable, Iterator
import csv
import os
from pathlib import Path
import shutil
import subprocess
import sys
from typing import Any

from figures import Figure, kept
import numpy as np

from scenario_gen.logs.synthetic import bundled

COUNT = int(os.environ.get("SCENARIO_GEN_SOAK_COUNT", "100000"))
FEW = 10_000
GROWTH, PEAK = 0.2, 4.0  # kB for one scenario more; GB
MEASURED = """
import resource, sys
from scenario_gen.cli.commands import app
try:
    app(sys.argv[1:], standalone_mode=False)
finally:
    print("peak", resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, file=sys.stderr)
"""


def platoon(path: Path, vehicles: int, seconds: float) -> Path:
    """Write a table of cars one behind the other on a straight, 12 m apart, at 5 to 11 m/s."""
    time = np.arange(0.0, seconds, 0.1)
    speed = 8.0 + 3.0 * np.sin(time / 20.0) * np.sin(time / 7.3)
    driven = np.concatenate(([0.0], np.cumsum(speed[:-1] * 0.1)))
    with path.open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(("time", "id", "x", "y", "speed", "heading"))
        for n in range(vehicles):
            table.writerows(
                (t, n + 1, x - 12.0 * n, -1.75, v, 0.0)
                for t, x, v in zip(time, driven, speed, strict=True)
            )
    return path


def peak(state: Path, name: str, *arguments: str) -> float | None:
    """Peak memory [GB] of `scenario-gen generate` with these arguments, measured once; None if it failed."""

    def measure() -> dict[str, Any]:
        out = state / name
        command = [sys.executable, "-c", MEASURED, "generate", *arguments, "--out", str(out)]
        run = subprocess.run(command, capture_output=True, text=True, check=False)
        shutil.rmtree(out, ignore_errors=True)
        taken = [line.split()[1] for line in run.stderr.splitlines() if line.startswith("peak ")]
        return {
            "peak": float(taken[-1]) / 1e6 if run.returncode == 0 else None,
            "said": run.stderr[-500:],
        }

    found: float | None = kept(state / f"{name}.json", measure)["peak"]
    return found


def run(state: Path) -> Iterable[Figure]:
    """Measure what has not been measured yet."""
    yield from _scenarios(state)
    longest = platoon(state / "long.csv", 2, 1000.0)
    many = platoon(state / "many.csv", 30, 40.0)
    sizes = ("--set", "log.proximity=400", "--set")
    for name, asked, arguments in (
        ("long", "an encounter of 1,000 s", (str(longest), *sizes, "log.max_duration=1000")),
        ("many", "an encounter of 30 vehicles, 40 s", (str(many), *sizes, "log.max_vehicles=30")),
    ):
        found = peak(state, name, *arguments, "--road", "straight", "--count", "10")
        seen = "failed" if found is None else f"finished, {found:.2f} GB"
        yield Figure(
            asked, f"finishes in at most {PEAK:g} GB", seen, found is not None and found <= PEAK
        )


def _scenarios(state: Path) -> Iterator[Figure]:
    log = str(bundled("c"))
    few, many = (
        peak(state, f"count_{count}", log, "--road", "straight", "--count", str(count))
        for count in (FEW, COUNT)
    )
    if few is None or many is None:
        yield Figure(f"{COUNT:,} scenarios", "finishes", "failed", met=False)
        return
    slope = (many - few) * 1e6 / (COUNT - FEW)
    seen = f"{few:.3f} GB for {FEW:,}, {many:.3f} GB for {COUNT:,}: {slope:.3f} kB each"
    yield Figure(
        f"memory for {COUNT:,} scenarios",
        f"at most {GROWTH:g} kB for one more",
        seen,
        slope <= GROWTH,
    )
