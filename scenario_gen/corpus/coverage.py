# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`coverage`: what recordings and the scenarios generated from them stand for, from bags, and its page."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from scenario_gen.bags.recordings.read import read_recording, result_in
from scenario_gen.base.provenance import RECORDING
from scenario_gen.corpus.page import curve, sketch, write_page
from scenario_gen.method.evaluation.population_result import Population
from scenario_gen.types import Encounter, GenerationResult, Scenario

DRAWN = 24  # encounters that are never reached, on the page


def results_of(bags: Sequence[Path]) -> list[tuple[str, GenerationResult]]:
    """Return the results in bags, each with the name of its recording, or of the bag where it names none.

    Raises:
        InputError: a bag cannot be read, or holds no scenarios.
    """
    results = []
    for bag in bags:
        recording = read_recording(bag)
        for name in recording.results or [""]:
            result, namespace = result_in(recording, name), recording.namespaces[name]
            own = namespace.summaries[-1].provenance.get(RECORDING, "")
            called = next(
                (entry.status.values.get("template", "") for entry in namespace.entries), ""
            )
            encounter = replace(result.encounter, name=called or result.encounter.name)
            results.append((own or str(bag), replace(result, encounter=encounter)))
    return results


def write_coverage(
    page: Path, results: Sequence[tuple[str, GenerationResult]], found: Population
) -> None:
    """Write the page: the curve, the encounters that are never reached, and the scenarios that are like none."""
    own: dict[tuple[str, int], Encounter | Scenario] = {}
    for _, result in results:
        name = result.encounter.name
        own |= {
            (name, -1): result.encounter,
            **{(name, scenario.index): scenario for scenario in result},
        }
    cards = [
        {
            "title": "Coverage by number of templates",
            "lines": found.remarks()[:1],
            "pictures": [curve(found)],
        }
    ]
    for one in (*found.unreached[:DRAWN], *found.farthest):
        title = (
            "not reached:"
            if one.scenario < 0
            else f"like nothing recorded: scenario {one.scenario} of"
        )
        line = f"{one.kind}, nearest at {one.distance:.1f} r, by {one.feature}"
        picture = sketch(own[one.encounter, one.scenario])
        cards.append({"title": f"{title} {one.encounter}", "lines": [line], "pictures": [picture]})
    write_page(page, "Coverage", found.lead, cards, found.remarks())
