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

"""A small bag of two generated cases, one on a built-in road and one on a corridor, for all tests of this folder."""

from dataclasses import replace

import pytest

from scenario_gen.logs import read_log
from scenario_gen.logs.synthetic import bundled
from scenario_gen.pipeline import generate, PipelineConfig
from scenario_gen.recordings.provenance import parameter_texts
from scenario_gen.recordings.write import write_recording


@pytest.fixture(scope="session")
def small_bag(tmp_path_factory):
    folder = tmp_path_factory.mktemp("exchange") / "bag"
    config, results = PipelineConfig(), {}
    for name, case, road in (("/t", "b", "t_intersection"), ("/c", "c", "corridor")):
        (encounter,) = read_log(bundled(case)).encounters
        made = generate(encounter, road, config, count=2, seed=5)
        results[name] = replace(made, provenance=parameter_texts(config))
    return write_recording(folder, results)
