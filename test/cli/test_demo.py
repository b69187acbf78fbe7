# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The demo compares what the nodes recorded with its own scenarios."""

import pytest

from scenario_gen import bundled, generate, read_log, report
from scenario_gen.base.errors import ScenarioGenError
from scenario_gen.cli.demo import compare_with_nodes


def test_early_leavers_are_compared_whole(tmp_path):
    encounter = read_log(bundled("ngsim_two_left_turns")).encounters[0]
    quick = {"evaluation.resamples": 10}
    made, other = (
        generate(encounter, "t_intersection", quick, count=2, seed=seed) for seed in (7, 8)
    )
    report(tmp_path / "out", made)
    compare_with_nodes([made], tmp_path / "out" / "bag")
    with pytest.raises(ScenarioGenError, match="the nodes generated other scenarios"):
        compare_with_nodes([other], tmp_path / "out" / "bag")
