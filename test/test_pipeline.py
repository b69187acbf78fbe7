# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What terminal, page and figures say of a generated case."""

from io import StringIO
import json
from pathlib import Path

import pytest
from rich.console import Console

from scenario_gen.logs import read_log
from scenario_gen.logs.synthetic import bundled
from scenario_gen.method.evaluation import EvaluationConfig
from scenario_gen.method.sampling import SamplingConfig
from scenario_gen.output.report.summary import summary
from scenario_gen.output.results import write_results
from scenario_gen.pipeline import generate, PipelineConfig

QUICK = EvaluationConfig(resamples=50)


@pytest.fixture(scope="module")
def encounter():
    return read_log(Path(bundled("b"))).encounters[0]


@pytest.fixture(scope="module")
def case(encounter):
    return generate(encounter, "t_intersection", PipelineConfig(evaluation=QUICK), count=4, seed=3)


def printed(case):
    console = Console(width=200, record=True, file=StringIO())
    console.print(summary([case], verbose=True))
    return console.export_text()


def written(case, folder):
    """The page, and the figures of the case."""
    write_results(folder, [case], title="", quality=(), provenance={})
    (figures,) = json.loads((folder / "evaluation.json").read_text())["cases"]
    return (folder / "report.html").read_text(encoding="utf-8"), figures


def test_reactions_are_shown_everywhere(case, encounter, tmp_path):
    said = "vehicle 2 slows for vehicle 1 and passes 1.7 s behind it"
    config = PipelineConfig(evaluation=QUICK, sampling=SamplingConfig(reactions="none"))
    free = generate(encounter, "t_intersection", config, count=2, seed=3)
    for made, kept in ((case, True), (free, False)):
        page, figures = written(made, tmp_path)
        sentence = said if kept else f"{said}: not enforced"
        assert sentence in [
            line.strip().removeprefix("reaction  ") for line in printed(made).splitlines()
        ]
        assert (
            said in page
            and ('class="text">enforced' in page) == kept
            and ("not enforced" in page) != kept
        )
        assert figures["reactions"]["sentences"] == [sentence]
        (edge,) = figures["reactions"]["edges"]
        assert (edge["who"], edge["whom"], edge["kept"]) == ("2", "1", kept) and edge[
            "lag"
        ] == pytest.approx(0.5, abs=0.05)
