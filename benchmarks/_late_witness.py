# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Planners made to fail with a small probability: the witness, some seconds late, among others who replay their motion.

Such a drive needs no closed loop, so its failure rate is known from hundreds of thousands of certified scenarios.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from scenario_gen.closed_loop.search.response import Response
from scenario_gen.logs import read_log
from scenario_gen.logs.synthetic import bundled
from scenario_gen.method.chain import Chain
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.evaluation import footprint_distance
from scenario_gen.method.evaluation.time_shift import min_time_shift
from scenario_gen.method.sampling import checker_of, NaturalScenarios, Plan
from scenario_gen.method.segmentation import segment
from scenario_gen.numerics import Floats
from scenario_gen.roads import road_and_template
from scenario_gen.situation import Situation
from scenario_gen.types import Request, Scenario

SEED = 7


def natural_scenarios() -> NaturalScenarios:
    """Return the natural scenarios of a bundled log: one vehicle turns left behind another who comes towards it."""
    config = PipelineConfig()
    (encounter,) = read_log([bundled("b")]).encounters
    road, encounter = road_and_template("t_intersection", encounter, config.road)
    attempt = Chain(
        Situation.of(encounter),
        segment(encounter, config.segmentation, SEED),
        road,
        config,
        seed=SEED,
    )
    plan = Plan.of(attempt.plan(), config.sampling, config.limits, Request())
    checker = checker_of(plan, config.sampling, config.limits, Request())
    return NaturalScenarios.of(plan, checker.check, config.sampling, SEED)


def late_by(scenario: Scenario, late: float, ego: int = 0) -> Scenario:
    """Return the scenario with the ego where it should have been some seconds before."""
    position, heading = scenario.position.copy(), scenario.heading.copy()
    earlier = scenario.at(scenario.time - late)
    position[ego], heading[ego] = earlier.position[ego], earlier.heading[ego]
    return replace(scenario, position=position, heading=heading)


def touches(scenario: Scenario, ego: int = 0) -> bool:
    """Return whether the ego touches another at an instant."""
    others = (i for i in range(len(scenario.vehicles)) if i != ego)
    return any(bool((footprint_distance(scenario, ego, i) <= 0.0).any()) for i in others)


@dataclass
class LateWitness:
    """The problem of a failure search; a contact is a failure."""

    natural: NaturalScenarios
    late: float

    @property
    def size(self) -> int:
        """Standard normal numbers of a scenario."""
        return self.natural.size

    def candidates(self, z: Floats) -> list[Scenario | None]:
        """Return the certified scenarios of numbers (S, size)."""
        return self.natural.scenarios(z)

    def features(self, candidate: Scenario) -> tuple[float, ...]:
        """Return how far in time [s] the witness is from a collision with each of the others."""
        here = np.ones((len(candidate.vehicles), len(candidate.time)), dtype=np.bool_)
        return tuple(
            min_time_shift(candidate, here, 0, i) for i in range(1, len(candidate.vehicles))
        )

    def drive(self, candidates: Sequence[Scenario]) -> list[Response]:
        """Return how near each came to a contact [s]."""
        return [self._response(late_by(one, self.late)) for one in candidates]

    @staticmethod
    def _response(motion: Scenario) -> Response:
        here = np.ones((len(motion.vehicles), len(motion.time)), dtype=np.bool_)
        apart = tuple(min_time_shift(motion, here, 0, i) for i in range(1, len(motion.vehicles)))
        return (
            Response(-1.0, apart, "contact")
            if touches(motion)
            else Response(max(min(apart), 1e-3), apart)
        )


def brute_force(
    natural: NaturalScenarios, lates: Sequence[float], count: int, seed: int = 1
) -> list[int]:
    """Return in how many of `count` natural scenarios each of the planners fails."""
    rng = np.random.default_rng(seed)
    failures, done = [0] * len(lates), 0
    while done < count:
        drawn = [
            one
            for one in natural.scenarios(rng.standard_normal((256, natural.size)))
            if one is not None
        ]
        for scenario in drawn[: count - done]:
            for k, late in enumerate(lates):
                failures[k] += touches(late_by(scenario, late))
        done += len(drawn[: count - done])
    return failures
