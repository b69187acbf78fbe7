# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The tests marked `recorded`: what the tests check on data that they make themselves, on data that was recorded."""

from collections.abc import Iterator
from pathlib import Path
import subprocess
import sys

from figures import Figure, ROOT
from support.lengths import DATA
from tests import run_files

PROMISE = "recorded data: every test marked `recorded`"


def run(state: Path) -> Iterator[Figure]:
    """Run the files that have such tests."""
    if not DATA.is_dir():
        yield Figure(PROMISE, "recorded data", f"none at {DATA}", met=False)
        return
    command = [sys.executable, "-m", "pytest", "--collect-only", "-q", "-m", "recorded"]
    said = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    files = {
        line.partition("::")[0].partition(": ")[0]
        for line in said.splitlines()
        if line.startswith("test/")
    }
    yield run_files(state, PROMISE, sorted(files), "-m", "recorded")
