# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The metrics: name, unit, meaning and computation of each figure of a scenario set."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
import math

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.base.registry import Registry
from scenario_gen.method.evaluation import similarity
from scenario_gen.method.evaluation.config import EvaluationConfig
from scenario_gen.method.evaluation.distributions import compare, QUANTITIES, values_of, wilson
from scenario_gen.method.evaluation.measures import criticality
from scenario_gen.method.evaluation.samples import Samples, Template
from scenario_gen.numerics import Floats
from scenario_gen.situation import is_same_turn
from scenario_gen.types import Cause, Interval, Metric

LIMIT_CAUSES = (
    Cause.SPEED,
    Cause.LONGITUDINAL_ACCELERATION,
    Cause.LATERAL_ACCELERATION,
    Cause.CURVATURE,
)
"""Causes that count as a violated limit."""
MIN_HEADING_SPREAD_RAD = math.radians(10.0)
"""E for heading is undefined for pairs whose heading differences spread by less."""
_SIMILARITY = "Similarity to the recording"
_REALISM = "Distributions against the recording"
_CRITICAL = "Criticality"
_VALID = "Validity of the candidates"
_DIVERSITY = "Diversity"
HEADINGS = (_SIMILARITY, _REALISM, _CRITICAL, _VALID, _DIVERSITY)
Estimates = dict[str, Interval]


@dataclass(frozen=True)
class MetricGroup:
    """Metrics that are computed together.

    Attributes:
        metrics: their descriptions; new headings (`group`) come after the known ones.
        measure: returns the estimate of each by its id, of one or more scenarios; one that cannot
            be had is left out or NaN.
        of_template: returns those that the recorded encounter has, too.
    """

    metrics: tuple[Metric, ...]
    measure: Callable[[Samples], Mapping[str, Interval]]
    of_template: Callable[[Template], Mapping[str, float]] = lambda _: {}


def rates(samples: Samples) -> Estimates:
    """Return the shares of all candidates, by the first cause for which they were refused."""
    counts, level = samples.counts, samples.template.config.level
    if counts is None:
        return {}
    refused = counts.refused
    numbers = {
        "acceptance": counts.candidates - refused.total(),
        "collision_rate": refused[Cause.OVERLAP],
        "off_road_rate": refused[Cause.OFF_ROAD],
        "limit_rate": sum(refused[cause] for cause in LIMIT_CAUSES),
    }
    return {name: wilson(number, counts.candidates, level) for name, number in numbers.items()}


VALIDITY = MetricGroup(
    (
        Metric(
            "acceptance",
            "accepted",
            "%",
            "higher",
            _VALID,
            "share of candidates that the checker accepted",
        ),
        Metric(
            "collision_rate",
            "overlap",
            "%",
            "lower",
            _VALID,
            "share of candidates refused because footprints overlap",
        ),
        Metric(
            "off_road_rate",
            "off road",
            "%",
            "lower",
            _VALID,
            "share of candidates refused because a footprint leaves the road",
        ),
        Metric(
            "limit_rate",
            "limit violated",
            "%",
            "lower",
            _VALID,
            "share of candidates refused for speed, acceleration or curvature",
        ),
    ),
    rates,
)


def _similarity(samples: Samples) -> Estimates:
    """E and correlation: Euclidean for position, Manhattan for speed; headings are wrapped.

    Headings have no figures if no vehicle turns.
    """
    unit = samples.pooled.unit
    compared = {
        "position": [pair.similarity(0, "euclidean", unit) for pair in samples.pairs],
        "speed": [pair.similarity(1, "manhattan", unit) for pair in samples.pairs],
        "heading": [
            pair.similarity(2, "angle", unit, MIN_HEADING_SPREAD_RAD) for pair in samples.pairs
        ],
    }
    if not any(pair.template[2] for pair in compared["heading"]):
        del compared["heading"]
    interval = samples.pooled.of_units().interval
    estimates = {"turn_kept": samples.bootstrap.mean(_turn_kept(samples))}
    for quantity, pairs in compared.items():
        estimates[f"e_{quantity}"] = interval(partial(similarity.mean_error, pairs))
        estimates[f"correlation_{quantity}"] = interval(
            partial(similarity.mean_correlation, pairs)
        )
    return estimates


