# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The evaluation of sets of scenarios against the encounter that they were generated from (paper V-B, method §7)."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain, combinations
import math

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.method.evaluation import diversity, similarity
from scenario_gen.method.evaluation.bootstrap import Bootstrap, wilson
from scenario_gen.method.evaluation.criticality import Criticality, criticality
from scenario_gen.method.evaluation.distributions import compare, QUANTITIES, values_of
from scenario_gen.method.evaluation.dtw import Distance
from scenario_gen.method.evaluation.metrics import LIMIT_CAUSES, METRICS
from scenario_gen.method.evaluation.motion import at_common, at_count, at_period, COMMON, Motion, of_vehicles, stacked
from scenario_gen.numerics import Bools, Floats, Ints
from scenario_gen.template import keeps
from scenario_gen.types import (
    Cause,
    CheckCounts,
    Encounter,
    Evaluation,
    GenerationResult,
    Interval,
    ORACLE,
    Row,
    Scenario,
    ScenarioSet,
    TEMPLATE,
)

MEASURED = 1000
"""Scenarios of a set that are measured; of a larger one this many, in RUNS evenly spaced runs of consecutive ones."""
RUNS = 20
TURNS = math.radians(10.0)
"""Of a pair whose headings' differences spread by less, E for heading would measure noise; it has none."""
Scenarios = Sequence[Scenario] | ScenarioSet


@dataclass(frozen=True)
class EvaluationConfig(Parameters):
    """How a set of scenarios is measured."""

    level: float = parameter(0.95, "confidence level of the intervals", low=0.5, high=0.999)
    resamples: int = parameter(1000, "resamples of the bootstrap", low=10, high=100_000)
    enough: int = parameter(50, "samples below which the figures are marked as few (the paper takes 50)", low=1)
    max_steps: int = parameter(600, "most instants in a feature matrix; a longer template is resampled", low=10, high=5000)
    period: float = parameter(0.1, "sampling period of distributions and criticality", unit="s", low=0.01, high=1.0)
    ttc_horizon: float = parameter(10.0, "times to collision above this count as this", unit="s", low=1.0, high=100.0)
    uniform: bool = parameter(True, "command line: generate also with as many changepoints evenly spaced in time, a row to beat")


@dataclass(frozen=True, eq=False)
class _Reference:
    """What every row is measured against, prepared once.

    `motion` is the encounter on T even instants, `fitted` the fitted template on the same, if there is one.
    """

    encounter: Encounter
    motion: Motion
    values: Mapping[str, Floats]
    critical: Criticality
    fitted: Motion | None
    config: EvaluationConfig
    seed: int


def evaluate(made: GenerationResult, config: EvaluationConfig = EvaluationConfig()) -> Evaluation:
    """Measure what was generated, beside its references and the fitted template replayed (the oracle row).

    Args:
        made: as `generate` returns it.
        config: how to measure.

    Returns:
        One row for the recorded template, one for `generated` and for each reference, and the oracle's if there is one.

    Raises:
        InputError: a scenario has a vehicle that the encounter has not.
    """
    sets: dict[str, Scenarios] = {made.row: made.generated, **made.references}
    if made.oracle is not None:
        sets[ORACLE] = (made.oracle,)
    road = made.road.name if made.road else ""
    points = len(made.segmentation.changepoints)
    return evaluate_scenarios(made.encounter, sets, changepoints=points, road=road, config=config, seed=made.seed)


