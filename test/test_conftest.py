# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What conftest.py does to items it does to those of other plugins, too: launch_testing's, ament's linters'."""

import os
from pathlib import Path
import re
import subprocess
import sys

import pytest

STAND_IN = """
import pytest


class Item(pytest.Item):
    def runtest(self):
        self.add_marker("launch_test")


class Module(pytest.File):
    def collect(self):
        yield Item.from_parent(self, name=self.path.stem)


class Linter(pytest.Item):
    def __init__(self, **arguments):
        super().__init__(**arguments)
        self.add_marker("linter")

    def runtest(self):
        pass


class Linted(pytest.File):
    def collect(self):
        yield Linter.from_parent(self, name="lint")


def pytest_pycollect_makemodule(module_path, parent):
    if "launch" in module_path.name:
        return Module.from_parent(parent, path=module_path)


def pytest_collect_file(file_path, parent):
    if file_path.suffix == ".xml":
        return Linted.from_parent(parent, path=file_path)
"""


def copied(folder):
    """Put conftest.py and what it needs into a folder."""
    for name in ("conftest.py", "lengths.py", "skips.py"):
        (folder / name).write_text(Path(__file__).with_name(name).read_text())
    (folder / "pytest.ini").write_text("[pytest]\nmarkers =\n  launch_test\n  linter\n  recorded\n  spread\n  long\n")


def run_tests(folder, *words):
    """Run pytest there, with what lies there importable."""
    variables = {name: value for name, value in os.environ.items() if name != "PYTEST_ADDOPTS"}
    path = os.pathsep.join([str(folder), variables.get("PYTHONPATH", "")])
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *words, str(folder)]
    variables |= {"PYTHONPATH": path, "CI": "true"}
    return subprocess.run(command, cwd=folder, env=variables, capture_output=True, text=True, check=False, timeout=60)


def test_a_worker_that_crashes_ends_the_run_with_the_name_of_its_test(tmp_path):
    """With the words of the Makefile: without one of them the others wait for ever."""
    copied(tmp_path)
    (tmp_path / "test_crash.py").write_text("import os\ndef test_crash(): os.abort()\n")
    for name in "abc":
        (tmp_path / f"test_{name}.py").write_text(f"def test_{name}(): ...\n")
    makefile = (Path(__file__).parents[1] / "Makefile").read_text()
    run = run_tests(tmp_path, *re.search(r"^PYTEST := .* pytest (.*)$", makefile, re.MULTILINE)[1].split())
    assert run.returncode == 1 and "FAILED test_crash.py::test_crash" in run.stdout, run.stdout + run.stderr


@pytest.mark.parametrize(
    "words", [("-p", "no:xdist", "--strict-markers"), ("-n", "2", "--dist", "loadgroup")], ids=["alone", "two workers"]
)
def test_items_of_other_plugins_need_no_fixture_names(tmp_path, words):
    copied(tmp_path)
    (tmp_path / "stand_in.py").write_text(STAND_IN)
    (tmp_path / "test_launch.py").write_text("def generate_test_description(): ...\n")
    (tmp_path / "package.xml").write_text("<package/>\n")
    (tmp_path / "test_plain.py").write_text("def test_it(tmp_path): ...\n")
    run = run_tests(tmp_path, "-p", "stand_in", *words)
    assert "3 passed" in run.stdout and run.returncode == 0, run.stdout + run.stderr
