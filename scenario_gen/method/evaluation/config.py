# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Settings of the evaluation."""

from dataclasses import dataclass

from scenario_gen.base.parameters import parameter, Parameters


@dataclass(frozen=True)
class EvaluationConfig(Parameters):
    """How a set of scenarios is measured."""

    level: float = parameter(0.95, "confidence level of the intervals", low=0.5, high=0.999)
    resamples: int = parameter(1000, "resamples of the bootstrap", low=10, high=100_000)
    enough: int = parameter(
        50, "scenarios below which the figures are marked as few (the paper takes 50)", low=1
    )
    max_steps: int = parameter(
        600,
        "most instants in a feature matrix; a longer recording is resampled",
        low=10,
        high=5000,
    )
    max_entries: int = parameter(
        400_000,
        "most entries of the feature matrices of all pairs together; with many vehicles each "
        "has fewer samples",
        low=1000,
    )
    period: float = parameter(
        0.1, "sampling period of distributions and criticality", unit="s", low=0.01, high=1.0
    )
    ttc_horizon: float = parameter(
        10.0, "times to collision above this count as this", unit="s", low=1.0, high=100.0
    )
