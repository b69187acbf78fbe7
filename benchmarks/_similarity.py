# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Rows about E, the distance of the mean feature matrix from the template's (figure 5)."""

from collections.abc import Sequence

import numpy as np

from benchmarks._reference_sets import UNIFORM, WITHOUT
from benchmarks.row import higher, lower, Row
from scenario_gen.types import WITH
from scenario_gen.types.evaluation import Evaluation

SIGNIFICANT_RATIO = 0.03
"""Below this value, E without changepoints leaves nothing to gain."""


def error_rows(
    label: str,
    evaluations: Sequence[Evaluation],
    ratio_targets: dict[str, float],
    below_without: float,
    below_uniform: dict[str, float],
) -> list[Row]:
    """Return the median ratio of E and how often E is below that of the references.

    Args:
        label: start of each row's name.
        evaluations: one per pair of an encounter and a road.
        ratio_targets: targets of the median of E with / without, by position and speed.
        below_without: target of the share of cases with E below *without*.
        below_uniform: targets of the share with E below *uniform*, by position and speed.
    """
    rows = []
    for kind, target in ratio_targets.items():
        errors = {
            arm: np.array([case.value(arm, f"e_{kind}") for case in evaluations])
            for arm in (WITH, WITHOUT, UNIFORM)
        }
        significant = errors[WITHOUT] >= SIGNIFICANT_RATIO
        ratio = (errors[WITH] / errors[WITHOUT])[significant]
        even = np.isfinite(errors[UNIFORM])
        name, count = f"{label}: E {kind}", f"{significant.sum()} of {len(evaluations)} cases"
        below = _mean(errors[WITH][even] < errors[UNIFORM][even])
        rows += [
            lower(f"{name}, with / without, median", _median(ratio), "", target, count),
            higher(f"{name}, with below without", _mean(ratio < 1.0), "share", below_without),
            higher(f"{name}, below uniform", below, "share", below_uniform[kind]),
        ]
    return rows


def _mean(values: np.ndarray) -> float:
    return float(values.mean()) if len(values) else float("nan")


def _median(values: np.ndarray) -> float:
    return float(np.nanmedian(values)) if np.isfinite(values).any() else float("nan")
