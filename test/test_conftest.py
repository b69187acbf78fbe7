# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A worker that crashes ends the run, and in CI what is skipped without a known reason has failed."""

import os
from pathlib import Path
import re
import subprocess
import sys


def test_a_worker_that_crashes_ends_the_run_and_its_test_is_named(tmp_path):
    """With the words of the Makefile: without one of them the others wait for ever."""
    tests = Path(__file__).parent
    (tmp_path / "conftest.py").write_text((tests / "conftest.py").read_text())
    (tmp_path / "support").symlink_to(tests / "support")
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers =\n  recorded\n  spread\n  long\n")
    (tmp_path / "test_crash.py").write_text("import os\ndef test_crash(): os.abort()\n")
    (tmp_path / "test_skip.py").write_text(
        "import pytest\ndef test_skip(): pytest.skip('no disk')\n"
    )
    words = re.search(
        r"^PYTEST := .* pytest (.*)$",
        (Path(__file__).parents[1] / "Makefile").read_text(),
        re.MULTILINE,
    )[1]
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-p",
        "no:cacheprovider",
        *words.split(),
        "-n",
        "2",
        str(tmp_path),
    ]
    variables = {name: value for name, value in os.environ.items() if name != "PYTEST_ADDOPTS"}
    variables |= {"PYTHONPATH": str(tmp_path), "CI": "true"}
    run = subprocess.run(
        command,
        cwd=tmp_path,
        env=variables,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert run.returncode == 1, run.stdout + run.stderr
    assert {"FAILED test_crash.py::test_crash", "FAILED test_skip.py::test_skip"} <= set(
        re.findall(r"FAILED [\w.:]+", run.stdout)
    )
