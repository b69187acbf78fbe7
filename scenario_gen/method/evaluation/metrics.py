# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The catalogue of metrics: what each figure is called, its unit, and what it means."""

from scenario_gen.method.evaluation.distributions import QUANTITIES
from scenario_gen.types import Cause, Metric

LIMIT_CAUSES = (Cause.SPEED, Cause.LONGITUDINAL_ACCELERATION, Cause.LATERAL_ACCELERATION, Cause.CURVATURE)
"""Causes that count as a violated limit."""

_SIMILARITY, _REALISM, _CRITICAL, _VALID, _DIVERSITY = (
    "Similarity to the template",
    "Distributions against the template",
    "Criticality",
    "Validity of the candidates",
    "Diversity",
)

METRICS: tuple[Metric, ...] = (
    Metric(
        "e_position", "E position", "", "lower", _SIMILARITY, "‖mean feature matrix − template's‖ / ‖template's‖, of positions"
    ),
    Metric("e_speed", "E speed", "", "lower", _SIMILARITY, "‖mean feature matrix − template's‖ / ‖template's‖, of speeds"),
    Metric(
        "e_heading",
        "E heading",
        "",
        "lower",
        _SIMILARITY,
        "‖mean feature matrix − template's‖ / ‖template's‖, of headings; none where they hardly differ in the template",
    ),
    Metric("correlation_position", "correlation position", "", "higher", _SIMILARITY, "of the mean matrix with the template's"),
    Metric("correlation_speed", "correlation speed", "", "higher", _SIMILARITY, "of the mean matrix with the template's"),
    Metric("correlation_heading", "correlation heading", "", "higher", _SIMILARITY, "of the mean matrix with the template's"),
    Metric(
        "turn_kept",
        "turn kept",
        "%",
        "higher",
        _SIMILARITY,
        "vehicles that do the template's manoeuvre and turn as far, within 25°, from start to end",
    ),
    *(
        Metric(
            f"js_{q.id}", f"JS {q.label}", "bit", "lower", _REALISM, f"Jensen–Shannon divergence, bins of {q.bin_width} {q.unit}"
        )
        for q in QUANTITIES
    ),
    *(
        Metric(f"wasserstein_{q.id}", f"W {q.label}", q.unit, "lower", _REALISM, "Wasserstein distance of the values")
        for q in QUANTITIES
    ),
    Metric("min_distance", "min distance", "m", "", _CRITICAL, "least distance of two footprints, mean over samples"),
    Metric("min_ttc", "min TTC", "s", "", _CRITICAL, "least time to collision at constant velocity, capped, mean over samples"),
    Metric("pet", "PET", "s", "", _CRITICAL, "from the first vehicle's exit of the shared area to the second's entry, mean"),
    Metric(
        "order_kept",
        "passing order kept",
        "%",
        "higher",
        _CRITICAL,
        "conflicts of the template in which the same vehicle goes first",
    ),
    Metric("conflicts", "conflicts", "", "", _CRITICAL, "conflicts of the template, and how many of them a sample has, mean"),
    Metric(
        "vanished_conflicts",
        "conflicts vanished",
        "",
        "lower",
        _CRITICAL,
        "conflicts of the template that a sample does not have, mean; the passing order is of the others",
    ),
    Metric("acceptance", "accepted", "%", "higher", _VALID, "share of candidates that the checker accepted"),
    Metric("collision_rate", "overlap", "%", "lower", _VALID, "share of candidates refused because footprints overlap"),
    Metric("off_road_rate", "off road", "%", "lower", _VALID, "share of candidates refused because a footprint leaves the road"),
    Metric(
        "limit_rate", "limit violated", "%", "lower", _VALID, "share of candidates refused for speed, acceleration or curvature"
    ),
    Metric("diversity", "diversity", "m", "", _DIVERSITY, "mean displacement between two samples"),
    Metric(
        "coverage", "coverage", "%", "higher", _DIVERSITY, "share of the template's values in histogram bins that the set visits"
    ),
    Metric("min_ade", "min ADE", "m", "lower", _DIVERSITY, "mean displacement of the nearest sample to the fitted template"),
)
