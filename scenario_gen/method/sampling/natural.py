# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The distribution of a request's scenarios as a function of standard normal numbers, for who chooses the numbers himself."""

from dataclasses import dataclass

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.sampling.adapt import Check, Judge
from scenario_gen.method.sampling.config import SamplingConfig
from scenario_gen.method.sampling.plan import Plan
from scenario_gen.method.sampling.prepare import prepare
from scenario_gen.method.sampling.sampler import ENOUGH, LEVELS, Sampler, searched_index
from scenario_gen.method.sampling.usual import FEW, PILOT, pilot, Usual
from scenario_gen.numerics import Floats
from scenario_gen.types import Measures, Scenario


@dataclass(frozen=True, eq=False)
class NaturalScenarios:
    """Certified scenarios by their numbers; those of independent standard normal ones are natural.

    Attributes:
        sampler: draws candidates.
        judge: refuses them.
        level: whose standard deviations they have, as in a set.
        usual: refuses those that are rarer than what a set keeps.
    """

    sampler: Sampler
    judge: Judge
    level: int
    usual: Usual

    @classmethod
    def of(
        cls,
        plan: Plan,
        check: Check,
        config: SamplingConfig,
        seed: int,
        measures: Measures | None = None,
    ) -> "NaturalScenarios":
        """Prepare a template on its road; the level is the first of which enough candidates are valid, or the best.

        Raises:
            RefusedError: no speed profile exists, or no candidate is valid.
        """
        prepared = prepare(plan, config, "keep")
        if prepared.model is None:
            raise RefusedError(prepared.refusal)
        sampler = Sampler(prepared.model, seed, plan.road.frame_id)
        judge = Judge.of(sampler, check, ENOUGH[config.drawn.variety])
        rarity = None if measures is None else measures.rarity
        level, valid = pilot(sampler, judge, 0 if rarity is None else FEW)
        if not valid:
            raise RefusedError(
                f"none of {PILOT * len(LEVELS)} candidates is valid; there is nothing to search in"
            )
        return cls(
            sampler, judge, level, Usual() if rarity is None else Usual.among(rarity, valid)
        )

    @property
    def size(self) -> int:
        """Numbers of a scenario."""
        return self.sampler.model.size

    def scenarios(self, numbers: Floats) -> list[Scenario | None]:
        """Return the certified scenarios, of all vehicles, of numbers (S, size); None where a candidate is refused."""
        batch = self.sampler.model.draw(numbers, LEVELS[self.level])
        drawn = batch.scenarios(
            self.sampler.seed, [searched_index(row) for row in numbers], self.sampler.frame_id
        )
        causes = iter(self.judge([scenario for scenario in drawn if scenario is not None]))
        valid = [
            scenario if scenario is not None and next(causes) is None else None
            for scenario in drawn
        ]
        return [
            scenario if scenario is not None and self.usual(scenario) else None
            for scenario in valid
        ]
