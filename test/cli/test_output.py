# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What commands print: --version, --quiet, --json; tables in which nothing is cut off; the page of a bag."""

import io
import json
import shutil

import pytest

from scenario_gen.base.terminal import Terminal
from scenario_gen.cli import output


def one_object(text):
    """The object of --json, which is all that standard output has."""
    return json.loads(text, parse_constant=pytest.fail)


@pytest.mark.parametrize(
    ("words", "key", "value"),
    [
        (("evaluate", "{bag}"), "valid", True),
        (("export", "{bag}", "--to", "commonroad", "--out", "written"), "scenarios", 2),
        (("report", "{bag}"), "opened", False),
        (("--parameters",), "command", "--parameters"),
    ],
)
def test_json_is_one_object(ran, made, words, key, value):
    words = [word.format(bag=made / "bag", made=made) for word in words]
    code, out, err = ran(*words, "--json")
    answer = one_object(out)
    assert (code, answer["exit_code"], answer["command"], answer[key]) == (
        0,
        0,
        words[0],
        value,
    ) and err
    if words == ["--parameters"]:
        assert one_object(ran("--json", *words)[1]) == answer


@pytest.mark.parametrize(
    ("words", "said"),
    [(("evaluate", "none"), "none does not exist"), (("evaluate",), "Missing argument")],
)
def test_json_of_an_error_has_it(ran, words, said):
    code, out, err = ran(*words, "--json")
    answer = one_object(out)
    assert (
        code == 2 == answer["exit_code"]
        and said in answer["error"]
        and err.startswith(f"error: {said}")
    )


def test_quiet_prints_errors_only(ran, made):
    assert ran("evaluate", made / "bag", "--quiet") == (0, "", "")
    assert ran("-q", "evaluate", made / "bag") == (0, "", "")
    code, out, err = ran("evaluate", "none", "-q")
    assert (code, out) == (2, "") and "does not exist" in err


class Narrow(Terminal):
    """A terminal of 80 columns that keeps what it prints."""

    text = io.StringIO()

    def __init__(self, **_):
        super().__init__(file=Narrow.text, width=80, force_terminal=True, color_system=None)


COLUMNS = ("template", "kind", "road", *(f"figure_{k}" for k in range(8)))
ROW = (
    "20120401-0815-encounter-000017",
    "crossing",
    "t_intersection",
    *("123.45" for _ in range(8)),
)


@pytest.mark.parametrize("columns", [3, 11])
def test_table_in_80_columns_is_whole(monkeypatch, columns):
    monkeypatch.setattr("scenario_gen.base.terminal.Terminal", Narrow)
    Narrow.text = io.StringIO()
    output.print_table(COLUMNS[:columns], [ROW[:columns]], names=3)
    text = Narrow.text.getvalue()
    assert "…" not in text and all(len(line) <= 80 for line in text.splitlines())
    assert all(word in text for word in (*ROW[:columns], *COLUMNS[3:columns]))


def test_page_of_generate_is_reused(ran, made, tmp_path):
    for bag in (made, made / "bag"):
        _, out, _ = ran("report", bag, "--no-open")
        assert out.strip() == f"report: {made / 'report.html'}"
    shutil.copytree(made / "bag", "other")
    _, out, _ = ran("report", "other")
    assert out.strip().splitlines()[-1] == f"report: {tmp_path / 'other_report' / 'report.html'}"
    assert (tmp_path / "other_report" / "report.html").is_file()
