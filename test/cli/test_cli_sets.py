# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Sets of results on the command line: two seeds side by side, and any bag as a page."""

import json
import sys

import pytest

from scenario_gen.base.folders import MARKER
from scenario_gen.cli import commands as cli
from scenario_gen.logs.synthetic import bundled


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Results of the same request with two seeds."""
    folder = tmp_path_factory.mktemp("results")
    for seed in (1, 2):
        request = ["generate", str(bundled("b")), "--road", "t_intersection", "--count", "6", "--seed", str(seed)]
        compare = ["--compare"] if seed == 1 else []
        assert run(*request, *compare, "--set", "evaluation.resamples=100", "--out", str(folder / f"seed_{seed}")) == 0
    return folder


def run(*arguments):
    """Run the command line in this process; return its exit code."""
    before, sys.argv = sys.argv, ["scenario-gen", *map(str, arguments)]
    try:
        cli.main()
    except SystemExit as end:
        return end.code or 0
    finally:
        sys.argv = before
    return 0


def test_two_seeds_are_compared_metric_by_metric(results, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    assert run("compare", results / "seed_1", results / "seed_2") == 0
    said = capsys.readouterr().out
    assert "seed_1" in said and "seed_2" in said and "synthetic_b on t_intersection" in said
    row = next(line for line in said.splitlines() if "E, position" in line or "E position" in line)
    figures = [json.loads((results / f"seed_{k}" / "evaluation.json").read_text())["cases"][0] for k in (1, 2)]
    values = [next(r for r in case["rows"] if r["name"] == "with changepoints")["values"]["e_position"] for case in figures]
    assert values[0]["value"] != values[1]["value"], "another seed, other scenarios"
    for value in values:
        assert f"{value['value']:.3g}" in row
    assert [any(row["name"] == "uniform changepoints" for row in case["rows"]) for case in figures] == [True, False]


def test_sets_without_a_case_in_common_are_refused(results, tmp_path, capsys):
    document = json.loads((results / "seed_1" / "evaluation.json").read_text())
    document["cases"][0]["road"] = "elsewhere"
    (tmp_path / "evaluation.json").write_text(json.dumps(document))
    assert run("compare", results / "seed_1", tmp_path) == 2
    assert "no encounter on the same road in common" in capsys.readouterr().err


def test_a_bag_is_evaluated_to_a_page_figures_and_a_table(results, tmp_path, capsys):
    out = tmp_path / "again"
    assert run("evaluate", results / "seed_1" / "bag", "--out", out) == 0
    assert sorted(path.name for path in out.iterdir()) == [MARKER, "evaluation.json", "evaluation.md", "report.html"]
    page = (out / "report.html").read_text()
    assert page.startswith("<!doctype html>") and "<b>6</b> of 6 scenarios asked for" in page
    made = json.loads((results / "seed_1" / "evaluation.json").read_text())["cases"][0]
    again = json.loads((out / "evaluation.json").read_text())["cases"][0]
    (expected,) = [row["values"] for row in made["rows"] if row["name"] == "with changepoints"]
    (found,) = [row["values"] for row in again["rows"] if row["name"] == "scenarios"]
    for key in ("e_position", "e_speed", "diversity", "min_distance"):
        assert found[key]["value"] == pytest.approx(expected[key]["value"], rel=1e-4), key
