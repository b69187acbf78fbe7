# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What one generation came to."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from html import escape
from pathlib import Path
from typing import Any, TYPE_CHECKING

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.base.folders import scratch
from scenario_gen.types.coverage import Coverage
from scenario_gen.types.encounter import Encounter
from scenario_gen.types.evaluation import Evaluation, finite, REPLAY, WITH
from scenario_gen.types.fit import Fit, Route, Segmentation
from scenario_gen.types.html import html_list
from scenario_gen.types.notes import Note, NoteKind
from scenario_gen.types.road import Road
from scenario_gen.types.scenario import (
    BoundaryStates,
    causes_in_words,
    dataframe,
    Scenario,
    ScenarioSet,
)
from scenario_gen.types.vehicle import Vehicle

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame

ERRORS = {"e_position": "position", "e_speed": "speed", "e_heading": "heading"}
"""The figures of likeness, and what they are of."""


@dataclass(frozen=True, eq=False)
class Planned:
    """A template that is placed on a road and planned there.

    Attributes:
        encounter: the template.
        segmentation: its primitives.
        road: the target road.
        fit: the template on it.
        routes: one for each vehicle.
        seed: of the scenarios.
    """

    encounter: Encounter
    segmentation: Segmentation
    road: Road
    fit: Fit
    routes: Sequence[Route]
    seed: int = 0

    @property
    def title(self) -> str:
        """Encounter and road, as a heading."""
        return f"{self.encounter.name} on {self.road.name}"

    def with_scenarios(
        self, generated: ScenarioSet, requested: BoundaryStates
    ) -> "GenerationResult":
        """Return the result with scenarios, and the states that were requested of them."""
        return GenerationResult(
            self.encounter,
            self.segmentation,
            self.road,
            replace(self.fit, requested=requested),
            self.routes,
            generated,
            self.seed,
        )