def evaluate_scenarios(
    encounter: Encounter,
    sets: Scenarios | Mapping[str, Scenarios],
    *,
    changepoints: int = 0,
    checks: Mapping[str, CheckCounts] | None = None,
    oracle: str = ORACLE,
    road: str = "",
    config: EvaluationConfig = EvaluationConfig(),
    seed: int = 0,
) -> Evaluation:
    """Measure scenarios, wherever they come from, against their template.

    Args:
        encounter: the recorded template.
        sets: scenarios, or several sets of them by name, each a row: "mine", "oracle". A `ScenarioSet` brings its account of
            candidates along. An empty set gives an empty row, with a note. Of a set of more than MEASURED
            scenarios that many are measured, see `measured`.
        changepoints: their number K stands beside E, for more changepoints always fit better.
        checks: the checker's account of the candidates of a row, where its set brings none.
        oracle: the row whose first scenario is the fitted template, to which displacements are measured.
        road: name of the road, for the heading.
        config: how to measure.
        seed: of the bootstrap.

    A vehicle that a scenario lacks (one left out for an ego) is left out of every row, the template's too; with one vehicle
    left, what needs two is not a number.

    Returns:
        One row for the recorded template and one for each set.

    Raises:
        InputError: a scenario has a vehicle that the encounter has not.
    """
    named = sets if isinstance(sets, Mapping) else {"scenarios": sets}
    counts = {name: CheckCounts.of_set(one) for name, one in named.items() if isinstance(one, ScenarioSet)} | dict(checks or {})
    rows = {name: one.scenarios if isinstance(one, ScenarioSet) else one for name, one in named.items()}
    sizes = {name: len(scenarios) for name, scenarios in rows.items()}
    rows = {name: measured(scenarios) for name, scenarios in rows.items()}
    steps = min(encounter.speed.shape[1], config.max_steps)
    ids = shared_vehicles(encounter, rows)
    clocked = chosen(at_period(encounter, config.period), ids)
    fitted = chosen(at_count(rows[oracle][0], steps), ids) if rows.get(oracle) else None
    critical = criticality(clocked, config.ttc_horizon)
    motion = chosen(at_count(encounter, steps), ids)
    reference = _Reference(encounter, motion, values_of(clocked), critical, fitted, config, seed)
    found = [_measure(name, scenarios, sizes[name], reference, counts.get(name)) for name, scenarios in rows.items()]
    return Evaluation(
        encounter=encounter.name,
        road=road,
        vehicles=ids,
        duration=encounter.duration,
        changepoints=changepoints,
        level=config.level,
        resamples=config.resamples,
        seed=seed,
        metrics=METRICS,
        rows=(_template_row(reference, steps < encounter.speed.shape[1], steps), *found),
    )


