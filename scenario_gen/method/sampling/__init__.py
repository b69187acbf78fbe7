# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Speed profile and Gaussian process -> candidate scenarios (paper III-C)."""

from scenario_gen.method.sampling.checked import checker_of, plan_of, sample_scenarios
from scenario_gen.method.sampling.config import SamplingConfig
from scenario_gen.method.sampling.directed import directions, TargetError
from scenario_gen.method.sampling.freedom import relaxed_states
from scenario_gen.method.sampling.gp import Features, Observations, Posterior, Regression
from scenario_gen.method.sampling.natural import NaturalScenarios
from scenario_gen.method.sampling.plan import Callbacks, Cancelled, Plan, Progress
from scenario_gen.method.sampling.prepare import kept_reactions
from scenario_gen.method.sampling.sample import draw_scenarios, regenerate
from scenario_gen.method.sampling.speed_profile.knots import speed_knots, SpeedKnots

__all__ = [
    "Callbacks",
    "Cancelled",
    "Features",
    "NaturalScenarios",
    "Observations",
    "Plan",
    "Posterior",
    "Progress",
    "Regression",
    "SamplingConfig",
    "SpeedKnots",
    "TargetError",
    "checker_of",
    "directions",
    "draw_scenarios",
    "kept_reactions",
    "plan_of",
    "regenerate",
    "relaxed_states",
    "sample_scenarios",
    "speed_knots",
]  # fmt: skip
