# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Sampling: candidates from speed profiles and Gaussian processes, filtered (paper III-C)."""

from scenario_gen.method.sampling.config import SamplingConfig
from scenario_gen.method.sampling.natural import NaturalScenarios
from scenario_gen.method.sampling.plan import Callbacks, Cancelled, OnValid, Plan, Progress
from scenario_gen.method.sampling.sampler import TargetError
from scenario_gen.method.sampling.stage import checker_of, sample_scenarios

__all__ = [
    "Callbacks",
    "Cancelled",
    "NaturalScenarios",
    "OnValid",
    "Plan",
    "Progress",
    "SamplingConfig",
    "TargetError",
    "checker_of",
    "sample_scenarios",
]
