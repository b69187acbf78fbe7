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

"""What one generation came to."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from scenario_gen.errors import InputError
from scenario_gen.types.coverage import Coverage
from scenario_gen.types.encounter import Encounter
from scenario_gen.types.evaluation import Evaluation
from scenario_gen.types.fit import Fit
from scenario_gen.types.road import Road
from scenario_gen.types.route import Route
from scenario_gen.types.scenario import Scenario, ScenarioSet
from scenario_gen.types.segmentation import Segmentation

WITH, WITHOUT, UNIFORM, ORACLE = "with changepoints", "without changepoints", "uniform changepoints", "oracle"
NARROW = "with changepoints, narrow"
"""Names of the rows of an evaluation: what was generated, and what it is measured against."""


@dataclass(frozen=True, eq=False)
class GenerationResult:
    """What was generated from one encounter on one road, from the first stage to the last that was run.

    Attributes:
        encounter: the recorded template.
        segmentation: its primitives.
        road: the target road, None if it is not known (a bag without a map).
        fit: the template on it, None if it is not known.
        routes: one for each vehicle, or none.
        generated: the valid scenarios, and the account of every candidate.
        seed: of the request.
        evaluation: of `generated`, `references` and `oracle`; without rows if they were not evaluated.
        references: sets made with other changepoints, by row: WITHOUT is the paper's ablation, UNIFORM as many evenly spaced,
            NARROW the same changepoints where `generated` is of preset `wide`, for E compares sets of one preset.
        refusals: why a reference is missing, by row.
        oracle: the fitted template replayed.
        row: name of the evaluation's row of `generated`.
        provenance: what is needed to make it again: log hashes, versions, parameters.
        coverage: what `generated` covers, None if it was not measured.
        valid: how many of those scenarios are valid, where all of a bag's are shown; None: all of them are.
    """

    encounter: Encounter
    segmentation: Segmentation
    road: Road | None
    fit: Fit | None
    routes: Sequence[Route]
    generated: ScenarioSet = ScenarioSet(0, (), 0)  # noqa: RUF009 - frozen
    seed: int = 0
    evaluation: Evaluation = Evaluation.empty()  # noqa: RUF009 - frozen
    references: Mapping[str, ScenarioSet] = field(default_factory=dict)
    refusals: Mapping[str, str] = field(default_factory=dict)
    oracle: Scenario | None = None
    row: str = WITH
    provenance: Mapping[str, str] = field(default_factory=dict)
    valid: int | None = None
    coverage: Coverage | None = None

    @property
    def similar_row(self) -> str:
        """Row of the set whose E is held against the references': all with preset `narrow`."""
        return NARROW if NARROW in self.references else self.row

    def placed(self) -> tuple[Road, Fit]:
        """Return road and fit.

        Raises:
            InputError: they are not known.
        """
        if self.road is None or self.fit is None:
            raise InputError(f"{self.title}: neither its road nor its fit may be missing here")
        return self.road, self.fit

    @property
    def title(self) -> str:
        """Encounter and road, as a heading."""
        return f"{self.encounter.name} on {self.road.name}" if self.road else self.encounter.name

    @property
    def published(self) -> int:
        """Number of valid scenarios."""
        return len(self.generated.scenarios) if self.valid is None else self.valid
