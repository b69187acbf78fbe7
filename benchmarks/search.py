# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The failure search: does its interval hold the known rate, how many drives does it save, and how soon does it find a failure?

The planners are the witness, some seconds late, whose failure rate brute force gives (`brute_force`, 100,000 scenarios each).
"""

from statistics import median
from time import process_time

import numpy as np

from benchmarks._late_witness import brute_force, LateWitness, natural_scenarios
from benchmarks._size import sized
from benchmarks.row import higher, lower, Row
from scenario_gen.closed_loop.search.estimate import Search

PLANNERS = {  # seconds late: drives of a search, failures of brute force, share of plain sampling's drives that is asked
    0.64: (600, 4587, 1 / 3),
    0.485: (1000, 1291, 1 / 8),
    0.41: (1500, 395, 1 / 20),
}
BRUTE = 100_000
SEEDS = 20
PLAIN_COUNT = 5000
"""Drives of plain sampling until the first failure, at most."""


def run(seeds: int = sized(SEEDS, quick=1), brute: int = sized(0, quick=200)) -> list[Row]:
    """Measure; with `brute` scenarios the failure rates are counted anew (1,000 take 1.5 s of CPU time)."""
    natural = natural_scenarios()
    counted = [failures for _, failures, _ in PLANNERS.values()]
    if brute:
        counted = brute_force(natural, list(PLANNERS), brute)
    rows = []
    for (late, (budget, _, target)), failures in zip(PLANNERS.items(), counted, strict=True):
        rate, drives = failures / (brute or BRUTE), sized(budget, 60)
        rows += _planner(LateWitness(natural, late), rate, drives, target, seeds)
    return rows


def _planner(
    problem: LateWitness, truth: float, budget: int, asked: float, seeds: int
) -> list[Row]:
    held, share, first, begun = 0, [], [], process_time()
    for seed in range(seeds):
        found = Search(problem, seed, budget).run()
        held += found.rate.low <= truth <= found.rate.high
        half = 0.5 * (found.rate.high - found.rate.low)
        share.append(found.drives * half * half / (1.96**2 * max(truth * (1.0 - truth), 1e-9)))
        first.append(found.first or budget + 1)
    seconds = (process_time() - begun) / (seeds * budget)
    plain = [_plain(problem, seed) for seed in range(seeds)]
    name, plain_drives = f"failure rate {truth:.1e}, {budget} drives", f"plain {median(plain):g}"
    gain, target = median(plain) / median(first), 10.0 if truth < 2e-3 else None
    return [
        higher(f"{name}: intervals that hold it, of {seeds}", held, "", 0.9 * seeds),
        lower(f"{name}: drives, as a share of plain sampling's", median(share), "", asked),
        lower(f"{name}: drives until the first failure", median(first), "", None, plain_drives),
        higher(f"{name}: plain sampling's over the search's", gain, "×", target),
        lower(f"{name}: CPU time a drive, without the drive", 1e3 * seconds, "ms"),
    ]


def _plain(problem: LateWitness, seed: int) -> int:
    """Return the number of the first natural drive that fails; PLAIN_COUNT if none does so far."""
    generator, driven = np.random.default_rng(seed), 0
    while driven < PLAIN_COUNT:
        z = generator.standard_normal((256, problem.size))
        responses = problem.drive([one for one in problem.candidates(z) if one is not None])
        hits = [k for k, one in enumerate(responses) if one.failed]
        if hits:
            return driven + hits[0] + 1
        driven += len(responses)
    return PLAIN_COUNT
