# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Fit, plan and sample with given changepoints: for references and suggestions, which need no evaluation."""

from dataclasses import dataclass, replace

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.evaluation import MEASURED, MEASURES, replay, uniform_changepoints, without_changepoints
from scenario_gen.method.fitting import fit_template
from scenario_gen.method.routing import plan_routes
from scenario_gen.method.sampling import Callbacks, sample_scenarios
from scenario_gen.template import Wait
from scenario_gen.types import Encounter, GenerationResult, NARROW, Request, Road, Segmentation, UNIFORM, WITHOUT


@dataclass(frozen=True, eq=False)
class Attempt:
    """What the stages after the segmentation take.

    Attributes:
        encounter: the template.
        segmentation: its changepoints, found or given.
        road: the target.
        config: the parameters of every stage.
        request: what is requested.
        count: valid scenarios wanted.
        seed: of all randomness.
        waits: that scenarios keep; the template's if None.
    """

    encounter: Encounter
    segmentation: Segmentation
    road: Road
    config: PipelineConfig
    request: Request = Request()
    count: int = 50
    seed: int = 0
    waits: tuple[Wait, ...] | None = None

    def plan(self) -> GenerationResult:
        """Fit and plan: the template on its road, with no scenarios yet.

        Raises:
            InputError, RefusedError: as the stages.
        """
        config = self.config
        fit = fit_template(
            self.encounter, self.segmentation, self.road, config.fitting,
            request=self.request, max_speed=config.sampling.max_speed,
        )  # fmt: skip
        routes = plan_routes(self.road, fit, config.planning, self.seed)
        return GenerationResult(self.encounter, self.segmentation, self.road, fit, routes, seed=self.seed)

    def run(self, callbacks: Callbacks = Callbacks()) -> GenerationResult:
        """Fit, plan and sample.

        Raises:
            InputError, RefusedError: as the stages.
        """
        return self.sample(self.plan(), callbacks)

    def sample(self, planned: GenerationResult, callbacks: Callbacks = Callbacks()) -> GenerationResult:
        """Sample what was planned.

        Raises:
            InputError, RefusedError: as `sample_scenarios`.
        """
        return sample_scenarios(
            planned, self.config.sampling, self.config.limits, self.request,
            count=self.count, waits=self.waits, callbacks=callbacks, measures=MEASURES,
        )  # fmt: skip


def with_references(result: GenerationResult, config: PipelineConfig, request: Request = Request()) -> GenerationResult:
    """Add what a result is measured against: sets without changepoints and, if `evaluation.uniform`, with uniform ones.

    They are drawn as the result is, with the same parameters and seed; beside preset `wide` there is a set of `narrow`, too.
    A reference keeps no waits of the template: the ends of a wait would be two more changepoints. It has no target, choice or
    order either, and a result that has one is not compared. A reference has only as many scenarios as are measured.
    """
    road, fit = result.placed()
    count = min(result.generated.requested, MEASURED)
    plain = Attempt(result.encounter, result.segmentation, road, config, request.plain, count, result.seed)
    attempts = {WITHOUT: replace(plain, segmentation=without_changepoints(result.segmentation), waits=())}
    if config.evaluation.uniform and result.segmentation.changepoints.size:
        attempts[UNIFORM] = replace(plain, segmentation=uniform_changepoints(result.segmentation), waits=())
    if config.sampling.variety == "wide":
        narrow = replace(config, sampling=replace(config.sampling, variety="narrow"))
        attempts[NARROW] = replace(plain, config=narrow)
    references, refusals = {}, {}
    for name, attempt in attempts.items():
        try:
            references[name] = (attempt.sample(result) if name == NARROW else attempt.run()).generated
        except RefusedError as error:
            refusals[name] = str(error)
    oracle = replay(result.encounter, fit, road.frame_id)
    requested = [name for name in ("target", "choose", "order") if getattr(request, name) != getattr(request.plain, name)]
    apart = f"only the delivered set was drawn with {' and '.join(requested)} as asked" if requested else ""
    return replace(result, references=references, refusals=refusals, oracle=oracle, apart=apart)
