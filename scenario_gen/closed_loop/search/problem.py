# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A planner among the scenarios of one template; every drive is written to a journal."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from scenario_gen.base.errors import InputError
from scenario_gen.closed_loop.origin import Trial
from scenario_gen.closed_loop.search.journal import Journal
from scenario_gen.closed_loop.search.objective import Objective
from scenario_gen.closed_loop.search.response import Response
from scenario_gen.closed_loop.trials import RunTrials
from scenario_gen.method.evaluation import min_time_shift
from scenario_gen.method.sampling import NaturalScenarios
from scenario_gen.numerics import Floats
from scenario_gen.types import mask, Road, Scenario


@dataclass(eq=False)
class DrivenScenarios:
    """The problem of a search: candidates are scenarios, in which a planner replaces a vehicle.

    Attributes:
        natural: decodes numbers to scenarios.
        ego: id of the vehicle that the planner replaces.
        road: of the scenarios.
        objective: definition of a failure.
        run: drives trials.
        journal: of the drives.
        progress: called with the number of drives.
        driven: number of drives so far.
    """

    natural: NaturalScenarios
    ego: str
    road: Road
    objective: Objective
    run: RunTrials
    journal: Journal
    progress: Callable[[int], None] = lambda _: None
    driven: int = 0

    @property
    def size(self) -> int:
        """Number of standard normal numbers of a scenario."""
        return self.natural.size

    def candidates(self, z: Floats) -> list[Scenario | None]:
        """Return the certified scenarios of numbers (S, size), None for rejected ones."""
        return self.natural.scenarios(z)

    def features(self, candidate: Scenario) -> tuple[float, ...]:
        """Return the time shifts [s] to collisions of the witness, and its first speed [m/s]."""
        ids = [vehicle.id for vehicle in candidate.vehicles]
        ego = ids.index(self.ego)
        present = mask(candidate.present, len(candidate.time))
        shifts = (min_time_shift(candidate, present, ego, k) for k in range(len(ids)) if k != ego)
        return (*shifts, float(candidate.speed[ego, int(candidate.present[ego, 0])]))

    def drive(self, candidates: Sequence[Scenario]) -> list[Response]:
        """Drive in each candidate, unless the journal has its response."""
        first = self.driven
        known = self.journal.known[first : first + len(candidates)]
        results = list(known)
        numbered = list(enumerate(candidates, start=first))
        trials = [self.trial(number, scenario) for number, scenario in numbered[len(known) :]]
        for outcome in self.run(trials):
            if outcome.verdict.error:
                raise InputError(
                    f"drive {outcome.name}: the planner failed: {outcome.verdict.error}"
                )
            results.append(self.objective.response(outcome))
            self.journal.add(results[-1])
            self.progress(first + len(results))
        self.driven = first + len(candidates)
        return results

    def trial(self, number: int, scenario: Scenario) -> Trial:
        """Return the trial of a drive, counted from 0; its name counts from 1."""
        return Trial(str(number + 1), scenario, self.ego, self.road)
