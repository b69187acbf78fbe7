# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Evaluation of scenario sets against their recorded encounter (paper V-B, method §7)."""

from collections.abc import Mapping, Sequence
from itertools import chain
import math

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.method.evaluation.config import EvaluationConfig
from scenario_gen.method.evaluation.metrics import catalogue, METRICS, VALIDITY
from scenario_gen.method.evaluation.samples import MIN_COMMON_S, Samples, Template
from scenario_gen.types import (
    Encounter,
    Evaluation,
    GenerationResult,
    Interval,
    Note,
    NoteKind,
    RECORDING,
    REPLAY,
    Row,
    Scenario,
    ScenarioSet,
)

MEASURED_SCENARIOS = 1000
"""Number of scenarios measured in a larger set, in RUN_COUNT evenly spaced runs."""
RUN_COUNT = 20
MIN_STEPS = 20  # instants of a feature matrix, for any number of vehicles
Scenarios = Sequence[Scenario] | ScenarioSet


def evaluate(
    result: GenerationResult, config: EvaluationConfig = EvaluationConfig()
) -> Evaluation:
    """Measure the generated set and the replay of the fitted template.

    Args:
        result: as `generate` returns it.
        config: how to measure.

    Returns:
        One row for the recorded template, one for `generated`, and `REPLAY` if there is a replay.

    Raises:
        InputError: it is no result, or a scenario has a vehicle that the encounter has not.
    """
    if not isinstance(result, GenerationResult):
        raise InputError(
            f"evaluate: a GenerationResult is needed, not {type(result).__name__}; load(path) "
            "returns the results in a bag"
        )
    sets: dict[str, Scenarios] = {result.row_name: result.generated}
    if result.replay is not None:
        sets[REPLAY] = (result.replay,)
    road = result.road.name if result.road else ""
    points = len(result.segmentation.changepoints)
    return evaluate_scenarios(
        result.encounter, sets, changepoints=points, road=road, config=config, seed=result.seed
    )


def evaluate_scenarios(
    encounter: Encounter,
    sets: Scenarios | Mapping[str, Scenarios],
    *,
    changepoints: int = 0,
    road: str = "",
    config: EvaluationConfig = EvaluationConfig(),
    seed: int = 0,
) -> Evaluation:
    """Measure scenarios, wherever they come from, against their template.

    Args:
        encounter: the recorded template.
        sets: scenarios, or several sets of them by name, each a row. That
            of "replay" is the fitted template, to which displacements are measured. A
            `ScenarioSet` brings its account of candidates along. An empty set gives an empty row,
            with a note. A larger set is measured on MEASURED_SCENARIOS of its scenarios, see
            `measured`.
        changepoints: their number K, shown with E, since more changepoints always fit better.
        road: name of the road, for the heading.
        config: how to measure.
        seed: of the bootstrap.

    A vehicle that a scenario lacks (one left out for an ego) is left out of every row, the
    template's too; with one vehicle left, quantity needs two is not a number.

    Returns:
        One row for the recorded template and one for each set.

    Raises:
        InputError: a scenario has a vehicle that the encounter has not.
    """
    named = sets if isinstance(sets, Mapping) else {"scenarios": sets}
    counts = {name: each for name, each in named.items() if isinstance(each, ScenarioSet)}
    rows = {
        name: measured(each.scenarios if isinstance(each, ScenarioSet) else each)
        for name, each in named.items()
    }
    ids = shared_vehicles(encounter, rows)
    replayed = next(iter(rows.get(REPLAY, ())), None)
    steps = _steps(encounter, len(ids), config)
    template = Template(encounter, ids, steps, replayed, config, seed)
    evaluated = [
        _row(name, len(named[name]), Samples(scenarios, counts.get(name), template))
        for name, scenarios in rows.items()
    ]
    return Evaluation(
        encounter=encounter.name,
        road=road,
        vehicles=ids,
        duration=encounter.duration,
        changepoints=changepoints,
        level=config.level,
        resamples=config.resamples,
        seed=seed,
        metrics=catalogue(config),
        rows=(_template_row(template), *evaluated),
    )


