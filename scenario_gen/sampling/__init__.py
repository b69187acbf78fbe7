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

"""Speed profile and Gaussian process -> candidate scenarios (paper III-C)."""

from scenario_gen.sampling.config import SamplingConfig
from scenario_gen.sampling.freedom import freed_states
from scenario_gen.sampling.prepare import kept_reactions
from scenario_gen.sampling.sample import Cancelled, OnValid, Progress, regenerate, sample_scenarios

__all__ = [
    "Cancelled", "OnValid", "Progress", "SamplingConfig", "freed_states", "kept_reactions", "regenerate", "sample_scenarios",
]  # fmt: skip
