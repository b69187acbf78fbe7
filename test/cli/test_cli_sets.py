# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Sets of results on the command line: two seeds side by side, and any bag as a page."""

from pathlib import Path
from shutil import copyfile

from scenario_gen import load
from scenario_gen.types import Recorded

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def test_plus_in_a_name_is_recorded(run, tmp_path):
    log = tmp_path / "north + south.csv"
    copyfile(EXAMPLES / "my_log.csv", log)
    out = tmp_path / "out"
    code, _ = run("generate", log, "--road", "auto", "--count", 2, "--out", out)
    assert code == 0 and "not recorded" not in (out / "report.html").read_text()
    assert load(out / "bag").encounter.source == Recorded()
