# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The failure rates that the benchmark of the search goes by, counted anew with another seed: 300,000 drives of each planner."""

from collections.abc import Iterator
import json
from pathlib import Path

from figures import Figure

from benchmarks._late_witness import brute_force, natural_scenarios
from benchmarks.search import BRUTE, PLANNERS
from scenario_gen.method.evaluation import wilson

STEP = 10_000  # drives after which the counts are written
SEED = 2_000_000  # the counts in the benchmark are of seed 1


def run(state: Path) -> Iterator[Figure]:
    """Count failures; goes on after the last counts that were written."""
    file = state / "counts.json"
    steps = json.loads(file.read_text()) if file.exists() else []
    natural = natural_scenarios()
    while len(steps) * STEP < BRUTE:
        steps.append(brute_force(natural, list(PLANNERS), STEP, SEED + len(steps)))
        file.write_text(json.dumps(steps))
    for (late, (_, failures, _)), counts in zip(PLANNERS.items(), zip(*steps, strict=True), strict=True):
        known = wilson(failures, BRUTE, 0.99)
        again = wilson(sum(counts), len(steps) * STEP, 0.99)
        yield Figure(
            promise=f"failure rate of the witness {late:g} s late",
            asked=f"99 % intervals overlap with {failures} of {BRUTE}",
            seen=f"{sum(counts)} of {len(steps) * STEP}",
            met=again.low <= known.high and known.low <= again.high,
        )
