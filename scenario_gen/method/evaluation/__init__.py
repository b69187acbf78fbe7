# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""DTW features (paper V-B), realism and criticality."""

from scenario_gen.method.evaluation.compare import compare, comparison_table, Difference, read_evaluations
from scenario_gen.method.evaluation.coverage import coverage_of
from scenario_gen.method.evaluation.dtw import Alignment, dtw, dtw_distance, feature_matrix
from scenario_gen.method.evaluation.evaluate import evaluate, evaluate_scenarios, EvaluationConfig, MEASURED
from scenario_gen.method.evaluation.measures import MEASURES
from scenario_gen.method.evaluation.oracle import replay
from scenario_gen.method.evaluation.references import linear_changepoints, uniform_changepoints, without_changepoints

__all__ = [
    "MEASURED",
    "MEASURES",
    "Alignment",
    "Difference",
    "EvaluationConfig",
    "compare",
    "comparison_table",
    "coverage_of",
    "dtw",
    "dtw_distance",
    "evaluate",
    "evaluate_scenarios",
    "feature_matrix",
    "linear_changepoints",
    "read_evaluations",
    "replay",
    "uniform_changepoints",
    "without_changepoints",
]
