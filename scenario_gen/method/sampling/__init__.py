# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Speed profile and Gaussian process -> candidate scenarios (paper III-C)."""

from scenario_gen.method.sampling.config import SamplingConfig
from scenario_gen.method.sampling.freedom import freed_states
from scenario_gen.method.sampling.prepare import kept_reactions
from scenario_gen.method.sampling.sample import Cancelled, OnValid, Progress, regenerate, sample_scenarios

__all__ = [
    "Cancelled", "OnValid", "Progress", "SamplingConfig", "freed_states", "kept_reactions", "regenerate", "sample_scenarios",
]  # fmt: skip
