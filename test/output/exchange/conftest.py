# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A small bag of two generated cases, one on a built-in road and one on a corridor, for all tests of this folder."""

from dataclasses import replace

import pytest

from scenario_gen.bags.recordings.write import write_recording
from scenario_gen.base.provenance import parameter_texts
from scenario_gen.logs import read_log
from scenario_gen.logs.synthetic import bundled
from scenario_gen.pipeline import generate, PipelineConfig


@pytest.fixture(scope="session")
def small_bag(tmp_path_factory):
    folder = tmp_path_factory.mktemp("exchange") / "bag"
    config, results = PipelineConfig(), {}
    for name, case, road in (("/t", "b", "t_intersection"), ("/c", "c", "corridor")):
        (encounter,) = read_log(bundled(case)).encounters
        made = generate(encounter, road, config, count=2, seed=5)
        results[name] = replace(made, provenance=parameter_texts(config))
    return write_recording(folder, results)