@dataclass(frozen=True, eq=False)
class GenerationResult:
    """The results of all stages that were run for one encounter on one road.

    Attributes:
        encounter: the recorded template.
        segmentation: its primitives.
        road: the target road, None if it is not known (a bag without a map).
        fit: the template on it, None if it is not known.
        routes: one for each vehicle, or none.
        generated: the valid scenarios, and the account of every candidate.
        seed: of the request.
        figures: the evaluation of `generated` and `replay`, or a function that computes it when
            `evaluation` is first read; without rows if they are not evaluated.
        replay: the recording as fitted to the road, replayed.
        row_name: that of the evaluation's row of `generated`.
        provenance: what is needed to make it again: log hashes, versions, parameters.
        covered: the coverage of `generated`, or a function that measures it when `coverage` is
            first read; None if it is not measured.
        valid: how many of those scenarios are valid, where all of a bag's are shown; None: all of
            them are.
    """

    encounter: Encounter
    segmentation: Segmentation
    road: Road | None
    fit: Fit | None
    routes: Sequence[Route]
    generated: ScenarioSet = ScenarioSet(0, (), 0)
    seed: int = 0
    figures: "Evaluation | Callable[[GenerationResult], Evaluation]" = Evaluation.empty()
    replay: Scenario | None = None
    row_name: str = WITH
    provenance: Mapping[str, str] = field(default_factory=dict)
    valid: int | None = None
    covered: "Coverage | Callable[[GenerationResult], Coverage] | None" = None

    @cached_property
    def evaluation(self) -> Evaluation:
        """How similar to the recording and how critical the scenarios are."""
        return self.figures if isinstance(self.figures, Evaluation) else self.figures(self)

    @cached_property
    def coverage(self) -> Coverage | None:
        """Which criticality and manoeuvres the scenarios have; None if it was not measured."""
        return self.covered(self) if callable(self.covered) else self.covered

    def __repr__(self) -> str:
        road = self.road.name if self.road is not None else "no road"
        vehicles = f"{len(self.encounter.vehicles)} vehicles, {self.encounter.duration:.1f} s"
        sizes = f"{len(self)} of {self.generated.candidates} candidates"
        return f"GenerationResult({sizes}, {road}, {vehicles}, seed {self.seed})"

    def __eq__(self, other: object) -> bool:
        """Return whether both have the same scenarios, from the same encounter with one seed."""
        if not isinstance(other, GenerationResult):
            return NotImplemented
        same = (self.seed, self.encounter.name, len(self)) == (
            other.seed,
            other.encounter.name,
            len(other),
        )
        return same and all(map(np.array_equal, self, other))

    def __hash__(self) -> int:
        return hash((self.seed, self.encounter.name, len(self)))

    def __len__(self) -> int:
        return len(self.generated)

    @property
    def scenarios(self) -> Sequence[Scenario]:
        """The generated scenarios, which the result also has as a sequence."""
        return self.generated.scenarios

    def __iter__(self) -> Iterator[Scenario]:
        return iter(self.generated)

    def __getitem__(self, k: int) -> Scenario:
        return self.generated[k]

    def __add__(self, other: "GenerationResult") -> "GenerationResult":
        """Return the scenarios of both, numbered from 0; figures of whole sets are left out.

        Raises:
            InputError: encounter or road differ.
        """
        if not isinstance(other, GenerationResult):
            return NotImplemented
        is_same = np.array_equal(self.encounter.position, other.encounter.position)
        if self.title != other.title or not is_same:
            raise InputError(
                f"{self.title} and {other.title} cannot be added: encounter and road must be the "
                "same. report(folder, first, second) shows several results on one page"
            )
        first, second = self.generated, other.generated
        scenarios = [
            replace(scenario, index=k, seed=self.seed)
            for k, scenario in enumerate((*first, *second))
        ]
        generated = replace(
            first,
            requested=first.requested + second.requested,
            scenarios=scenarios,
            candidates=first.candidates + second.candidates,
            refused=first.refused + second.refused,
        )
        return replace(self.with_scenarios(generated), provenance={})

    def with_scenarios(self, generated: ScenarioSet) -> "GenerationResult":
        """Return the result with another set, without the figures of the whole set."""
        return replace(
            self,
            generated=generated,
            figures=Evaluation.empty(),
            covered=None,
            valid=None,
        )

    def noted(self, note: Note) -> "GenerationResult":
        """Return the result with a note in front of the others."""
        return replace(
            self,
            generated=replace(self.generated, adaptations=(note, *self.generated.adaptations)),
        )

    def to_dataframe(self) -> "DataFrame":
        """Return all scenarios as one table, with the columns of `Scenario.to_dataframe`."""
        return dataframe(self)

    def _repr_html_(self) -> str:
        """Return the same for a notebook, with who reacts to whom and what was refused."""
        refused = (
            ", ".join(
                f"{count} {cause}" for cause, count in causes_in_words(self.generated.refused)
            )
            or "none"
        )
        lines = [
            *self.reacting["sentences"],
            f"refused candidates: {refused}",
            *map(str, self.generated.adaptations),
        ]
        return f"<b>{escape(repr(self))}</b>{html_list(lines)}"

    def measures(self) -> "DataFrame":
        """Return how critical each scenario is, as `scenario_gen.measures` does."""
        import scenario_gen

        return scenario_gen.measures(self)

    def filter(self, condition: str) -> "GenerationResult":
        """Return the result with the scenarios that meet a condition, see `filter_scenarios`.

        Raises:
            InputError: the condition cannot be evaluated.
        """
        import scenario_gen

        return scenario_gen.filter_scenarios(self, condition)

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw all scenarios on their road, as `scenario_gen.plot` does.

        Raises:
            MissingExtraError: matplotlib is not installed.
        """
        import scenario_gen

        return scenario_gen.plot(self, ax)

    def animate(self, file: Path | str, k: int = 0) -> Path:
        """Write an animated GIF of scenario k on its road, as `scenario_gen.animate` does.

        Raises:
            MissingExtraError: matplotlib is not installed.
        """
        import scenario_gen

        return scenario_gen.animate(self[k], file, road=self.road)

    def export(self, folder: Path | str, target: str) -> Path:
        """Write files for other software to a folder, as `scenario-gen export` does.

        Args:
            folder: an earlier export in it is replaced.
            target: "commonroad", "openscenario", "autoware", "scenarionet", "csv", "parquet" or a
                plugin's name.

        Raises:
            InputError: there is no such target, or the folder is something else.
            RefusedError: no scenario can be written in that format.
        """
        import scenario_gen

        with scratch() as place:
            scenario_gen.export_bag(self.save(place / "bag"), Path(folder), target)
        return Path(folder)

    def report(self, target: Path | str) -> Path:
        """Write page, bag and figures to a folder, or a page .html, as `scenario_gen.report` does.

        Raises:
            InputError: the folder has other contents, or the page exists.
        """
        import scenario_gen

        return scenario_gen.report(target, self)

    def save(self, target: Path | str) -> Path:
        """Write the result to a bag, or to a file .mcap, .csv or .parquet, as `scenario_gen.save`.

        `scenario_gen.load` reads bags and .mcap files.

        Raises:
            InputError: the folder has other contents, or the file exists.
            MissingExtraError: pyarrow, which writes .parquet, is not installed.
        """
        import scenario_gen

        return scenario_gen.save(self, target)

    def similarity(self) -> dict[str, dict[str, float | None]]:
        """Return E of `generated` and of the replay by row and metric; None where unknown."""
        return {
            row: {metric: finite(self.evaluation.value(row, metric)) for metric in ERRORS}
            for row in (self.row_name, REPLAY)
            if self.evaluation.row(row) is not None
        }

    def road_and_fit(self) -> tuple[Road, Fit]:
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
    def vehicles(self) -> tuple[Vehicle, ...]:
        """The recorded vehicles; a scenario has its own, e.g. of other lengths."""
        return self.encounter.vehicles

    @property
    def kind(self) -> str:
        """What the first two vehicles of the recording do, as in `Encounter.kind`."""
        return self.encounter.kind

    @property
    def reactions(self) -> tuple[str, ...]:
        """Who reacts to whom, in sentences."""
        return tuple(self.reacting["sentences"])

    @property
    def reacting(self) -> dict[str, Any]:
        """Who reacts to whom in the template, and what the scenarios keep of it, as a document."""
        graph, vehicles = self.generated.graph, self.encounter.vehicles
        return (
            {"edges": [], "cut": [], "sentences": []}
            if graph is None
            else graph.document(vehicles, self.generated.reactions)
        )

    @property
    def losses(self) -> tuple[str, ...]:
        """What of the recording the road does not allow, in sentences."""
        return tuple(loss.message for loss in self.fit.losses) if self.fit else ()

    @property
    def route_remarks(self) -> tuple[str, ...]:
        """What is unusual about the routes, in sentences."""
        vehicles = zip(self.encounter.vehicles, self.routes, strict=True) if self.routes else ()
        return tuple(remark for vehicle, route in vehicles for remark in route.remarks(vehicle.id))

    @property
    def lost_reactions(self) -> tuple[str, ...]:
        """Which reactions of the template the scenarios could not keep, in sentences."""
        return tuple(
            str(note) for note in self.generated.adaptations if note.kind is NoteKind.REACTION_LOST
        )

    @property
    def published(self) -> int:
        """Number of valid scenarios."""
        return len(self.generated.scenarios) if self.valid is None else self.valid
