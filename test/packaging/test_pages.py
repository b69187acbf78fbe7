# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The code that pages show runs: README, tutorial, and the how-to on data; the table of columns is the code's."""

import csv
import doctest
import re
import runpy
import sys

import pytest
from support.source_files import ROOT

from scenario_gen.cli.commands import main

FAILS = "my_planner:MyPlanner"  # the tutorial's bad planner: the command's exit code is 1


def blocks(page):
    """Return (language, text) of each block of code."""
    return re.findall(
        r"^```(sh|python)\n(.*?)^```", (ROOT / page).read_text(), re.MULTILINE | re.DOTALL
    )


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A folder with the examples, in which a page's code runs, and modules that it writes are found."""
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    "page", [pytest.param("docs/tutorial.md", marks=pytest.mark.long), "docs/howto_data.md"]
)
def test_commands_of_a_page_run(page, place, monkeypatch):
    for language, text in blocks(page):
        if language == "python":
            (place / text.partition("\n")[0].removeprefix("# ")).write_text(text)
            continue
        for line in text.splitlines():
            if line.startswith("scenario-gen "):
                monkeypatch.setattr(sys, "argv", line.split())
                with pytest.raises(SystemExit) as end:
                    main()
                assert int(end.value.code or 0) == int(FAILS in line), line


def test_python_of_the_readme_runs(place, capsys):
    exec("\n".join(text for language, text in blocks("README.md") if language == "python"), {})
    assert capsys.readouterr().out


def test_the_tables_of_the_reference_are_the_code_s():
    """Only names are compared, so a better help text needs no new table at once."""
    for name, text in runpy.run_path(ROOT / "docs" / "tables.py")["tables"]().items():
        written = (ROOT / "docs" / "tables" / name).read_text()
        names = [[row[:2] for row in csv.reader(table.splitlines())] for table in (written, text)]
        assert names[0] == names[1], "run: python docs/tables.py"


@pytest.mark.long
@pytest.mark.usefixtures("place")
def test_the_tasks_of_the_library_run_and_are_short():
    pytest.importorskip("matplotlib").use("Agg")
    found = [
        text
        for language, text in blocks("docs/library.md")
        if language == "python" and text.startswith(">>> ")
    ]
    assert len(found) > 12 and max(text.count(">>> ") for text in found) <= 6
    page = doctest.DocTestParser().get_doctest("\n".join(found), {}, "library.md", None, 0)
    told = []
    doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(page, out=told.append)
    assert not told, "".join(told)
