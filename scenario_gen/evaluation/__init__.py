"""DTW features (paper V-B), realism, criticality and the report."""

from scenario_gen.evaluation.dtw import Alignment, dtw, dtw_distance, feature_matrix
from scenario_gen.evaluation.evaluate import EvaluationConfig, evaluate
from scenario_gen.evaluation.oracle import replay
from scenario_gen.evaluation.report import ORACLE, WITH, WITHOUT, Case, ReportInput, render, write_report
from scenario_gen.evaluation.result import CheckCounts, Evaluation, Metric, Row
from scenario_gen.evaluation.summary import summary

__all__ = [
    "ORACLE",
    "WITH",
    "WITHOUT",
    "Alignment",
    "Case",
    "CheckCounts",
    "Evaluation",
    "EvaluationConfig",
    "Metric",
    "ReportInput",
    "Row",
    "dtw",
    "dtw_distance",
    "evaluate",
    "feature_matrix",
    "render",
    "replay",
    "summary",
    "write_report",
]
