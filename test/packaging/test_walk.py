# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The way of one encounter from the command line to the bag is the one that CONTRIBUTING.md shows."""

import ast
import json
from pathlib import Path
import re
import subprocess
import sys

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
MOST_FILES = 13

# Runs `scenario-gen generate` and prints each function entered, in this order, with the function of ours that called it first.
TRACE = """
import json, sys
from pathlib import Path
import scenario_gen
from scenario_gen.cli.commands import app

root = str(Path(scenario_gen.__file__).parents[1]) + "/"
package = root + "scenario_gen/"
entered = {}

def place(frame):
    return frame.f_code.co_filename.removeprefix(root), frame.f_code.co_qualname

def note(frame, event, _):
    if event == "call" and frame.f_code.co_filename.startswith(package) and place(frame) not in entered:
        caller = frame.f_back
        while caller and not caller.f_code.co_filename.startswith(package):
            caller = caller.f_back
        if not caller or caller.f_code.co_name != "<module>":  # what runs while a module is loaded is no step
            entered[place(frame)] = place(caller) if caller else ("", "")

sys.setprofile(note)
try:
    app(sys.argv[1:], standalone_mode=False)
finally:
    sys.setprofile(None)
print(json.dumps(list(entered.items())))
"""


def rows(title: str) -> list[tuple[str, list[str]]]:
    """Return (file, functions) of each row of the tables below a title."""
    section = PAGE.partition(f"## {title}\n")[2].partition("\n## ")[0]
    found = re.findall(r"^\|.*?\| `(scenario_gen/[\w/]+\.py)` \| (`.*?`) \|", section, re.MULTILINE)
    return [(file, re.findall(r"`([\w.]+)`", functions)) for file, functions in found]


def defined(file: str) -> set[str]:
    """Return the names of a file's functions and classes; of a method, `Class.method`."""
    tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
    kinds = (ast.FunctionDef, ast.ClassDef)
    names = {node.name for node in tree.body if isinstance(node, kinds)}
    return names | {
        f"{one.name}.{part.name}"
        for one in tree.body
        if isinstance(one, ast.ClassDef)
        for part in one.body
        if isinstance(part, kinds)
    }


WAY = rows("How does one encounter become a bag?")


@pytest.mark.parametrize(
    ("title", "least"),
    [("How does one encounter become a bag?", 10), ("Where is each equation of the paper?", 12), ("Where is each proof?", 8)],
)
def test_every_function_of_the_page_is_there(title, least):
    assert len(rows(title)) >= least
    assert not [(file, name) for file, names in rows(title) for name in names if name not in defined(file)]


def test_every_equation_algorithm_and_guarantee_has_its_place():
    cells = re.findall(r"^\| ((?:eq|Algorithm)[^|]*) \|", PAGE, re.MULTILINE)
    found: dict[str, set[int]] = {"eq": set(), "Algorithm": set()}
    for cell in cells:
        for word, numbers in re.findall(r"(eq|Algorithm)s? ([\d, –a-e]+)", cell):
            for first, last in re.findall(r"(\d+)[a-e]?(?:–(\d+))?", numbers):
                found[word] |= set(range(int(first), int(last or first) + 1))
    assert found == {"eq": set(range(1, 16)), "Algorithm": set(range(1, 6))}


@pytest.fixture(scope="module")
def entered(tmp_path_factory) -> dict[tuple[str, str], tuple[str, str]]:
    """Each function that one `generate` enters, in order, and who called it first."""
    log, out = ROOT / "scenario_gen" / "resources" / "synthetic_b", tmp_path_factory.mktemp("walk") / "out"
    words = ["generate", str(log), "--road", "t_intersection", "--count", "2", "--out", str(out)]
    command = [sys.executable, "-c", TRACE, *words]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    return {tuple(function): tuple(caller) for function, caller in json.loads(run.stdout.splitlines()[-1])}


def test_an_encounter_takes_the_way_of_the_page(entered, record_property):
    files = [file for file, _ in WAY]
    assert len(set(files)) == len(files) <= MOST_FILES
    places = list(entered)
    assert not [(file, name) for file, names in WAY for name in names if (file, name) not in entered]
    starts = [places.index((file, names[0])) for file, names in WAY]
    assert starts == sorted(starts), "the files are not in the order in which they are entered"
    for k, (file, names) in enumerate(WAY[1:], start=1):
        assert entered[file, names[0]][0] in files[:k], f"{file} is entered from {entered[file, names[0]]}, which is not above it"
    everything = {file for file, _ in entered}
    record_property("files entered", len(everything))
    print(f"{len(everything)} files entered, {len(files)} of them on the page")
