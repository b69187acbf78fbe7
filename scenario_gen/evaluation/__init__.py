# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""DTW features (paper V-B), realism and criticality."""

from scenario_gen.evaluation.compare import compare, comparison_table, Difference, read_evaluations
from scenario_gen.evaluation.coverage import coverage_of
from scenario_gen.evaluation.dtw import Alignment, dtw, dtw_distance, feature_matrix
from scenario_gen.evaluation.evaluate import evaluate, evaluate_scenarios, EvaluationConfig, MEASURED
from scenario_gen.evaluation.measures import MEASURES
from scenario_gen.evaluation.oracle import replay
from scenario_gen.evaluation.references import linear_changepoints, uniform_changepoints, without_changepoints

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