def _turn_kept(samples: Samples) -> Floats:
    """Share (S,) of vehicles that turn from start to end as the template's do."""
    turns = samples.template.motion.heading[:, -1] - samples.template.motion.heading[:, 0]
    kept = [
        [
            is_same_turn(a, b)
            for a, b in zip(turns, m.heading[:, -1] - m.heading[:, 0], strict=True)
        ]
        for m in samples.motions
    ]
    return np.asarray(np.mean(kept, axis=1))


_E = "‖mean feature matrix − recording's‖ / ‖recording's‖, of"
SIMILARITY = MetricGroup(
    (
        Metric("e_position", "E position", "", "lower", _SIMILARITY, f"{_E} positions"),
        Metric("e_speed", "E speed", "", "lower", _SIMILARITY, f"{_E} speeds"),
        Metric(
            "e_heading",
            "E heading",
            "",
            "lower",
            _SIMILARITY,
            f"{_E} headings; none where they hardly differ in the recording",
        ),
        *(
            Metric(
                f"correlation_{quantity}",
                f"correlation {quantity}",
                "",
                "higher",
                _SIMILARITY,
                "of the mean matrix with the recording's",
            )
            for quantity in ("position", "speed", "heading")
        ),
        Metric(
            "turn_kept",
            "turn kept",
            "%",
            "higher",
            _SIMILARITY,
            "vehicles that do the recording's manoeuvre and turn as far, within 25°, "
            "from start to end",
        ),
    ),
    _similarity,
)


def _distributions(samples: Samples) -> Estimates:
    """Compare the values of each quantity; coverage is counted in the same bins."""
    values = [values_of(motion) for motion in samples.periodic]
    bootstrap, template = samples.bootstrap, samples.template.values
    units = [np.flatnonzero(bootstrap.unit == k) for k in range(bootstrap.unit.max() + 1)]
    drawn = bootstrap.of_units()
    result: Estimates = {}
    covered = []
    for quantity in QUANTITIES:
        pooled = [np.concatenate([values[k][quantity.id] for k in unit]) for unit in units]
        compared = compare(quantity, template[quantity.id], pooled)
        result[f"js_{quantity.id}"] = drawn.interval(compared.jensen_shannon)
        near = drawn.interval(compared.wasserstein_near)
        exact = compared.wasserstein
        result[f"wasserstein_{quantity.id}"] = Interval(
            exact, float(np.minimum(exact, near.low)), float(np.maximum(exact, near.high))
        )
        if template[quantity.id].size:
            covered.append(compared)
    return result | {
        "coverage": drawn.interval(
            lambda weights: np.mean([c.coverage(weights) for c in covered], axis=0)
        )
    }


_JS, _W = "Jensen–Shannon divergence, bins of", "Wasserstein distance of the values"
DISTRIBUTIONS = MetricGroup(
    (
        *(
            Metric(
                f"js_{q.id}",
                f"JS {q.label}",
                "bit",
                "lower",
                _REALISM,
                f"{_JS} {q.bin_width} {q.unit}",
            )
            for q in QUANTITIES
        ),
        *(
            Metric(f"wasserstein_{q.id}", f"W {q.label}", q.unit, "lower", _REALISM, _W)
            for q in QUANTITIES
        ),
    ),
    _distributions,
)


def _criticality(samples: Samples) -> Estimates:
    template, mean = samples.template.critical, samples.bootstrap.mean
    per_scenario = [
        criticality(motion, samples.template.config.ttc_horizon) for motion in samples.periodic
    ]
    passed = dict(template.order).keys()
    vanished = np.array([float(len(passed - dict(each.order).keys())) for each in per_scenario])
    return {
        "min_distance": mean(np.array([critical.min_distance for critical in per_scenario])),
        "min_ttc": mean(np.array([critical.min_ttc for critical in per_scenario])),
        "pet": mean(np.array([critical.pet for critical in per_scenario])),
        "order_kept": mean(
            np.array([critical.keeps_order_of(template) for critical in per_scenario])
        ),
        "conflicts": mean(len(template.order) - vanished),
        "vanished_conflicts": mean(vanished),
    }


