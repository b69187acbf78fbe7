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

"""Turn a handful of recorded vehicle encounters into any number of new, valid ones on other roads.

The public names stand here; each is imported when it is first used, so that importing the package takes no time.

    from scenario_gen import generate, read_log

    (encounter,) = read_log("my_log.csv").encounters
    made = generate(encounter, "t_intersection", count=50, seed=7)
    print(made.evaluation.to_markdown())
"""

from importlib import import_module
from typing import Any, TYPE_CHECKING

if TYPE_CHECKING:  # what a type checker sees; _HOME says the same at run time
    from scenario_gen.config import PipelineConfig
    from scenario_gen.errors import InputError, MissingExtraError, RefusedError, ScenarioGenError
    from scenario_gen.evaluation.evaluate import evaluate, evaluate_scenarios, EvaluationConfig
    from scenario_gen.fitting import fit_template, FittingConfig
    from scenario_gen.logs import LogConfig, read_log
    from scenario_gen.logs.read import LogResult
    from scenario_gen.logs.synthetic import bundled
    from scenario_gen.pipeline import generate
    from scenario_gen.recordings.read import read_recording
    from scenario_gen.recordings.write import write_recording
    from scenario_gen.roads import build_road, RoadConfig
    from scenario_gen.routing import plan_routes, PlanningConfig
    from scenario_gen.sampling import sample_scenarios, SamplingConfig
    from scenario_gen.segmentation import segment, SegmentationConfig
    from scenario_gen.types.encounter import Encounter, Vehicle
    from scenario_gen.types.evaluation import Evaluation
    from scenario_gen.types.fit import Fit
    from scenario_gen.types.generation import GenerationResult
    from scenario_gen.types.request import Request
    from scenario_gen.types.road import Road
    from scenario_gen.types.route import Route
    from scenario_gen.types.scenario import Cause, Scenario, ScenarioSet, Verdict, Violation
    from scenario_gen.types.segmentation import Segmentation
    from scenario_gen.validity import Checker, Limits

__version__ = "0.6.0"

_HOME = {
    "config": ("PipelineConfig",),
    "errors": ("InputError", "MissingExtraError", "RefusedError", "ScenarioGenError"),
    "evaluation.evaluate": ("EvaluationConfig", "evaluate", "evaluate_scenarios"),
    "fitting": ("FittingConfig", "fit_template"),
    "logs": ("LogConfig", "read_log"),
    "logs.read": ("LogResult",),
    "logs.synthetic": ("bundled",),
    "pipeline": ("generate",),
    "recordings.read": ("read_recording",),
    "recordings.write": ("write_recording",),
    "roads": ("RoadConfig", "build_road"),
    "routing": ("PlanningConfig", "plan_routes"),
    "sampling": ("SamplingConfig", "sample_scenarios"),
    "segmentation": ("SegmentationConfig", "segment"),
    "types.encounter": ("Encounter", "Vehicle"),
    "types.evaluation": ("Evaluation",),
    "types.fit": ("Fit",),
    "types.generation": ("GenerationResult",),
    "types.request": ("Request",),
    "types.road": ("Road",),
    "types.route": ("Route",),
    "types.scenario": ("Cause", "Scenario", "ScenarioSet", "Verdict", "Violation"),
    "types.segmentation": ("Segmentation",),
    "validity": ("Checker", "Limits"),
}
_MODULE = {name: module for module, names in _HOME.items() for name in names}

__all__ = [
    "Cause",
    "Checker",
    "Encounter",
    "Evaluation",
    "EvaluationConfig",
    "Fit",
    "FittingConfig",
    "GenerationResult",
    "InputError",
    "Limits",
    "LogConfig",
    "LogResult",
    "MissingExtraError",
    "PipelineConfig",
    "PlanningConfig",
    "RefusedError",
    "Request",
    "Road",
    "RoadConfig",
    "Route",
    "SamplingConfig",
    "Scenario",
    "ScenarioGenError",
    "ScenarioSet",
    "Segmentation",
    "SegmentationConfig",
    "Vehicle",
    "Verdict",
    "Violation",
    "build_road",
    "bundled",
    "evaluate",
    "evaluate_scenarios",
    "fit_template",
    "generate",
    "plan_routes",
    "read_log",
    "read_recording",
    "sample_scenarios",
    "segment",
    "write_recording",
]


def __getattr__(name: str) -> Any:
    """Import a public name when it is first asked for (PEP 562)."""
    if name not in _MODULE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_MODULE[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