def measured(scenarios: Sequence[Scenario]) -> Sequence[Scenario]:
    """Return the scenarios of a set that the figures are taken of: all, or MEASURED of a larger one.

    Those are RUNS runs of consecutive scenarios, evenly spaced from the first to the last: whatever changes along the set is in
    them, and nearly every scenario has its mirror image beside it, as in a smaller set.
    """
    if len(scenarios) <= MEASURED:
        return scenarios
    length = MEASURED // RUNS
    starts = [k * (len(scenarios) - length) // (RUNS - 1) for k in range(RUNS)]
    return tuple(chain.from_iterable(scenarios[start : start + length] for start in starts))


def shared_vehicles(encounter: Encounter, rows: Mapping[str, Sequence[Scenario]]) -> tuple[str, ...]:
    """Return the ids of the vehicles that every scenario has, in the encounter's order.

    Raises:
        InputError: a scenario has a vehicle that the encounter has not, or none is left.
    """
    ids = [vehicle.id for vehicle in encounter.vehicles]
    shared = ids
    for name, scenarios in rows.items():
        for scenario in scenarios:
            own = {vehicle.id for vehicle in scenario.vehicles}
            if len(own) != len(scenario.vehicles) or not own <= set(ids):
                raise InputError(
                    f"row {name!r}: scenario {scenario.index} has {len(scenario.vehicles)} vehicles ({', '.join(sorted(own))}), "
                    f"the encounter {encounter.name!r} has {len(ids)} ({', '.join(ids)})"
                )
            shared = [known for known in shared if known in own]
    if not shared:
        raise InputError(f"no vehicle of {encounter.name!r} is in all scenarios; measure requests with different egos one by one")
    return tuple(shared)


def chosen(motion: Motion, ids: Sequence[str]) -> Motion:
    """Return the motion of the vehicles with these ids, in their order."""
    own = [vehicle.id for vehicle in motion.vehicles]
    return of_vehicles(motion, [own.index(known) for known in ids])


def _template_row(reference: _Reference, resampled: bool, steps: int) -> Row:
    critical = reference.critical
    values = {
        "min_distance": critical.min_distance,
        "min_ttc": critical.min_ttc,
        "pet": critical.pet,
        "conflicts": float(len(critical.order)),
    }
    notes = (f"longer than max_steps: the feature matrices have {steps} instants",) if resampled else ()
    return Row(TEMPLATE, 1, {key: Interval(value) for key, value in values.items()}, notes)


def _measure(name: str, scenarios: Sequence[Scenario], size: int, reference: _Reference, counts: CheckCounts | None) -> Row:
    """The row of scenarios that are all of a set of this size, or those of it that are measured."""
    config, fitted = reference.config, reference.fitted
    values = _rates(counts, config.level) if counts else {}
    if not scenarios:
        return Row(name, 0, values, ("there is no scenario in this row",))
    bootstrap = Bootstrap.draw(_pairs(scenarios), config.resamples, config.level, reference.seed)
    steps = reference.motion.speed.shape[1]
    ids = [vehicle.id for vehicle in reference.motion.vehicles]
    motions = [chosen(at_count(scenario, steps), ids) for scenario in scenarios]
    position = np.stack([motion.position for motion in motions])
    clocked = [chosen(at_period(scenario, config.period), ids) for scenario in scenarios]
    pairs = list(_together(reference, scenarios, motions))
    values |= _similarity(pairs, bootstrap)
    heading = np.stack([motion.heading for motion in motions])
    values["turn_kept"] = bootstrap.mean(_turn_kept(reference.motion.heading, heading))
    values |= _distributions(reference, clocked, bootstrap)
    values |= _criticality(reference, clocked, bootstrap)
    there: Bools = np.logical_and.reduce([reference.motion.there, *(motion.there for motion in motions)])
    table = diversity.displacements(position, there)
    values["diversity"] = bootstrap.interval(lambda weights: diversity.diversity(table, weights))
    if fitted is not None:
        error = diversity.displacement_to(position, fitted.position, there)
        values["min_ade"] = bootstrap.interval(lambda weights: diversity.weighted_min(error, weights))
    return Row(
        name, len(scenarios), values, _notes(len(scenarios), size, values, config, len(ids) * (len(ids) - 1) // 2 - len(pairs))
    )


def _pairs(scenarios: Sequence[Scenario]) -> Ints:
    """(S,) number of each scenario's antithetic pair: the sampler draws candidates 2k and 2k + 1 of a seed as mirror images.

    Scenarios that share a number were not numbered by the sampler; each is a pair of its own.
    """
    numbers = [(scenario.seed, scenario.index) for scenario in scenarios]
    if len(set(numbers)) < len(numbers):
        return np.arange(len(numbers))
    pairs: dict[tuple[int, int], int] = {}
    return np.array([pairs.setdefault((seed, index // 2), len(pairs)) for seed, index in numbers], dtype=np.int64)


@dataclass(frozen=True, eq=False)
class _Pair:
    """Two vehicles while both are there, in the template and in S samples, at the same number of instants T.

    `template` holds positions (2, T, 2) [m], speeds (2, T) [m/s] and headings (2, T) [rad], `samples` the same of S.
    """

    template: tuple[Floats, ...]
    samples: tuple[Floats, ...]

    def similarity(self, k: int, distance: Distance, least: float = 0.0) -> similarity.PairSimilarity:
        """Compare one of the three, as `pair_similarity` does."""
        one, many = self.template[k], self.samples[k]
        if one.ndim == 2:
            one, many = one[..., None], many[..., None]
        target, series = np.moveaxis(one, -1, -2), np.moveaxis(many, -1, -2)
        return similarity.pair_similarity((target[0], target[1]), (series[:, 0], series[:, 1]), distance, least)


def _together(reference: _Reference, scenarios: Sequence[Scenario], motions: Sequence[Motion]) -> Iterator[_Pair]:
    """Yield the pairs of vehicles that are there together, for COMMON s, in the template and in all samples (`motions`)."""
    template, steps = reference.motion, reference.motion.speed.shape[1]
    throughout = all(motion.always for motion in (template, *motions))
    whole = stacked(motions)
    for a, b in combinations(range(len(template.vehicles)), 2):
        if throughout:
            rows = [a, b]
            own = template.position[rows], template.speed[rows], template.heading[rows]
            yield _Pair(own, tuple(values[:, rows] for values in whole))
            continue
        names = template.vehicles[a].id, template.vehicles[b].id
        sources: list[Encounter | Scenario] = [reference.encounter, *scenarios]
        common = [at_common(source, names, steps) for source in sources]
        found = [motion for motion in common if motion is not None]
        if len(found) == len(common):
            yield _Pair((found[0].position, found[0].speed, found[0].heading), stacked(found[1:]))


def _similarity(pairs: Sequence[_Pair], bootstrap: Bootstrap) -> dict[str, Interval]:
    """E and the correlation: Euclidean distance for position, Manhattan for speed, as in the paper; wrapped for heading.

    Where nobody turns there is nothing of headings.
    """
    compared = {
        "position": [pair.similarity(0, "euclidean") for pair in pairs],
        "speed": [pair.similarity(1, "manhattan") for pair in pairs],
        "heading": [pair.similarity(2, "angle", TURNS) for pair in pairs],
    }
    if not any(pair.template[2] for pair in compared["heading"]):
        del compared["heading"]
    found = {f"e_{what}": bootstrap.interval(partial(similarity.mean_error, of)) for what, of in compared.items()}
    return found | {
        f"correlation_{what}": bootstrap.interval(partial(similarity.mean_correlation, of)) for what, of in compared.items()
    }


def _turn_kept(template: Floats, samples: Floats) -> Floats:
    """Share (S,) of vehicles that turn from start to end as the template's (N, T) do, of headings (S, N, T) [rad], unwrapped."""
    before, after = template[:, -1] - template[:, 0], samples[:, :, -1] - samples[:, :, 0]
    return np.array([np.mean([keeps(a, b) for a, b in zip(before, row, strict=True)]) for row in after])


def _distributions(reference: _Reference, motions: Sequence[Motion], bootstrap: Bootstrap) -> dict[str, Interval]:
    samples = [values_of(motion) for motion in motions]
    result: dict[str, Interval] = {}
    units, drawn = [np.flatnonzero(bootstrap.unit == k) for k in range(bootstrap.unit.max() + 1)], bootstrap.of_units()
    covered = []
    for quantity in QUANTITIES:
        pooled = [np.concatenate([samples[k][quantity.id] for k in unit]) for unit in units]
        compared = compare(quantity, reference.values[quantity.id], pooled)
        result[f"js_{quantity.id}"] = drawn.interval(compared.jensen_shannon)
        near = drawn.interval(compared.wasserstein_near)
        exact = compared.wasserstein
        result[f"wasserstein_{quantity.id}"] = Interval(
            exact, float(np.minimum(exact, near.low)), float(np.maximum(exact, near.high))
        )
        if reference.values[quantity.id].size:
            covered.append(compared)
    result["coverage"] = drawn.interval(lambda weights: np.mean([one.coverage(weights) for one in covered], axis=0))
    return result


def _criticality(reference: _Reference, motions: Sequence[Motion], bootstrap: Bootstrap) -> dict[str, Interval]:
    found = [criticality(motion, reference.config.ttc_horizon) for motion in motions]
    vanished = np.array([float(one.vanished_of(reference.critical)) for one in found])
    return {
        "min_distance": bootstrap.mean(np.array([one.min_distance for one in found])),
        "min_ttc": bootstrap.mean(np.array([one.min_ttc for one in found])),
        "pet": bootstrap.mean(np.array([one.pet for one in found])),
        "order_kept": bootstrap.mean(np.array([one.keeps_order_of(reference.critical) for one in found])),
        "conflicts": bootstrap.mean(len(reference.critical.order) - vanished),
        "vanished_conflicts": bootstrap.mean(vanished),
    }


def _rates(counts: CheckCounts, level: float) -> dict[str, Interval]:
    """Shares of the candidates, by the first cause for which they were refused."""
    accepted = counts.candidates - sum(counts.refused.values())
    return {
        "acceptance": wilson(accepted, counts.candidates, level),
        "collision_rate": wilson(*counts.share_of([Cause.OVERLAP]), level),
        "off_road_rate": wilson(*counts.share_of([Cause.OFF_ROAD]), level),
        "limit_rate": wilson(*counts.share_of(LIMIT_CAUSES), level),
    }


def _notes(samples: int, size: int, values: Mapping[str, Interval], config: EvaluationConfig, apart: int) -> tuple[str, ...]:
    notes = []
    if apart:
        notes.append(f"E leaves out {apart} pair(s) of vehicles that are not there together for {COMMON:g} s")
    if samples < size:
        notes.append(f"measured on {samples:,} of {size:,} scenarios, in {RUNS} evenly spaced runs; candidates are all counted")
    if 1 < samples < config.enough:
        notes.append(f"few samples: every figure, E included, comes from {samples}, not {config.enough}")
    if np.isnan(values["min_distance"].value):
        return (*notes, "one vehicle is left: there is no pair to be measured")
    notes += [
        f"E for {what} is undefined: the template's matrix is constant for every pair of vehicles"
        for what in ("position", "speed")
        if not np.isfinite(values[f"e_{what}"].value)
    ]
    if values["vanished_conflicts"].value > 0.0:
        vanished, kept = (values[key].value for key in ("vanished_conflicts", "conflicts"))
        notes.append(f"{vanished:.3g} of the template's {vanished + kept:.0f} conflict(s) vanish, mean over samples")
    return tuple(notes)
