# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The tests marked `recorded`: what the tests check on data that they make themselves, on data that was recorded."""

from collections.abc import Iterator
from pathlib import Path
import subprocess
import sys

from figures import Figure, ROOT
from lengths import DATA
from tests import run_file


def files() -> list[str]:
    """Return the test files that have such tests."""
    command = [sys.executable, "-m", "pytest", "--collect-only", "-q", "-m", "recorded"]
    said = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return sorted({line.partition("::")[0].partition(": ")[0] for line in said.splitlines() if line.startswith("test/")})


def run(state: Path) -> Iterator[Figure]:
    """Run them file by file; those that have passed are not run again."""
    if not DATA.is_dir():
        yield Figure("recorded data: every test marked `recorded`", "recorded data", f"none at {DATA}", met=False)
        return
    failed = []
    chosen = files()
    for name in chosen:
        passed = state / f"{name.replace('/', '.')}.passed"
        if not passed.exists():
            if run_file(state, name, "-m", "recorded")[1]:
                passed.touch()
            else:
                failed.append(name)
    seen = f"{len(chosen) - len(failed)} of {len(chosen)}" + (f"; not {', '.join(failed)}" if failed else "")
    yield Figure("recorded data: every test marked `recorded`", f"{len(chosen)} files", seen, not failed)
