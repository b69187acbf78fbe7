# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Sets of results on the command line: two seeds side by side, and any bag as a page."""

from pathlib import Path
from shutil import copyfile

from scenario_gen import load
from scenario_gen.types import Recorded

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


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
