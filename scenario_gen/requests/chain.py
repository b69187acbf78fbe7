# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""From a segmented template to its scenarios: fit, plan, sample, check; the ego left out, asked states met or refused."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

from scenario_gen.encounter import Encounter
from scenario_gen.errors import RefusedError
from scenario_gen.fitting import Fit, fit_template, FittingConfig
from scenario_gen.interaction import find_conflicts, find_waits, Wait
from scenario_gen.planning import plan_routes, PlanningConfig, Route
from scenario_gen.requests.asked import refuse_impossible, refuse_misfits
from scenario_gen.requests.request import Request
from scenario_gen.roads import Road
from scenario_gen.sampling import regenerate, sample_scenarios, SamplingConfig
from scenario_gen.sampling.ego import others
from scenario_gen.sampling.sample import Found
from scenario_gen.scenario import BoundaryStates, Scenario, ScenarioSet
from scenario_gen.segmentation import Segmentation
from scenario_gen.validity import Checker, Limits

Progress = Callable[[int, int, int], None]  # of scenarios so far, scenarios wanted, candidates so far
Cancelled = Callable[[], bool]


@dataclass(frozen=True, eq=False)
class Chain:
    """A segmented template, a road, and the parameters of all that follows; `seed` is that of planning and sampling.

    `holds_waits` is False for references that shall know of the template only what their own changepoints tell: they stand
    where one of their primitives stands, and no wait is asked of them.
    """

    encounter: Encounter
    segmentation: Segmentation
    road: Road
    seed: int
    fitting: FittingConfig = field(default_factory=FittingConfig)
    planning: PlanningConfig = field(default_factory=PlanningConfig)
    sampling: SamplingConfig = field(default_factory=SamplingConfig)
    limits: Limits = field(default_factory=Limits)
    holds_waits: bool = True

    def place(self, request: Request) -> tuple[Fit, tuple[Route, ...]]:
        """Fit the template to the road and plan its routes, from and to the states that are asked for.

        Raises:
            InputError: a vehicle that is named does not exist.
            RefusedError: it does not fit, there is no way, or a state cannot be had; the message says why.
        """
        if not request.moves:
            fit = fit_template(self.encounter, self.segmentation, self.road, self.fitting)
        else:
            starts, goals = (request.rows(end, self.encounter) for end in ("starts", "goals"))
            refuse_impossible(self.encounter, self.road, starts, goals, self.sampling.max_speed)
            fit = fit_template(
                self.encounter, self.segmentation, self.road, self.fitting, starts=starts, goals=goals, partial=True
            )
            refuse_misfits(fit, starts, goals)
        return fit, plan_routes(self.road, fit, self.planning, self.seed)

    def waits(self) -> tuple[Wait, ...]:
        """Return the template's waits if they are to hold; without changepoints there is no dwell to hold."""
        return find_waits(self.encounter) if self.holds_waits and self.segmentation.changepoints.size else ()

    def scenario(self, request: Request, routes: tuple[Route, ...], asked: BoundaryStates, index: int) -> Scenario | None:
        """Return the candidate with this index, bit for bit as in a whole set; None if it has no speed profile."""
        return regenerate(
            self.encounter,
            self.segmentation,
            self.road,
            routes,
            asked,
            self.sampling,
            seed=self.seed,
            index=index,
            waits=self.waits(),
            ego=request.ego_of(self.encounter),
        )

    def sample(
        self,
        request: Request,
        routes: tuple[Route, ...],
        asked: BoundaryStates,
        *,
        count: int,
        progress: Progress | None = None,
        cancelled: Cancelled | None = None,
        found: Found | None = None,
    ) -> ScenarioSet:
        """Sample candidates and publish those that the checker proves valid against the template's conflicts and waits.

        The ego takes part in neither. A segmentation without changepoints has no dwell to hold, so its waits are not asked
        for (method: the ablation).

        Raises:
            InputError: the ego does not exist, or routes and template disagree.
            RefusedError: states were asked for, and not one candidate that meets them is valid.
        """
        encounter, ego = self.encounter, request.ego_of(self.encounter)
        kept = others(encounter, ego)
        waits = self.waits()
        checker = Checker(
            self.road,
            BoundaryStates(asked.start[kept], asked.end[kept]),
            find_conflicts(
                tuple(encounter.vehicles[n] for n in kept), encounter.time, encounter.position[kept], encounter.heading[kept]
            ),
            [replace(wait, vehicle=kept.index(wait.vehicle)) for wait in waits if wait.vehicle != ego],
            self.limits,
        )
        made = sample_scenarios(
            encounter,
            self.segmentation,
            self.road,
            routes,
            asked,
            checker.check,
            self.sampling,
            count=count,
            seed=self.seed,
            waits=waits,
            ego=ego,
            progress=progress,
            cancelled=cancelled,
            found=found,
        )
        if request.moves and not made.scenarios and not (cancelled and cancelled()):
            causes = ", ".join(f"{number} × {cause.value}" for cause, number in made.refused.most_common())
            said = f"; {'; '.join(made.adaptations)}" if made.adaptations else ""
            raise RefusedError(f"none of {made.candidates} candidate(s) with the asked states is valid ({causes}{said})")
        return made