def _criticality_of(template: Template) -> Mapping[str, float]:
    critical = template.critical
    return {
        "min_distance": critical.min_distance,
        "min_ttc": critical.min_ttc,
        "pet": critical.pet,
        "conflicts": float(len(critical.order)),
    }


CRITICALITY = MetricGroup(
    (
        Metric(
            "min_distance",
            "min distance",
            "m",
            "",
            _CRITICAL,
            "smallest distance of two footprints, mean over scenarios",
        ),
        Metric(
            "min_ttc",
            "min TTC",
            "s",
            "",
            _CRITICAL,
            "smallest time to collision at constant velocity, capped, mean",
        ),
        Metric(
            "pet",
            "PET",
            "s",
            "",
            _CRITICAL,
            "from the first vehicle's exit of the conflict area to the second's entry, mean",
        ),
        Metric(
            "order_kept",
            "passing order kept",
            "%",
            "higher",
            _CRITICAL,
            "conflicts of the recording in which the same vehicle goes first",
        ),
        Metric(
            "conflicts",
            "conflicts",
            "",
            "",
            _CRITICAL,
            "conflicts of the recording, and how many a scenario has, mean",
        ),
        Metric(
            "vanished_conflicts",
            "conflicts vanished",
            "",
            "lower",
            _CRITICAL,
            "conflicts of the recording that a scenario does not have, mean; "
            "the passing order is of the others",
        ),
    ),
    _criticality,
    _criticality_of,
)


def _diversity(samples: Samples) -> Estimates:
    position = np.stack([motion.position for motion in samples.motions])
    table = similarity.displacements(position, samples.is_present)
    interval = samples.bootstrap.interval
    result = {"diversity": interval(partial(similarity.diversity, table))}
    if samples.template.fitted is not None:
        error = similarity.displacement_to(
            position, samples.template.fitted.position, samples.is_present
        )
        result["min_ade"] = interval(partial(similarity.weighted_min, error))
    return result


DIVERSITY = MetricGroup(
    (
        Metric(
            "diversity",
            "diversity",
            "m",
            "",
            _DIVERSITY,
            "mean displacement between two scenarios",
        ),
        Metric(
            "coverage",
            "coverage",
            "%",
            "higher",
            _DIVERSITY,
            "share of the recording's values in histogram bins that the set visits",
        ),
        Metric(
            "min_ade",
            "min ADE",
            "m",
            "lower",
            _DIVERSITY,
            "mean displacement of the scenario nearest to the replay",
        ),
    ),
    _diversity,
)

METRICS = Registry[MetricGroup](
    "scenario_gen.metrics",
    {
        "validity": VALIDITY,
        "similarity": SIMILARITY,
        "distributions": DISTRIBUTIONS,
        "criticality": CRITICALITY,
        "diversity": DIVERSITY,
    },
    MetricGroup,
)
"""All groups of metrics in order of computation, with those of installed packages."""


def catalogue(config: EvaluationConfig) -> tuple[Metric, ...]:
    """Return all metrics in the order in which they are shown, by heading.

    Raises:
        InputError: two metrics have one id, or a plugin cannot be loaded.
    """
    caps = {"min_ttc": config.ttc_horizon}
    metrics = [
        replace(metric, cap=caps.get(metric.id))
        for group in METRICS.values()
        for metric in group.metrics
    ]
    for k, metric in enumerate(metrics):
        if metric.id in {other.id for other in metrics[:k]}:
            raise InputError(
                f"plugins: the metric {metric.id!r} is declared twice; "
                f"{METRICS.group} are {', '.join(METRICS.names())}"
            )
    headings = [*HEADINGS, *(metric.group for metric in metrics)]
    return tuple(sorted(metrics, key=lambda metric: headings.index(metric.group)))
