# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`coverage`: how well scenarios cover the recorded encounters, and its page."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from scenario_gen.bags.recordings.read import read_recording, result_in
from scenario_gen.base.errors import guarded
from scenario_gen.base.provenance import RECORDING
from scenario_gen.base.stores import each_fetched
from scenario_gen.corpus.encounters import encounter_of
from scenario_gen.corpus.page import curve, sketch, write_page
from scenario_gen.corpus.parts import recording_of
from scenario_gen.corpus.store import finished_tables
from scenario_gen.corpus.tables import rows_of
from scenario_gen.corpus.trajectories import read_trajectories
from scenario_gen.method.evaluation.population import GeneratedSet
from scenario_gen.method.evaluation.population_result import Population
from scenario_gen.types import Encounter, GenerationResult, Scenario

DRAWN_COUNT = 24  # unreached encounters on the page


@dataclass(frozen=True)
class StoredSet:
    """An encounter of a corpus or a batch, and scenarios from it."""

    encounter: Encounter
    scenarios: tuple[Scenario, ...] = ()

    def __iter__(self) -> Iterator[Scenario]:
        return iter(self.scenarios)


def results_of(sources: Sequence[Path]) -> Iterator[tuple[str, GeneratedSet]]:
    """Yield the results in bags, batches and corpora with the names of their recordings.

    A result without the name of its recording has the name of the bag.

    Raises:
        InputError: a bag or table cannot be read, or a bag has no scenarios.
    """
    for source in sources:
        tables = [*source.glob("templates/*.parquet"), *source.glob("encounters/*.parquet")]
        if tables:
            yield from _stored_sets(source, sorted(tables))
        else:
            yield from _results_in(source)


def _stored_sets(source: Path, tables: Sequence[Path]) -> Iterator[tuple[str, GeneratedSet]]:
    """Yield all encounters in tables, and then the scenarios of a batch with their encounters."""
    sets: dict[str, tuple[str, StoredSet]] = {}
    for table in tables:
        for row in rows_of([table]):
            sets[row["name"]] = recording_of(row), StoredSet(encounter_of(row, table))
    yield from sets.values()
    for place, path in each_fetched(finished_tables(source, "trajectories")):
        with guarded(f"{place} cannot be read as a table"):
            for template, scenario in read_trajectories(path):
                recording, empty = sets[template]
                yield recording, replace(empty, scenarios=(scenario,))


def _results_in(bag: Path) -> Iterator[tuple[str, GenerationResult]]:
    """Yield the results in a bag."""
    recording = read_recording(bag)
    for name in recording.results or [""]:
        result, namespace = result_in(recording, name), recording.namespaces[name]
        source = namespace.summaries[-1].provenance.get(RECORDING, "")
        template = next(
            (entry.status.values.get("template", "") for entry in namespace.entries), ""
        )
        encounter = replace(result.encounter, name=template or result.encounter.name)
        yield source or str(bag), replace(result, encounter=encounter)


def write_coverage(
    page: Path, results: Iterable[tuple[str, GeneratedSet]], population: Population
) -> None:
    """Write the page: the curve, the unreached encounters, and the most distant scenarios."""
    points = (*population.unreached[:DRAWN_COUNT], *population.farthest)
    drawn = {(point.encounter, point.scenario) for point in points}
    motions: dict[tuple[str, int], Encounter | Scenario] = {}
    for _, result in results:
        name = result.encounter.name
        known = {(name, -1): result.encounter} | {(name, each.index): each for each in result}
        motions |= {place: known[place] for place in known.keys() & drawn}
    cards = [
        {
            "title": "Coverage by number of templates",
            "lines": population.remarks()[:1],
            "pictures": [curve(population)],
        }
    ]
    for point in points:
        title = f"like nothing recorded: scenario {point.scenario} from {point.encounter}"
        if point.scenario < 0:
            title = f"not reached: {point.encounter}"
        line = f"{point.kind}, nearest at {point.distance:.1f} r, by {point.feature}"
        picture = sketch(motions[point.encounter, point.scenario])
        cards.append({"title": title, "lines": [line], "pictures": [picture]})
    write_page(page, "Coverage", population.lead, cards, population.remarks())
