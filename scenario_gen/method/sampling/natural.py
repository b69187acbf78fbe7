# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Scenarios as a function of standard normal numbers, for a search that selects these."""

from dataclasses import dataclass

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.sampling.build_model import build_model
from scenario_gen.method.sampling.config import SamplingConfig
from scenario_gen.method.sampling.filters import (
    CheckScenarios,
    Filters,
    PILOT_CANDIDATES,
    RarityFilter,
    ValidityFilter,
)
from scenario_gen.method.sampling.plan import Plan
from scenario_gen.method.sampling.sampler import Block, LEVELS, Sampler, searched_index
from scenario_gen.method.sampling.stage import enough_share
from scenario_gen.numerics import Floats
from scenario_gen.types import Measures, Scenario


@dataclass(frozen=True, eq=False)
class NaturalScenarios:
    """Certified scenarios by their numbers; independent standard normal numbers are natural.

    Attributes:
        sampler: draws candidates.
        filters: validity, and rarity as in a set.
        level: whose standard deviations they have, as in a set.
    """

    sampler: Sampler
    filters: Filters
    level: int

    @classmethod
    def of(
        cls,
        plan: Plan,
        check: CheckScenarios,
        config: SamplingConfig,
        seed: int,
        measures: Measures | None = None,
    ) -> "NaturalScenarios":
        """Prepare a template on its road, at the level that a set would use.

        Raises:
            RefusedError: no speed profile exists, or no candidate is valid.
        """
        built = build_model(plan, config)
        if built.model is None:
            raise RefusedError(built.refusal)
        sampler = Sampler(built.model, seed, plan.road.frame_id)
        validity = ValidityFilter.of(sampler, check, enough_share(config))
        rarity = None if measures is None else measures.rarity
        pilot = validity.pilot(sampler, rarity)
        if not pilot.valid:
            raise RefusedError(
                f"none of {PILOT_CANDIDATES * len(LEVELS)} candidates is valid, "
                "so there is nothing to search"
            )
        filters = Filters(validity, rarity=RarityFilter.of(rarity, pilot.valid))
        return cls(sampler, filters, pilot.level)

    @property
    def size(self) -> int:
        """Numbers of a scenario."""
        return self.sampler.model.size

    def scenarios(self, numbers: Floats) -> list[Scenario | None]:
        """Return certified scenarios of all vehicles; None where a candidate is refused.

        Args:
            numbers: (S, size) standard normal numbers.
        """
        batch = self.sampler.model.draw(numbers, LEVELS[self.level])
        index = [searched_index(row) for row in numbers]
        drawn = batch.scenarios(self.sampler.seed, index, self.sampler.frame_id)
        judged = self.filters.judged([Block(index, drawn)])
        return [each.scenario if each.cause is None else None for each in judged]
