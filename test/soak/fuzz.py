# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A hundred thousand damaged inputs for every reader and every type of message: errors of ours, or nothing, come out."""

from collections.abc import Iterator
from importlib.util import find_spec
import json
import math
from pathlib import Path
import subprocess
import sys

from figures import Figure
from harness import fuzz, HERE, MEMORY, SECONDS, targets

EXECUTIONS = 100_000
MINUTES = 10.0  # of a target guided by coverage


def run(state: Path) -> Iterator[Figure]:
    """Fuzz one target after the other; those that are done are not begun again. With atheris, each goes on guided by coverage."""
    for name, target in targets().items():
        record = fuzz(target, state, EXECUTIONS, math.inf)
        found = [f"{failure.count} × {failure.signature}" for failure in record.failures.values()]
        found += guided(name, state / "guided")
        asked = f"{EXECUTIONS}; each ≤ {SECONDS:g} s of CPU and ≤ {MEMORY >> 30} GiB"
        seen = f"{record.executions} in {record.seconds / 60.0:.1f} min: {'; '.join(found) or 'nothing else'}"
        yield Figure(f"{name}: damaged inputs end in errors of ours", asked, seen, not found)


def guided(name: str, state: Path) -> list[str]:
    """Fuzz a target guided by coverage, unless that is done; return what came out. Nothing happens where atheris is missing."""
    done = state / f"{name}.done"
    if find_spec("atheris") and not done.exists():
        state.mkdir(parents=True, exist_ok=True)
        command = [sys.executable, str(HERE / "guided.py"), name, str(state), str(60.0 * MINUTES)]
        with (state / f"{name}.log").open("w") as log:
            subprocess.run(command, stdout=log, stderr=log, check=False)
        done.touch()
    found = state / "guided.jsonl"
    entries = map(json.loads, found.read_text().splitlines()) if found.exists() else ()
    ends = ("crash", "timeout", "oom")
    killed = [f"{file.name} (libFuzzer)" for kind in ends for file in sorted(state.glob(f"{name}_{kind}-*"))]
    return [entry["signature"] for entry in entries if entry["target"] == name] + killed
