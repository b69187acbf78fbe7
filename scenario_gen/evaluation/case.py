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

"""One encounter on one road, and what came of it."""

from collections.abc import Sequence
from dataclasses import dataclass

from scenario_gen.encounter import Encounter
from scenario_gen.evaluation.result import Evaluation
from scenario_gen.fitting.result import Fit
from scenario_gen.planning.route import Route
from scenario_gen.roads.road import Road
from scenario_gen.scenario import Scenario, ScenarioSet
from scenario_gen.segmentation.result import Segmentation

WITH, WITHOUT, UNIFORM, ORACLE = "with changepoints", "without changepoints", "uniform changepoints", "oracle"
"""Names of the rows that the report looks for in an evaluation."""


@dataclass(frozen=True, eq=False)
class Case:
    """One encounter on one road.

    Attributes:
        encounter: the recorded template.
        segmentation: its primitives.
        road: the target road, None if it is not known (a bag without a map).
        fit: the template on it, None if it is not known.
        routes: one for each vehicle, or none.
        with_changepoints: what was generated.
        without_changepoints: the paper's ablation, None if it was refused.
        evaluation: of these sets.
        oracle: the fitted template replayed.
        without_refused: why there is no ablation.
        uniform: generated with as many changepoints, evenly spaced in time; None if not asked for or refused.
        uniform_refused: why it was refused, "" if it was not.
        row: name of the evaluation's row of `with_changepoints`.
        valid: how many of those scenarios are valid, where all of a bag's are shown; None: all of them are.
    """

    encounter: Encounter
    segmentation: Segmentation
    road: Road | None
    fit: Fit | None
    routes: Sequence[Route]
    with_changepoints: ScenarioSet
    without_changepoints: ScenarioSet | None
    evaluation: Evaluation
    oracle: Scenario | None = None
    without_refused: str = ""
    uniform: ScenarioSet | None = None
    uniform_refused: str = ""
    row: str = WITH
    valid: int | None = None

    @property
    def title(self) -> str:
        """Encounter and road, as a heading."""
        return f"{self.encounter.name} on {self.road.name}" if self.road else self.encounter.name

    @property
    def published(self) -> int:
        """Number of valid scenarios."""
        return len(self.with_changepoints.scenarios) if self.valid is None else self.valid
