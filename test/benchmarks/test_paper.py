# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The paper's figures: drawn on its own settings, measured beside its claims, and honest where they do not hold."""

from dataclasses import replace
import json
from pathlib import Path
import re

import numpy as np
import pytest
from support.evaluation_worlds import crossing

from benchmarks._paper_claims import claims_of
from benchmarks._paper_measure import run_case
from benchmarks._reference_sets import UNIFORM, WITHOUT
from benchmarks.paper import refusals, reproduce, write_page
from scenario_gen.base.errors import InputError
from scenario_gen.base.folders import MARKER
from scenario_gen.logs import read_log
from scenario_gen.logs.synthetic import bundled
from scenario_gen.types import WITH


@pytest.fixture(scope="module")
def case():
    return run_case(read_log(Path(bundled("a"))).encounters[0], count=5, seed=7)


def test_the_paper_grid_is_used_and_the_given_ends_are_met(case):
    assert (
        case.road.name == "t_intersection"
        and case.road.drivable.shape == (1000, 1000)
        and case.road.resolution == 1.0
    )
    for arm in case.arms.values():
        asked = np.stack([arm.fit.requested.start[:, :2], arm.fit.requested.end[:, :2]])
        found = np.stack([arm.position[:, :, 0], arm.position[:, :, -1]])
        np.testing.assert_allclose(found, np.broadcast_to(asked[:, None], found.shape), atol=1e-6)
    spread = case.arms[WITH].position[:, 1].std(axis=0).max()
    assert 1.0 < spread < 60.0, "samples vary, by about σ"


def test_the_stop_is_kept_with_changepoints_and_lost_without(case):
    assert case.stop_speed[WITH] < 0.2 and case.stop_speed[WITHOUT] > 1.0
    for kind in ("e_position", "e_speed"):
        assert case.similarity[WITH][kind].high < 0.5 * case.similarity[WITHOUT][kind].low
    assert UNIFORM in case.similarity
    assert case.off_road[WITH] == 0.0


def test_priors_are_compared_on_a_path_that_bends(case):
    errors = {name: prior.error for name, prior in case.regressions.priors.items()}
    assert errors["cubic polynomial"] < errors["training data mean"] < errors["zero mean"]
    np.testing.assert_allclose(np.interp(case.regressions.training[:, 0], case.regressions.x, case.regressions.truth),
                               case.regressions.training[:, 1], atol=2.0)  # fmt: skip


def test_the_page_has_four_figures_with_claims_and_asks_for_nothing(case, tmp_path):
    write_page(
        tmp_path / "one", [case], quality=["7 rows <b>dropped</b>"], provenance={"seed": "7"}
    )
    write_page(
        tmp_path / "two", [case], quality=["7 rows <b>dropped</b>"], provenance={"seed": "7"}
    )
    page = (tmp_path / "one" / "paper.html").read_text()
    assert page == (tmp_path / "two" / "paper.html").read_text()
    assert [int(n) for n in re.findall(r"<h3>Figure (\d)</h3>", page)] == [2, 3, 4, 5]
    assert page.count("<b>The paper:</b>") == 4 and "rows <b>dropped" not in page
    own = "".join(
        part
        for part in re.split(r"(<script>.*?</script>)", page, flags=re.S)
        if len(part) < 1_000_000
    )
    assert "default-src 'none'" in own and "http" not in own.replace("http-equiv", "")
    document = json.loads((tmp_path / "one" / "paper.json").read_text())
    figures = {figure["figure"]: figure for figure in document["cases"][0]["figures"]}
    assert figures[5]["values"]["e_speed with changepoints"] == pytest.approx(
        case.similarity[WITH]["e_speed"].value
    )
    assert figures[4]["holds"] is True
    swapped = replace(
        case,
        similarity={WITH: case.similarity[WITHOUT], WITHOUT: case.similarity[WITH]},
        off_road={WITH: 0.1},
    )
    claims = {claim.number: claim.holds for claim in claims_of(swapped)}
    assert claims[4] is False and claims[5] is False, "claims that fail are said to"


def test_what_fits_no_road_of_the_paper_says_so_on_the_page(tmp_path):
    """Two cars that cross straight on: neither a lane nor a T has a way for both."""
    case = run_case(crossing(), count=5, seed=7)
    assert (
        case.road is None
        and "straight:" in case.refused[""]
        and "t_intersection:" in case.refused[""]
    )
    assert [claim.number for claim in claims_of(case)] == [3], (
        "the primitives can be shown all the same"
    )
    write_page(tmp_path / "out", [case], quality=[], provenance={})
    assert "cannot be placed" in refusals(case)[0]
    assert "cannot be placed" in (tmp_path / "out" / "paper.html").read_text()


def test_it_writes_page_and_figures_and_spares_other_folders(tmp_path):
    out = tmp_path / "out"
    lines = []
    reproduce([[bundled("c")]], out, count=2, seed=7, report=lines.append)
    said = "\n".join(lines)
    assert "synthetic_c on straight" in said and "figure 5, as claimed" in said
    assert sorted(path.name for path in out.iterdir()) == [MARKER, "paper.html", "paper.json"]
    assert "log synthetic_c" in json.loads((out / "paper.json").read_text())["provenance"]
    with pytest.raises(InputError, match="name another folder"):
        reproduce([[Path(bundled("c"))]], Path(bundled("c")), count=4, seed=1)
