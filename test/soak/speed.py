# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The times and rates of all benchmarks that benchmarks/README.md names, beside their last values on this machine.

The first run only keeps the values. A value that is worse than the bound does not replace the last one.
"""

from collections.abc import Iterable
import json
from pathlib import Path
import re
import subprocess
import sys
from typing import Any

from figures import Figure, ROOT

NAMED = re.compile(r"^`(\w+)`", re.MULTILINE)
UNITS = ("s", "ms", "1/s", "steps/s")
MAX_RATIO = 1.5
Rows = dict[str, dict[str, Any]]


def measured(name: str) -> dict[str, Any]:
    """Return a benchmark's machine and, by name, its times and rates; with an error also those until then."""
    command = [sys.executable, "-m", "benchmarks", name, "--json"]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    documents = [line for line in run.stdout.splitlines() if line.startswith('{"benchmark"')]
    document = json.loads(documents[-1]) if documents else {"rows": [], "machine": {}}
    rows = {row["id"]: row for row in document["rows"] if row["unit"] in UNITS}
    error = document.get("stopped") or run.stderr[-200:] if run.returncode else ""
    return {"machine": document["machine"], "rows": rows, "error": error}


def worse(now: Rows, last: Rows) -> list[str]:
    """Return the rows that are missing, or worse by more than the bound, with both values."""
    found = []
    for name, before in last.items():
        value = now.get(name, {}).get("value")
        old = before["value"]
        if old is None:
            continue
        low, high = (old, value) if before["better"] == "lower" else (value, old)
        if value is None or high > MAX_RATIO * low:
            found.append(f"{name}: {old:.4g} before, now {value and f'{value:.4g}'}")
    return found


def run(state: Path) -> Iterable[Figure]:
    """Measure each benchmark, and compare it with its last values."""
    text = (ROOT / "benchmarks" / "README.md").read_text()
    for name in dict.fromkeys(NAMED.findall(text)):
        path = state / f"{name}.json"
        last = json.loads(path.read_text()) if path.exists() else None
        now = measured(name)
        is_known = last is not None and last["machine"] == now["machine"]
        faults = worse(now["rows"], last["rows"]) if is_known else []
        faults += [now["error"]] if now["error"] else []
        if not faults:
            path.write_text(json.dumps(now, indent=1) + "\n")
        seen = "; ".join(faults) or f"{len(now['rows'])} rows{'' if is_known else ', the first'}"
        yield Figure(name, f"at most {MAX_RATIO:g} × the last time", seen, not faults)
