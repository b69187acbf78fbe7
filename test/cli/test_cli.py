# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The command line as a person meets it: results that are whole, and errors that say what to do."""

import json

import pytest

from scenario_gen.bags.storage.bag import read_messages
from scenario_gen.logs.synthetic import bundled

LOG = bundled("c")
QUICK = ("--road", "straight", "--count", "2", "--set", "evaluation.resamples=20")


def test_generate_is_complete_and_reproducible(ran, made, tmp_path):
    code, said, err = ran("generate", LOG, *QUICK, "--seed", 7, "--out", "out", "--json")
    answer = json.loads(said, parse_constant=pytest.fail)
    assert (
        code == 0
        and all((tmp_path / answer[name]).exists() for name in ("report", "bag", "figures"))
        and "2 of 2 scenarios" in err
    )
    assert answer["cases"][0]["scenarios"] == 2 and answer["cases"][0]["vehicles"]
    one, two = (
        [(m.topic, m.data) for m in read_messages(folder / "bag")]
        for folder in (made, tmp_path / "out")
    )
    assert one == two and {topic for topic, _ in one} >= {
        "/map",
        "/tracks",
        "/changepoints",
        "/scenarios",
    }
    figures = json.loads((tmp_path / "out" / "evaluation.json").read_text())
    assert figures["provenance"]["seed"] == "7"
    assert (tmp_path / "out" / "report.html").read_text().startswith("<!doctype html>")
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
