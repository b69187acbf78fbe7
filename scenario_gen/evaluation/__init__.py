"""DTW features (paper V-B), realism, criticality and the report."""

from scenario_gen.evaluation.dtw import Alignment, dtw, dtw_distance, feature_matrix
from scenario_gen.evaluation.evaluate import EvaluationConfig, evaluate
from scenario_gen.evaluation.oracle import replay
from scenario_gen.evaluation.result import CheckCounts, Evaluation, Metric, Row

__all__ = [
    "Alignment",
    "CheckCounts",
    "Evaluation",
    "EvaluationConfig",
    "Metric",
    "Row",
    "dtw",
    "dtw_distance",
    "evaluate",
    "feature_matrix",
    "replay",
]
