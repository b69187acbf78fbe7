# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Evaluation of any bag that has the conventions of the suite."""

from collections import Counter
from collections.abc import Callable, Sequence
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
    Evaluation,
    GenerationResult,
    join_ego,
    Note,
    NoteKind,
    Scenario,
    ScenarioSet,
    Verdict,
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
    """Evaluate every namespace of a bag that has `tracks` and `scenarios`, for the report.

    The scenarios are checked again, on the bag's map if it has one, but not for the requested
    boundary states. Data that the bag lacks are left out: without `changepoints`, K is 0; fit and
    routes are shown if both are present.

    Args:
        path: the bag.
        config: parameters of the evaluation.
        limits: limits of validity.
        seed: seed of the confidence intervals.
        bag: limits on the size of the bag.
        progress: called with the number of checked scenarios and their total.

    Raises:
        InputError: the bag is missing or damaged, or no namespace has both topics.
    """
    namespaces = read_recording(path, bag).namespaces.values()
    complete = [
        namespace for namespace in namespaces if {"tracks", SCENARIOS} <= namespace.messages.keys()
    ]
    if not complete:
        raise InputError(
            f"{path}: no namespace has both `tracks` and `scenarios`: nothing to compare"
        )
    with naming_bag(path):
        total = sum(len(namespace.hashes) for namespace in complete)
        done = count(1)
        return tuple(
            _result(
                namespace,
                config or EvaluationConfig(),
                limits,
                seed,
                lambda: progress(next(done), total),
            )
            for namespace in complete
        )


def write_page(
    bag: Path, folder: Path, *, progress: Callable[[int, int], None] = lambda *_: None
) -> None:
    """Write the report on a bag; `progress` as in `bag_results`.

    Raises:
        InputError: the bag is damaged, or the folder must not be replaced.
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
    """Check and evaluate the scenarios of a namespace."""
    encounter, segmentation, road = namespace.encounter, namespace.segmentation, namespace.road
    fit, routes = namespace.fit
    situation = Situation.of(encounter)
    scenarios, counts = _checked(namespace, limits, tick)
    evaluation = evaluate_scenarios(
        encounter,
        {SCENARIOS: scenarios},
        changepoints=len(segmentation.changepoints),
        checks={SCENARIOS: counts},
        road=road.name if road else "",
        config=config,
        seed=seed,
    )
    kept = [kept_reactions(situation, namespace.entry(k)) for k in range(len(scenarios))]
    graph = situation.reactions
    generated = ScenarioSet(
        len(scenarios),
        scenarios,
        counts.candidates,
        Counter(counts.refused),
        _remarks(namespace),
        _ego_slot(scenarios),
        reactions=tuple(edge for edge in graph.edges if all(edge in edges for edges in kept)),
        graph=graph,
    )
    return GenerationResult(
        encounter,
        segmentation,
        road,
        fit=fit,
        routes=routes,
        generated=generated,
        figures=_with_notes(evaluation, namespace, len(scenarios)),
        row_name=SCENARIOS,
        valid=counts.candidates - sum(counts.refused.values()),
        coverage=coverage_of(encounter, scenarios),
    )


def _checked(
    namespace: Namespace, limits: Limits | None, tick: Callable[[], None]
) -> tuple[tuple[Scenario, ...], CheckCounts]:
    """Return the scenarios of a namespace and the counts of their checks."""
    checkers = Checkers(namespace, limits)
    scenarios: list[Scenario] = []
    verdicts: list[Verdict] = []
    for k in range(len(namespace.hashes)):
        stamp, scenario = namespace.scenario(k)
        joined = join_ego(scenario)
        verdicts += checkers.of(k, stamp, joined, None).check([joined])
        scenarios.append(scenario)
        tick()
    return tuple(scenarios), CheckCounts.of_verdicts(verdicts)


def _ego_slot(scenarios: Sequence[Scenario]) -> EgoSlot | None:
    """Return the ego slot of a set, from its first reference drive; None without one."""
    for scenario in scenarios:
        drive = scenario.reference_drive
        if drive is not None:
            states = np.column_stack([drive.position[0], drive.heading[0], drive.speed[0]])
            return EgoSlot(drive.vehicles[0], states[0], states[-1])
    return None


def _with_notes(evaluation: Evaluation, namespace: Namespace, total: int) -> Evaluation:
    """Return an evaluation with notes on incomplete requests and scenarios without an entry."""
    notes = [Note.of(NoteKind.TEXT, text=text) for text in namespace.missing]
    lost = sum(entry is None for entry in namespace.unknown.values())
    if lost:
        notes.append(Note.of(NoteKind.UNACCOUNTED, count=lost, total=total, reason=NO_ENTRY))
    rows = tuple(
        replace(row, notes=(*row.notes, *notes)) if row.name == SCENARIOS else row
        for row in evaluation.rows
    )
    return replace(evaluation, rows=rows)


def _remarks(namespace: Namespace) -> tuple[Note, ...]:
    """Return notes on checks that a bag lacks data for, and on the outcomes of its requests."""
    notes = [Note.of(NoteKind.BAG_MEASURED)]
    if "map" not in namespace.messages:
        notes.append(Note.of(NoteKind.BAG_WITHOUT_MAP))
    if "changepoints" not in namespace.messages:
        notes.append(Note.of(NoteKind.BAG_WITHOUT_CHANGEPOINTS))
    outcomes = [summary.sentence() for summary in namespace.summaries]
    return (*notes, *(Note.of(NoteKind.TEXT, text=text) for text in outcomes))
