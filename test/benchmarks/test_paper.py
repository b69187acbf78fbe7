# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The paper's figures: drawn on its own settings, measured beside its claims, and honest where they do not hold."""

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks._paper_measure import run_case
from benchmarks._reference_sets import UNIFORM, WITHOUT
from benchmarks.paper import reproduce
from scenario_gen.base.errors import InputError
from scenario_gen.base.folders import MARKER
from scenario_gen.logs import read_log
from scenario_gen.logs.synthetic import bundled
from scenario_gen.types import WITH


@pytest.fixture(scope="module")
def case():
    return run_case(read_log(Path(bundled("a"))).encounters[0], count=5, seed=7)


def test_paper_grid_and_ends_are_used(case):
    assert (
        case.road.name == "t_intersection"
        and np.count_nonzero(case.road.drivable.any(axis=0)) == 1000
        and case.road.resolution == 1.0
    )
    for arm in case.arms.values():
        asked = np.stack([arm.fit.requested.start[:, :2], arm.fit.requested.end[:, :2]])
        found = np.stack([arm.position[:, :, 0], arm.position[:, :, -1]])
        np.testing.assert_allclose(found, np.broadcast_to(asked[:, None], found.shape), atol=1e-6)
    spread = case.arms[WITH].position[:, 1].std(axis=0).max()
    assert 1.0 < spread < 60.0, "samples vary, by about σ"


def test_stop_needs_changepoints(case):
    assert case.stop_speed[WITH] < 0.2 and case.stop_speed[WITHOUT] > 1.0
    for kind in ("e_position", "e_speed"):
        assert case.similarity[WITH][kind].high < 0.5 * case.similarity[WITHOUT][kind].low
    assert UNIFORM in case.similarity
    assert case.off_road[WITH] == 0.0


def test_priors_are_compared_on_bends(case):
    errors = {name: prior.error for name, prior in case.regressions.priors.items()}
    assert errors["cubic polynomial"] < errors["training data mean"] < errors["zero mean"]
    np.testing.assert_allclose(np.interp(case.regressions.training[:, 0], case.regressions.x, case.regressions.truth),
                               case.regressions.training[:, 1], atol=2.0)  # fmt: skip


def test_paper_page_spares_other_folders(tmp_path):
    out = tmp_path / "out"
    lines = []
    reproduce([[bundled("c")]], out, count=2, seed=7, report=lines.append)
    said = "\n".join(lines)
    assert "synthetic_c on straight" in said and "figure 5, as claimed" in said
    assert sorted(path.name for path in out.iterdir()) == [MARKER, "paper.html", "paper.json"]
    assert "log synthetic_c" in json.loads((out / "paper.json").read_text())["provenance"]
    with pytest.raises(InputError, match="name another folder"):
        reproduce([[Path(bundled("c"))]], Path(bundled("c")), count=4, seed=1)
