# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`coverage`: what recordings and the scenarios generated from them stand for, from bags, and its page."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from scenario_gen.bags.recordings.read import read_recording, result_in
from scenario_gen.base.provenance import RECORDING
from scenario_gen.corpus.page import curve, sketch, write_page
from scenario_gen.method.evaluation.population import Population
from scenario_gen.types import GenerationResult

LOG = "log "  # begins the names of logs in the provenance of a bag
DRAWN = 24  # encounters that are never reached, on the page


def results_of(bags: Sequence[Path]) -> list[tuple[str, GenerationResult]]:
    """Return the results in bags, each with the name of its recording: its logs, or the bag where it names none.

    Raises:
        InputError: a bag cannot be read, or holds no scenarios.
    """
    results = []
    for bag in bags:
        recording = read_recording(bag)
        logs = ", ".join(sorted(key.removeprefix(LOG) for key in recording.provenance if key.startswith(LOG)))
        for name in recording.results or [""]:
            result, namespace = result_in(recording, name), recording.namespaces[name]
            own = namespace.summaries[-1].provenance.get(RECORDING, "")
            called = next((entry.status.values.get("template", "") for entry in namespace.entries), "")
            encounter = replace(result.encounter, name=called or result.encounter.name)
            results.append((" of ".join(filter(None, (own, logs))) or str(bag), replace(result, encounter=encounter)))
    return results


def write_coverage(page: Path, results: Sequence[tuple[str, GenerationResult]], found: Population) -> None:
    """Write the page: the curve, and the encounters that are never reached."""
    encounters = {result.encounter.name: result.encounter for _, result in results}
    cards = [{"title": "Coverage by number of templates", "lines": found.remarks()[:1], "pictures": [curve(found)]}]
    cards += [
        {
            "title": f"not reached: {one.encounter}",
            "lines": [f"{one.kind}, nearest at {one.distance:.1f} r, by {one.feature}"],
            "pictures": [sketch(encounters[one.encounter])],
        }
        for one in found.unreached[:DRAWN]
    ]
    write_page(page, "Coverage", found.lead, cards, found.remarks())