def _steps(encounter: Encounter, vehicles: int, config: EvaluationConfig) -> int:
    """Return the number of instants of each feature matrix."""
    pairs = max(math.comb(vehicles, 2), 1)
    affordable = max(math.isqrt(config.max_entries // pairs), MIN_STEPS)
    return min(len(encounter.time), config.max_steps, affordable)


def measured(scenarios: Sequence[Scenario]) -> Sequence[Scenario]:
    """Return the scenarios of a set that are measured: all, or MEASURED_SCENARIOS of a larger one.

    Those are RUN_COUNT runs of consecutive scenarios, evenly spaced from the first to the last:
    whatever changes along the set is in them, and nearly every scenario has its mirror image
    beside it, as in a smaller set.
    """
    if len(scenarios) <= MEASURED_SCENARIOS:
        return scenarios
    length = MEASURED_SCENARIOS // RUN_COUNT
    starts = [k * (len(scenarios) - length) // (RUN_COUNT - 1) for k in range(RUN_COUNT)]
    return tuple(chain.from_iterable(scenarios[start : start + length] for start in starts))


def shared_vehicles(
    encounter: Encounter, rows: Mapping[str, Sequence[Scenario]]
) -> tuple[str, ...]:
    """Return the ids of the vehicles that every scenario has, in the encounter's order.

    Raises:
        InputError: a scenario has a vehicle that the encounter has not, or none is left.
    """
    ids = encounter.ids
    shared = set(ids)
    for name, scenarios in rows.items():
        for scenario in scenarios:
            present = set(scenario.ids)
            if len(present) != len(scenario.vehicles) or not present <= set(ids):
                raise InputError(
                    f"row {name!r}: scenario {scenario.index} has {len(scenario.vehicles)} "
                    f"vehicles ({', '.join(sorted(present))}), "
                    f"the encounter {encounter.name!r} has {len(ids)} ({', '.join(ids)})"
                )
            shared &= present
    if not shared:
        raise InputError(
            f"no vehicle of {encounter.name!r} is in all scenarios; "
            "measure requests with different egos one by one"
        )
    return tuple(known for known in ids if known in shared)


def _template_row(template: Template) -> Row:
    values = {
        key: Interval(value)
        for group in METRICS.values()
        for key, value in group.of_template(template).items()
    }
    resampled = template.steps < template.encounter.speed.shape[1]
    notes = (Note.of(NoteKind.RESAMPLED, steps=template.steps),) if resampled else ()
    return Row(RECORDING, 1, values, notes)


def _row(name: str, size: int, samples: Samples) -> Row:
    """The row of a set of this size, of which the samples are measured."""
    if not samples.scenarios:
        return Row(name, 0, VALIDITY.measure(samples), (Note.of(NoteKind.EMPTY),))
    values: dict[str, Interval] = {}
    for group in METRICS.values():
        values |= group.measure(samples)
    return Row(name, len(samples.scenarios), values, _notes(size, values, samples))


def _notes(size: int, values: Mapping[str, Interval], samples: Samples) -> tuple[Note, ...]:
    notes = []
    measured = len(samples.scenarios)
    enough = samples.template.config.enough
    left_out = math.comb(len(samples.template.ids), 2) - len(samples.pairs)
    if left_out:
        notes.append(Note.of(NoteKind.PAIRS_LEFT_OUT, count=left_out, time=MIN_COMMON_S))
    if measured < size:
        notes.append(
            Note.of(NoteKind.SUBSET_MEASURED, measured=measured, total=size, runs=RUN_COUNT)
        )
    if 1 < measured < enough:
        notes.append(Note.of(NoteKind.FEW_SCENARIOS, measured=measured, enough=enough))
    if np.isnan(values["min_distance"].value):
        return (*notes, Note.of(NoteKind.ONE_VEHICLE))
    notes += [
        Note.of(NoteKind.E_UNDEFINED, quantity=quantity)
        for quantity in ("position", "speed")
        if not np.isfinite(values[f"e_{quantity}"].value)
    ]
    if values["vanished_conflicts"].value > 0.0:
        vanished, kept = (values[key].value for key in ("vanished_conflicts", "conflicts"))
        notes.append(
            Note.of(NoteKind.CONFLICTS_VANISHED, vanished=vanished, total=vanished + kept)
        )
    return tuple(notes)
