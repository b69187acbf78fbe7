# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

from scenario_gen.bags.recordings.read import load as load, read_recording as read_recording
from scenario_gen.bags.recordings.write import write_recording as write_recording
from scenario_gen.base.errors import (
    InputError as InputError,
    MissingExtraError as MissingExtraError,
    RefusedError as RefusedError,
    ScenarioGenError as ScenarioGenError,
)
from scenario_gen.closed_loop.command import drive as drive
from scenario_gen.closed_loop.environment import DriveEnv as DriveEnv
from scenario_gen.closed_loop.planners import IdmFollower as IdmFollower
from scenario_gen.closed_loop.trials import (
    rates as rates,
    run_trials as run_trials,
    trials_of as trials_of,
)
from scenario_gen.corpus.config import CorpusConfig as CorpusConfig
from scenario_gen.corpus.frames import batch as batch, find as find, mine as mine
from scenario_gen.corpus.parallel import generate_many as generate_many
from scenario_gen.logs import LogConfig as LogConfig, read_log as read_log
from scenario_gen.logs.read import LogResult as LogResult
from scenario_gen.logs.synthetic import bundled as bundled
from scenario_gen.method.config import PipelineConfig as PipelineConfig
from scenario_gen.method.decisions import decided as decided, decisions_of as decisions_of
from scenario_gen.method.evaluation.config import EvaluationConfig as EvaluationConfig
from scenario_gen.method.evaluation.evaluate import (
    evaluate as evaluate,
    evaluate_scenarios as evaluate_scenarios,
)
from scenario_gen.method.fitting import (
    fit_template as fit_template,
    FittingConfig as FittingConfig,
)
from scenario_gen.method.routing import (
    plan_routes as plan_routes,
    PlanningConfig as PlanningConfig,
)
from scenario_gen.method.sampling import (
    sample_scenarios as sample_scenarios,
    SamplingConfig as SamplingConfig,
)
from scenario_gen.method.segmentation import (
    segment as segment,
    segment_track as segment_track,
    SegmentationConfig as SegmentationConfig,
    StickyHDPHMM as StickyHDPHMM,
)
from scenario_gen.method.validity import Checker as Checker, Limits as Limits
from scenario_gen.output.exchange.export import export_bag as export_bag
from scenario_gen.output.plot import animate as animate, plot as plot
from scenario_gen.output.results import report as report, save as save
from scenario_gen.output.table import filter_scenarios as filter_scenarios, measures as measures
from scenario_gen.pipeline import (
    generate as generate,
    generate_outcomes as generate_outcomes,
)
from scenario_gen.roads import build_road as build_road, RoadConfig as RoadConfig
from scenario_gen.situation import Situation as Situation
from scenario_gen.types.encounter import Encounter as Encounter
from scenario_gen.types.evaluation import Evaluation as Evaluation
from scenario_gen.types.fit import Fit as Fit
from scenario_gen.types.generation import GenerationResult as GenerationResult
from scenario_gen.types.request import Request as Request
from scenario_gen.types.road import Road as Road
from scenario_gen.types.fit import Route as Route
from scenario_gen.types.scenario import (
    Cause as Cause,
    Scenario as Scenario,
    ScenarioSet as ScenarioSet,
    Verdict as Verdict,
    Violation as Violation,
)
from scenario_gen.types.fit import Segmentation as Segmentation
from scenario_gen.types.vehicle import Trailer as Trailer
from scenario_gen.types.vehicle import Vehicle as Vehicle

__version__: str
__all__: list[str]
