# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The evaluation of any bag that keeps the conventions of the suite, ours or not."""

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from itertools import count
from pathlib import Path

import numpy as np

from scenario_gen.bags.recordings.read import Namespace, NO_ENTRY, read_recording, SCENARIOS
from scenario_gen.bags.storage.bag import naming_bag
from scenario_gen.bags.storage.config import BagConfig
from scenario_gen.base.errors import InputError
from scenario_gen.base.folders import replaced_folder
from scenario_gen.method.evaluation import coverage_of, evaluate_scenarios, EvaluationConfig
from scenario_gen.method.validity import Limits
from scenario_gen.output.results import EVALUATED, write_evaluation
from scenario_gen.output.review.validation import Checkers, kept_reactions
from scenario_gen.situation import Situation
from scenario_gen.types import (
    CheckCounts,
    EgoSlot,
    GenerationResult,
    join_ego,
    Note,
    NoteKind,
    ScenarioSet,
    Verdict,
    WITHOUT,
)


def bag_results(
    path: Path,
    config: EvaluationConfig | None = None,
    limits: Limits | None = None,
    seed: int = 0,
    bag: BagConfig = BagConfig(),
    *,
    progress: Callable[[int, int], None] = lambda *_: None,
) -> tuple[GenerationResult, ...]:
    """Evaluate every namespace of a bag that holds both `tracks` and `scenarios`, ready for the report.

    The scenarios are checked again, on the bag's map if it has one, but not for start and end states. What the bag lacks is
    left out: without `changepoints` K counts as 0; fit and routes are shown if both are there, with what the fitting decided.
    `progress` is called with the number of scenarios checked, and of all.

    Raises:
        InputError: the bag is missing or damaged, or no namespace has both topics.
    """
    namespaces = read_recording(path, bag).namespaces.values()
    complete = [
        namespace for namespace in namespaces if {"tracks", SCENARIOS} <= namespace.messages.keys()
    ]
    if not complete:
        raise InputError(
            f"{path}: no namespace holds both `tracks` and `scenarios`; there is nothing to compare"
        )
    with naming_bag(path):
        total, done = sum(len(namespace.hashes) for namespace in complete), count(1)

        def tick() -> None:
            progress(next(done), total)

        return tuple(
            _result(namespace, config or EvaluationConfig(), limits, seed, tick)
            for namespace in complete
        )


def write_page(
    bag: Path, folder: Path, *, progress: Callable[[int, int], None] = lambda *_: None
) -> None:
    """Write the report of a bag; `progress` as of `bag_results`.

    Raises:
        InputError: the bag is damaged, or the folder may not be replaced.
    """
    with replaced_folder(folder, EVALUATED, [bag]) as place:
        write_evaluation(place, bag_results(bag, progress=progress), bag, BagConfig())


def _result(
    namespace: Namespace,
    config: EvaluationConfig,
    limits: Limits | None,
    seed: int,
    tick: Callable[[], None],
) -> GenerationResult:
    encounter, segmentation, road = namespace.encounter, namespace.segmentation, namespace.road
    fit, routes = namespace.fit
    situation = Situation.of(encounter)
    graph = situation.reactions
    checkers, scenarios, verdicts = Checkers(namespace, limits), [], list[Verdict]()
    for k in range(len(namespace.hashes)):
        stamp, scenario = namespace.scenario(k)
        whole = join_ego(scenario)
        verdicts += checkers.of(k, stamp, whole, None).check([whole])
        scenarios.append(scenario)
        tick()
    counts = CheckCounts.of_verdicts(verdicts)
    evaluation = evaluate_scenarios(
        encounter,
        {SCENARIOS: tuple(scenarios)},
        changepoints=len(segmentation.changepoints),
        checks={SCENARIOS: counts},
        road=road.name if road else "",
        config=config,
        seed=seed,
    )
    notes = [Note.of(NoteKind.TEXT, text=text) for text in namespace.missing]
    lost = sum(entry is None for entry in namespace.unknown.values())
    if lost:
        total = len(scenarios)
        notes.append(Note.of(NoteKind.UNACCOUNTED, count=lost, total=total, reason=NO_ENTRY))
    rows = [
        replace(row, notes=(*row.notes, *notes)) if row.name == SCENARIOS else row
        for row in evaluation.rows
    ]
    evaluation = replace(evaluation, rows=tuple(rows))
    ego = None
    witness = next(
        (
            scenario.reference_drive
            for scenario in scenarios
            if scenario.reference_drive is not None
        ),
        None,
    )
    if witness is not None:
        first, last = (
            np.array([*witness.position[0, k], witness.heading[0, k], witness.speed[0, k]])
            for k in (0, -1)
        )
        ego = EgoSlot(witness.vehicles[0], first, last)
    held = [kept_reactions(situation, namespace.entry(k)) for k in range(len(scenarios))]
    generated = ScenarioSet(
        len(scenarios), tuple(scenarios), counts.candidates, Counter(counts.refused), _left_out(namespace), ego,
        reactions=tuple(edge for edge in graph.edges if all(edge in kept for kept in held)), graph=graph,
    )  # fmt: skip
    return GenerationResult(
        encounter,
        segmentation,
        road,
        fit=fit,
        routes=routes,
        generated=generated,
        evaluation=evaluation,
        refusals={WITHOUT: "the bag holds one set of scenarios"},
        row_name=SCENARIOS,
        valid=counts.candidates - sum(counts.refused.values()),
        coverage=coverage_of(encounter, scenarios),
    )


def _left_out(namespace: Namespace) -> tuple[Note, ...]:
    """Return notes on the checks that a bag lacks data for, and on the outcomes of its requests."""
    notes = [Note.of(NoteKind.BAG_MEASURED)]
    if "map" not in namespace.messages:
        notes.append(Note.of(NoteKind.BAG_WITHOUT_MAP))
    if "changepoints" not in namespace.messages:
        notes.append(Note.of(NoteKind.BAG_WITHOUT_CHANGEPOINTS))
    outcomes = (summary.sentence() for summary in namespace.summaries)
    return (*notes, *(Note.of(NoteKind.TEXT, text=text) for text in outcomes))
