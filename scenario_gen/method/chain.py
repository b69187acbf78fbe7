# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""All stages but the evaluation; those after the segmentation can be repeated with changes."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.continuation import driven_on
from scenario_gen.method.evaluation import measures_in
from scenario_gen.method.fitting import fit_template
from scenario_gen.method.routing import plan_routes
from scenario_gen.method.sampling import Callbacks, Plan, sample_scenarios
from scenario_gen.method.segmentation import segment
from scenario_gen.roads import road_and_template
from scenario_gen.situation import Situation, Wait
from scenario_gen.types import (
    causes_in_words,
    Encounter,
    GenerationResult,
    Request,
    Road,
    Segmentation,
)


@dataclass(frozen=True, eq=False)
class Chain:
    """The input of the stages after the segmentation.

    Attributes:
        situation: the template's.
        segmentation: its changepoints.
        road: the target.
        config: the parameters of every stage.
        request: what is requested.
        count: valid scenarios wanted.
        seed: of all randomness.
        waits: that scenarios keep; the template's if None.
        population: recorded encounters that show how encounters differ.
    """

    situation: Situation
    segmentation: Segmentation
    road: Road
    config: PipelineConfig
    request: Request = Request()
    count: int = 50
    seed: int = 0
    waits: tuple[Wait, ...] | None = None
    population: Sequence[Encounter] = ()

    @property
    def encounter(self) -> Encounter:
        """The template."""
        return self.situation.encounter

    def plan(self) -> GenerationResult:
        """Fit and plan; the result has no scenarios yet.

        Raises:
            InputError, RefusedError: as the stages.
        """
        config, limits = self.config, self.config.limits
        fit = fit_template(
            self.situation,
            self.segmentation,
            self.road,
            config.fitting,
            request=self.request,
            limits=limits,
        )
        routes = plan_routes(self.road, fit, config.planning, self.seed, limits)
        return GenerationResult(
            self.encounter, self.segmentation, self.road, fit, routes, seed=self.seed
        )

    def sample(
        self, planned: GenerationResult, callbacks: Callbacks = Callbacks()
    ) -> GenerationResult:
        """Add scenarios to a planned template.

        Raises:
            InputError, RefusedError: as `sample_scenarios`.
        """
        config = self.config
        stage = (planned, config.sampling, config.limits, self.request)
        return sample_scenarios(
            *stage,
            count=self.count,
            plan=Plan.of(*stage, self.waits, self.situation),
            callbacks=callbacks,
            measures=measures_in(config.sampling.drivers, self.encounter, self.population),
        )

    def run(self, callbacks: Callbacks = Callbacks()) -> GenerationResult:
        """Fit, plan and sample.

        Raises:
            InputError, RefusedError: as the stages.
        """
        return self.sample(self.plan(), callbacks)


class EmptySetError(RefusedError):
    """No candidate is valid; `result` has the account of the candidates."""

    def __init__(self, message: str, result: GenerationResult) -> None:
        super().__init__(message)
        self.result = result


class Planned(NamedTuple):
    """A template that is fitted and planned on a road.

    Attributes:
        chain: the input of the stages.
        result: the template on the road, without scenarios.
    """

    chain: Chain
    result: GenerationResult

    def sample(self, count: int, callbacks: Callbacks = Callbacks()) -> GenerationResult:
        """Add scenarios.

        Raises:
            InputError, RefusedError: as `sample_scenarios`.
            EmptySetError: there is none; the message has the causes of all refusals and the notes.
        """
        result = replace(self.chain, count=count).sample(self.result, callbacks)
        if not len(result):
            generated = result.generated
            refused = causes_in_words(generated.refused)
            causes = ", ".join(f"{number} × {cause}" for cause, number in refused)
            reasons = "; ".join((causes or "none was drawn", *map(str, generated.adaptations)))
            message = f"none of {generated.candidates} candidates is valid: {reasons}"
            raise EmptySetError(message, result)
        return result


def plan_set(
    encounter: Encounter,
    road: Road | Path | str,
    *,
    config: PipelineConfig,
    seed: int,
    request: Request = Request(),
    population: Sequence[Encounter] = (),
) -> Planned:
    """Return a template that is fitted and planned on a road.

    Raises:
        InputError, RefusedError: as the stages.
    """
    encounter, notes = driven_on(encounter)
    road, encounter = road_and_template(road, encounter, config.road)
    segmentation = segment(encounter, config.segmentation, seed)
    situation = Situation.of(encounter)
    chain = Chain(situation, segmentation, road, config, request, seed=seed, population=population)
    planned = chain.plan()
    _, fit = planned.road_and_fit()
    return Planned(chain, replace(planned, fit=replace(fit, notes=(*notes, *fit.notes))))
