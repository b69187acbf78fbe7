# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The code that pages show runs and prints what they show; the table of columns is the code's."""

import csv
import doctest
import re
import runpy
import shlex
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


def shown_after(page, command):
    """Return the output that a page shows for a command: the next block of text before another command."""
    rest = (ROOT / page).read_text().partition(f"\n{command}\n")[2]
    text, found = rest.partition("```text\n")[::2]
    return found.partition("```")[0] if "```sh" not in text else ""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder as a fresh clone has it, in which the code of pages runs."""
    folder = tmp_path_factory.mktemp("clone")
    (folder / "scenario_gen").mkdir()
    for name in ("examples", "scenario_gen/resources"):
        (folder / name).symlink_to(ROOT / name)
    return folder


@pytest.fixture
def place(folder, monkeypatch):
    """The folder as the current one, where modules that a page writes are found."""
    monkeypatch.chdir(folder)
    monkeypatch.syspath_prepend(folder)
    return folder


LONG = ("tutorial_planner", "howto_planner", "howto_failures", "howto_archives")


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, marks=pytest.mark.long if page.stem in LONG else ())
        for page in sorted((ROOT / "docs").glob("*to*.md"))
        if page.stem.startswith(("tutorial", "howto")) and not page.stem.endswith("_ros")
    ],
    ids=lambda page: page.stem,
)
def test_page_commands_print_what_is_shown(page, place, monkeypatch, capsys):
    for language, text in blocks(page):
        if language == "python":
            (place / text.partition("\n")[0].removeprefix("# ")).write_text(text)
            continue
        for line in text.splitlines():
            program, *words = shlex.split(line)
            monkeypatch.setattr(sys, "argv", words if program == "python" else [program, *words])
            if program == "python":
                runpy.run_path(words[0], run_name="__main__")
            elif program == "scenario-gen":
                with pytest.raises(SystemExit) as end:
                    main()
                assert int(end.value.code or 0) == int(FAILS in line), line
                assert shown_after(page, line) in capsys.readouterr().out


def test_python_of_the_readme_runs(place, capsys):
    exec("\n".join(text for language, text in blocks("README.md") if language == "python"), {})
    shown = (ROOT / "README.md").read_text().partition("```text\n")[2].partition("```")[0]
    assert capsys.readouterr().out == shown


def test_interaction_page_prints_its_output(place, capsys):
    page = (ROOT / "docs" / "interaction.md").read_text()
    ((_, text),) = blocks("docs/interaction.md")
    exec(text, {})
    assert f"\n    {capsys.readouterr().out}" in page


def test_reference_tables_are_current():
    """Only names are compared, so a better help text needs no new table at once."""
    for name, text in runpy.run_path(ROOT / "docs" / "tables.py")["tables"]().items():
        written = (ROOT / "docs" / "tables" / name).read_text()
        names = [[row[:2] for row in csv.reader(table.splitlines())] for table in (written, text)]
        assert names[0] == names[1], "run: python docs/tables.py"


@pytest.mark.usefixtures("place")
def test_library_tasks_run():
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
