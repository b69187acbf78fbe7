# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The failures that a search found: certified scenarios, sorted into kinds, the likeliest of each kind first."""

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
from scenario_gen.numerics.plane import edge_lengths
from scenario_gen.types import (
    Facts,
    Failure,
    Scenario,
)

SHOWN = 100  # failures that are kept as scenarios, at most
OF_ONE_KIND = 30  # of these, at most of one kind
SAME_PLACE = 8.0  # metres of the ego's way; failures farther apart are of different kinds


@dataclass(frozen=True, eq=False)
class Finding:
    """One failure.

    Attributes:
        drive: its number in the search, from 0.
        kind: who, how and where.
        weight: for how many natural scenarios it stands in the rate; None where the exploration
            found it.
        deviation: from the mean scenario, in standard deviations along the direction that the
            regression goes by.
        trial: the scenario, of all vehicles.
        outcome: the drive.
        passed: whether the ego's witness passes it.
    """

    drive: int
    kind: str
    weight: float | None
    deviation: float
    trial: Trial
    outcome: Outcome
    passed: bool

    def document(self) -> dict[str, Any]:
        """Return it as JSON's types."""
        return {
            "name": self.trial.name,
            "kind": self.kind,
            "weight": self.weight,
            "deviation": round(self.deviation, 4),
            "witness_passes": self.passed,
            "verdict": self.outcome.verdict.document(),
        }

    def scenario(self) -> Scenario:
        """Return the scenario of all vehicles, with what the search says of it."""
        failure = Failure(self.kind, self.deviation, self.weight)
        return replace(self.trial.scenario, facts=Facts(failure=failure))


def findings_of(
    search: Search, problem: DrivenScenarios, config: ClosedLoopConfig
) -> list[Finding]:
    """Drive again in the failures of a search, and sort them: the likeliest of each kind first; the worst first, if it asked."""
    failures = [k for k, one in enumerate(search.responses) if one.failed]
    deviation = {k: search.deviation(k) for k in failures}
    order = {k: search.responses[k].margin if search.worst else deviation[k] for k in failures}
    counts: Counter[str] = Counter()
    chosen: list[int] = []
    for k in sorted(failures, key=lambda k: (order[k], k)):
        counts[search.responses[k].kind] += 1
        if counts[search.responses[k].kind] <= OF_ONE_KIND and len(chosen) < SHOWN:
            chosen.append(k)
    scenarios = (
        problem.natural.scenarios(np.stack([search.z[k] for k in chosen])) if chosen else []
    )
    trials = [
        problem.trial(k, one) for k, one in zip(chosen, scenarios, strict=True) if one is not None
    ]
    outcomes = list(problem.run(trials))
    places = [_station(one) for one in outcomes]
    kinds = _kinds([search.responses[k].kind for k in chosen], places)
    return [
        Finding(
            k,
            kind,
            search.weights.get(k),
            deviation[k],
            trial,
            outcome,
            _witness_passes(trial, config),
        )
        for k, kind, trial, outcome in zip(chosen, kinds, trials, outcomes, strict=True)
    ]


def _witness_passes(trial: Trial, config: ClosedLoopConfig) -> bool:
    loop = ClosedLoop(trial.scenario, trial.ego, trial.road, config)
    return judge(loop, loop.drive(ReferenceFollower(loop))).passed


def _station(outcome: Outcome) -> float:
    """Return how far [m] the ego had come when it failed."""
    drive, verdict = outcome.drive, outcome.verdict
    times = [
        verdict.collision.time if verdict.collision else np.nan,
        verdict.off_road,
        float(drive.motion.time[-1]),
    ]
    way = np.concatenate([[0.0], np.cumsum(edge_lengths(drive.motion.position[drive.ego]))])
    return float(np.interp(np.nanmin(times), drive.motion.time, way))


def _kinds(kinds: Sequence[str], places: Sequence[float]) -> list[str]:
    """Return the kinds with their places: those of one kind are split where SAME_PLACE of the way lie between two."""
    result = list(kinds)
    for kind in set(kinds):
        rows = np.array(
            sorted((k for k, each in enumerate(kinds) if each == kind), key=lambda k: places[k])
        )
        for group in np.split(
            rows, np.flatnonzero(np.diff(np.array(places)[rows]) > SAME_PLACE) + 1
        ):
            low, high = (round(places[k]) for k in group[[0, -1]])
            where = f"{low} m" if low == high else f"{low} to {high} m"
            for k in group:
                result[k] = f"{kind}, {where} after its start"
    return result
