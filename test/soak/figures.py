# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One row of the table that `make soak` prints: a promise, what was asked and what was seen; and how progress is kept."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
import json
from pathlib import Path
import subprocess
import sys
from typing import Any

ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Figure:
    """One promise of docs/project.md with the figure seen in this run."""

    promise: str
    asked: str
    seen: str
    met: bool


def kept(path: Path, make: Callable[[], Any]) -> Any:
    """Return what a JSON file holds; where it is not there yet, its content is made and written."""
    if not path.exists():
        path.write_text(json.dumps(make(), indent=1) + "\n")
    return json.loads(path.read_text())


def of_benchmark(name: str, path: Path) -> Iterator[Figure]:
    """Yield a figure for each row of a benchmark, which is run if its results are not in the file; a target is a promise."""

    def run() -> Any:
        command = [sys.executable, "-m", "benchmarks", name, "--json"]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
        return json.loads(done.stdout.splitlines()[-1])

    for row in kept(path, run)["rows"]:
        target = row["target"]
        asked = (
            "-"
            if target is None
            else f"{'≥' if row['better'] == 'higher' else '≤'} {target:g} {row['unit']}"
        )
        yield Figure(
            f"{name}: {row['id']}",
            asked,
            f"{row['value']:g} {row['unit']}",
            row["met"] is not False,
        )
