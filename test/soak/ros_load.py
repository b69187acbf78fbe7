# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Start and end of the nodes: six started together, cold and warm, and ended at a load of 16 (see benchmarks/start.py)."""

from collections.abc import Iterator
import json
from pathlib import Path
import subprocess
import sys

from figures import Figure

ROOT = Path(__file__).resolve().parents[2]


def run(_state: Path) -> Iterator[Figure]:
    """Run the benchmark; what has a target is a promise."""
    command = [sys.executable, "-m", "benchmarks", "start", "--json"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    for row in json.loads(done.stdout.splitlines()[-1])["rows"]:
        asked = "-" if row["target"] is None else f"at most {row['target']:g} {row['unit']}"
        seen = f"{row['value']:.1f} {row['unit']}"
        yield Figure(row["id"], asked, seen, row["target"] is None or row["value"] <= row["target"])
