# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Random scenarios before the checker and an oracle that shares no line with it: overlaps, the road, who comes and goes.

`SCENARIO_GEN_SOAK_CASES` scenarios (1,000,000) in at most `SCENARIO_GEN_SOAK_HOURS` (10), half of each kind; the figure
states how many were compared. A part that was stopped goes on.
"""

from collections.abc import Iterator
from concurrent.futures import as_completed, ProcessPoolExecutor
import json
import os
from pathlib import Path
import sys
import time

from figures import Figure, ROOT

CASES = int(os.environ.get("SCENARIO_GEN_SOAK_CASES", "1000000"))
HOURS = float(os.environ.get("SCENARIO_GEN_SOAK_HOURS", "10"))
BLOCK = 250  # seeds, each a scenario of both kinds
sys.path.append(str(ROOT / "test" / "method" / "validity"))


def disagreements(block: int) -> list[str]:
    """Return the scenarios of a block about which checker and oracle disagree."""
    import test_validity_geometry
    import test_validity_presence

    found = []
    for seed in range(block * BLOCK, (block + 1) * BLOCK):
        for module in (test_validity_geometry, test_validity_presence):
            try:
                module.compare(seed)
            except AssertionError:
                found.append(f"{module.__name__}.compare({seed})")
    return found


def run(state: Path) -> Iterator[Figure]:
    """Compare what has not been compared yet."""
    kept, end = state / "blocks.json", time.monotonic() + 3600.0 * HOURS
    done = json.loads(kept.read_text()) if kept.exists() else {}
    blocks = [k for k in range(-(-CASES // (2 * BLOCK))) if str(k) not in done]
    with ProcessPoolExecutor() as pool:
        tasks = {pool.submit(disagreements, k): k for k in blocks}
        for task in as_completed(tasks):
            if task.cancelled():
                continue
            done[str(tasks[task])] = task.result()
            kept.write_text(json.dumps(done) + "\n")
            if time.monotonic() > end:
                pool.shutdown(wait=False, cancel_futures=True)
    count, bad = 2 * BLOCK * len(done), [one for found in done.values() for one in found]
    seen = f"{count:,} compared; {', '.join(bad[:5]) or 'they agree'}"
    met = not bad and count >= CASES
    yield Figure("checker and oracle agree on random scenarios", f"{CASES:,}", seen, met)
