# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Sampling: candidates from speed profiles and Gaussian processes, filtered (paper III-C)."""

from scenario_gen.method.sampling.build_model import kept_reactions
from scenario_gen.method.sampling.config import SamplingConfig
from scenario_gen.method.sampling.gp import Features, Observations, Posterior, Regression
from scenario_gen.method.sampling.natural import NaturalScenarios
from scenario_gen.method.sampling.plan import Callbacks, Cancelled, OnValid, Plan, Progress
from scenario_gen.method.sampling.sampler import TargetError
from scenario_gen.method.sampling.stage import checker_of, draw_scenarios, sample_scenarios
from scenario_gen.method.sampling.variation import relaxed_states

__all__ = [
    "Callbacks",
    "Cancelled",
    "Features",
    "NaturalScenarios",
    "Observations",
    "OnValid",
    "Plan",
    "Posterior",
    "Progress",
    "Regression",
    "SamplingConfig",
    "TargetError",
    "checker_of",
    "draw_scenarios",
    "kept_reactions",
    "relaxed_states",
    "sample_scenarios",
]
