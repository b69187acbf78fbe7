# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""DTW features (paper V-B), realism and criticality."""

from scenario_gen.method.evaluation.config import EvaluationConfig
from scenario_gen.method.evaluation.coverage import coverage_of
from scenario_gen.method.evaluation.distributions import (
    clustered_wilson,
    paired_difference,
    wilson,
)
from scenario_gen.method.evaluation.dtw import mean_feature
from scenario_gen.method.evaluation.evaluate import evaluate, evaluate_scenarios
from scenario_gen.method.evaluation.law import measures_in
from scenario_gen.method.evaluation.measures import (
    criticality,
    distance_and_ttc,
    footprint_distance,
)
from scenario_gen.method.evaluation.metrics import MetricGroup
from scenario_gen.method.evaluation.samples import common_motion, replay, Samples, Template
from scenario_gen.method.evaluation.time_shift import (
    free_acceleration,
    MAX_ACCELERATION_MPS2,
    MAX_BRAKING_MPS2,
    min_time_shift,
    STANDSTILL_MPS,
    wanted_speeds,
)

__all__ = [
    "MAX_ACCELERATION_MPS2",
    "MAX_BRAKING_MPS2",
    "STANDSTILL_MPS",
    "EvaluationConfig",
    "MetricGroup",
    "Samples",
    "Template",
    "clustered_wilson",
    "common_motion",
    "coverage_of",
    "criticality",
    "distance_and_ttc",
    "evaluate",
    "evaluate_scenarios",
    "footprint_distance",
    "free_acceleration",
    "mean_feature",
    "measures_in",
    "min_time_shift",
    "paired_difference",
    "replay",
    "wanted_speeds",
    "wilson",
]
