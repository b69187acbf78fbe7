# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The failures of a search: certified scenarios by kind, the most likely of each kind first."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.origin import Trial
from scenario_gen.closed_loop.planners import ReferenceFollower
from scenario_gen.closed_loop.search.estimate import Search
from scenario_gen.closed_loop.search.problem import DrivenScenarios
from scenario_gen.closed_loop.simulation import ClosedLoop
from scenario_gen.closed_loop.trials import Outcome
from scenario_gen.closed_loop.verdict import judge
from scenario_gen.numerics import arc_lengths
from scenario_gen.types import Decision, Facts, Failure, Scenario

MAX_FINDINGS_COUNT = 100  # each is driven again and saved
MAX_PER_KIND_COUNT = 30
KIND_SPACING_M = 8.0  # along the way of the ego; a larger distance separates two kinds


@dataclass(frozen=True, eq=False)
class Finding:
    """One failure.

    Attributes:
        drive: its number in the search, from 0.
        kind: of the failure, with the other vehicle and the place.
        weight: number of natural scenarios that it represents in the rate; None in the
            exploration.
        deviation: from the mean scenario, in standard deviations along the slope of the
            regression.
        trial: the scenario of all vehicles.
        outcome: the drive.
        passed: whether the witness of the ego passes the scenario.
    """

    drive: int
    kind: str
    weight: float | None
    deviation: float
    trial: Trial
    outcome: Outcome
    passed: bool

    def document(self) -> dict[str, Any]:
        """Return the finding in the types of JSON."""
        return {
            "name": self.trial.name,
            "kind": self.kind,
            "weight": self.weight,
            "deviation": round(self.deviation, 4),
            "witness_passes": self.passed,
            "verdict": self.outcome.verdict.document(),
        }

    def scenario(self, decision: Decision | None) -> Scenario:
        """Return the scenario of all vehicles, with the facts of the failure and the decision."""
        failure = Failure(self.kind, self.deviation, self.weight)
        return replace(self.trial.scenario, facts=Facts(failure=failure, decision=decision))


def findings_of(
    search: Search, problem: DrivenScenarios, config: ClosedLoopConfig
) -> list[Finding]:
    """Drive the failures of a search again and sort them.

    The most likely of each kind are first, or the worst if the search was for the worst.
    """
    chosen = _choose(search)
    if not chosen:
        return []
    scenarios = problem.natural.scenarios(np.stack([search.z[k] for k in chosen]))
    trials = [
        problem.trial(k, scenario)
        for k, scenario in zip(chosen, scenarios, strict=True)
        if scenario is not None
    ]
    outcomes = list(problem.run(trials))
    stations = [_station(outcome) for outcome in outcomes]
    kinds = _split_kinds([search.responses[k].kind for k in chosen], stations)
    return [
        Finding(
            drive=k,
            kind=kind,
            weight=search.weights.get(k),
            deviation=search.deviation(k),
            trial=trial,
            outcome=outcome,
            passed=_witness_passes(trial, config),
        )
        for k, kind, trial, outcome in zip(chosen, kinds, trials, outcomes, strict=True)
    ]


def _choose(search: Search) -> list[int]:
    """Return the drives of the failures to show, in their order."""
    rank: dict[int, float] = {}
    for k, response in enumerate(search.responses):
        if response.failed:
            rank[k] = response.margin if search.worst else search.deviation(k)
    counts: Counter[str] = Counter()
    chosen: list[int] = []
    for k in sorted(rank, key=lambda k: (rank[k], k)):
        kind = search.responses[k].kind
        counts[kind] += 1
        if counts[kind] <= MAX_PER_KIND_COUNT:
            chosen.append(k)
    return chosen[:MAX_FINDINGS_COUNT]


def _witness_passes(trial: Trial, config: ClosedLoopConfig) -> bool:
    loop = ClosedLoop(trial.scenario, trial.ego, trial.road, config)
    return judge(loop, loop.drive(ReferenceFollower(loop))).passed


def _station(outcome: Outcome) -> float:
    """Return the way [m] of the ego until its failure."""
    drive, verdict = outcome.drive, outcome.verdict
    times = [
        verdict.collision.time if verdict.collision else np.nan,
        verdict.off_road,
        float(drive.motion.time[-1]),
    ]
    way = arc_lengths(drive.motion.position[drive.ego])
    return float(np.interp(np.nanmin(times), drive.motion.time, way))


def _split_kinds(kinds: Sequence[str], stations: Sequence[float]) -> list[str]:
    """Return the kinds with their places; a kind is split at gaps between its stations [m]."""
    result = list(kinds)
    for kind in set(kinds):
        members = [k for k, each in enumerate(kinds) if each == kind]
        rows = np.array(sorted(members, key=lambda k: stations[k]))
        gaps = np.diff(np.array(stations)[rows])
        for group in np.split(rows, np.flatnonzero(gaps > KIND_SPACING_M) + 1):
            low = round(stations[group[0]])
            high = round(stations[group[-1]])
            place = f"{low} m" if low == high else f"{low} to {high} m"
            for k in group:
                result[k] = f"{kind}, {place} after its start"
    return result
