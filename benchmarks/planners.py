# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Mutation score: how many single faults of a planner do scenarios catch, as `generate` and as `--for-testing` make them?

The planner is `IdmFollower`, the faults are those of `drive --mutants`. A scenario that the planner itself fails catches nothing.
"""

import os

from benchmarks._size import sized
from benchmarks.row import higher, Row
from scenario_gen.base.errors import RefusedError
from scenario_gen.closed_loop.mutants import MUTANTS, mutation_score
from scenario_gen.closed_loop.reacting import Testing
from scenario_gen.closed_loop.trials import run_trials, trials_of
from scenario_gen.logs import read_log
from scenario_gen.logs.synthetic import bundled
from scenario_gen.pipeline import generate, PipelineConfig
from scenario_gen.types import Encounter, GenerationResult, Request

PLANNER = "IdmFollower"
ROADS = {"examples/my_log.csv": "four_way", str(bundled("b")): "t_intersection"}
EGO = Request(ego="2")
TARGETS = {"generate": 32 / 47, "for testing": 40 / 47}  # shares of the faults
BUDGET_S = sized(120.0, quick=1.0)  # of one search for scenarios that test


def run(count: int = sized(20, quick=1)) -> list[Row]:
    """Measure; `count` scenarios of each recording and kind."""
    rows, workers = [], os.cpu_count() or 1
    encounters = {log: read_log([log]).encounters[0] for log in ROADS}
    for kind, target in TARGETS.items():
        results = [
            result
            for log, road in ROADS.items()
            for result in _results(kind, encounters[log], road, count)
        ]
        trials = [trial for result in results for trial in trials_of(result)]
        outcomes = run_trials(trials, PLANNER, workers=workers)
        score = mutation_score(trials, PLANNER, outcomes, workers=workers)
        passed = sum(outcome.verdict.passed for outcome in outcomes)
        survivors = [each for each in score.results if not each.killed_by]
        worse = sum(each.riskier > 0 for each in survivors)
        same = sum(not each.changed for each in survivors)
        text = f"of the others {same} change no drive, {worse} drive worse and pass"
        name = f"{kind}: faults caught, of {len(MUTANTS)}, in {passed} of {len(trials)} scenarios"
        rows.append(higher(name, score.caught, "", round(target * len(MUTANTS)), text))
    return rows


def _results(kind: str, encounter: Encounter, road: str, count: int) -> list[GenerationResult]:
    if kind == "generate":
        return [generate(encounter, road, count=count, request=EGO)]
    try:
        return Testing(encounter, road, PipelineConfig(), EGO, 0, BUDGET_S).run(count).results
    except RefusedError:  # the row says how many scenarios there are
        return []
