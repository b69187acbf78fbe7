"""DTW features (paper V-B), realism, criticality and the report."""

from scenario_gen.evaluation.compare import Difference, compare, comparison_table, read_evaluations
from scenario_gen.evaluation.dtw import Alignment, dtw, dtw_distance, feature_matrix
from scenario_gen.evaluation.evaluate import EvaluationConfig, evaluate
from scenario_gen.evaluation.oracle import replay
from scenario_gen.evaluation.references import linear_changepoints, uniform_changepoints
from scenario_gen.evaluation.report import ORACLE, UNIFORM, WITH, WITHOUT, Case, ReportInput, render, write_report
from scenario_gen.evaluation.result import CheckCounts, Evaluation, Metric, Row
from scenario_gen.evaluation.summary import summary

__all__ = [
    "ORACLE",
    "UNIFORM",
    "WITH",
    "WITHOUT",
    "Alignment",
    "Case",
    "CheckCounts",
    "Difference",
    "Evaluation",
    "EvaluationConfig",
    "Metric",
    "ReportInput",
    "Row",
    "compare",
    "comparison_table",
    "dtw",
    "dtw_distance",
    "evaluate",
    "feature_matrix",
    "linear_changepoints",
    "read_evaluations",
    "render",
    "replay",
    "summary",
    "uniform_changepoints",
    "write_report",
]
