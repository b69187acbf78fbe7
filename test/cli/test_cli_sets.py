# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Sets of results on the command line: two seeds side by side, and any bag as a page."""

import json
from pathlib import Path
from shutil import copyfile

import pytest

from scenario_gen import load
from scenario_gen.base.folders import MARKER
from scenario_gen.types import Recorded

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def test_a_bag_is_evaluated_to_a_page_figures_and_a_table(results, run, tmp_path):
    out = tmp_path / "again"
    assert run("evaluate", results / "seed_1" / "bag", "--out", out)[0] == 0
    assert sorted(path.name for path in out.iterdir()) == [
        MARKER,
        "evaluation.json",
        "evaluation.md",
        "report.html",
    ]
    page = (out / "report.html").read_text()
    assert page.startswith("<!doctype html>") and "<b>2</b> of 2 requested scenarios" in page
    made = json.loads((results / "seed_1" / "evaluation.json").read_text())["cases"][0]
    again = json.loads((out / "evaluation.json").read_text())["cases"][0]
    (expected,) = [row["values"] for row in made["rows"] if row["name"] == "with changepoints"]
    (found,) = [row["values"] for row in again["rows"] if row["name"] == "scenarios"]
    for key in ("e_position", "e_speed", "diversity", "min_distance"):
        assert found[key]["value"] == pytest.approx(expected[key]["value"], rel=1e-4), key


def test_a_long_run_is_announced_before_it(run, tmp_path, monkeypatch):
    words = ("generate", EXAMPLES / "my_log.csv", "--road", "four_way", "--count", 1)
    assert "or more" not in run(*words, "--out", tmp_path / "short")[1]
    monkeypatch.setattr("scenario_gen.cli.folder.LONG_RUN_S", 0.1)
    assert "1 encounters on roads take 0.0 min or more" in run(*words, "--out", tmp_path / "b")[1]


def test_a_log_whose_name_has_a_plus_is_a_recording(run, tmp_path):
    log = tmp_path / "north + south.csv"
    copyfile(EXAMPLES / "my_log.csv", log)
    out = tmp_path / "out"
    code, _ = run("generate", log, "--road", "auto", "--count", 2, "--out", out)
    assert code == 0 and "not recorded" not in (out / "report.html").read_text()
    assert load(out / "bag").encounter.source == Recorded()
