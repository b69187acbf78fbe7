# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`coverage`: how well scenarios cover the recorded encounters, from bags, and its page."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from scenario_gen.bags.recordings.read import read_recording, result_in
from scenario_gen.base.provenance import RECORDING
from scenario_gen.corpus.page import curve, sketch, write_page
from scenario_gen.method.evaluation.population_result import Population
from scenario_gen.types import Encounter, GenerationResult, Scenario

DRAWN_COUNT = 24  # unreached encounters on the page


def results_of(bags: Sequence[Path]) -> list[tuple[str, GenerationResult]]:
    """Return the results in bags with the names of their recordings.

    A result without the name of its recording has the name of the bag.

    Raises:
        InputError: a bag cannot be read, or has no scenarios.
    """
    results = []
    for bag in bags:
        recording = read_recording(bag)
        for name in recording.results or [""]:
            result, namespace = result_in(recording, name), recording.namespaces[name]
            source = namespace.summaries[-1].provenance.get(RECORDING, "")
            template = next(
                (entry.status.values.get("template", "") for entry in namespace.entries), ""
            )
            encounter = replace(result.encounter, name=template or result.encounter.name)
            results.append((source or str(bag), replace(result, encounter=encounter)))
    return results


def write_coverage(
    page: Path, results: Sequence[tuple[str, GenerationResult]], population: Population
) -> None:
    """Write the page: the curve, the unreached encounters, and the most distant scenarios."""
    motions: dict[tuple[str, int], Encounter | Scenario] = {}
    for _, result in results:
        name = result.encounter.name
        motions[name, -1] = result.encounter
        motions |= {(name, scenario.index): scenario for scenario in result}
    cards = [
        {
            "title": "Coverage by number of templates",
            "lines": population.remarks()[:1],
            "pictures": [curve(population)],
        }
    ]
    for point in (*population.unreached[:DRAWN_COUNT], *population.farthest):
        title = f"like nothing recorded: scenario {point.scenario} from {point.encounter}"
        if point.scenario < 0:
            title = f"not reached: {point.encounter}"
        line = f"{point.kind}, nearest at {point.distance:.1f} r, by {point.feature}"
        picture = sketch(motions[point.encounter, point.scenario])
        cards.append({"title": title, "lines": [line], "pictures": [picture]})
    write_page(page, "Coverage", population.lead, cards, population.remarks())
