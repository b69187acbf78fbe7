# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Every property with new examples, again and again; `make test` draws the same ones every time."""

from collections.abc import Iterator
import os
from pathlib import Path

from figures import Figure, ROOT
from tests import run_files, test_files

ROUNDS = int(os.environ.get("SCENARIO_GEN_SOAK_ROUNDS", "20"))
NEW = {"SCENARIO_GEN_EXAMPLES": "new", "SCENARIO_GEN_TESTS": "short"}


def run(state: Path) -> Iterator[Figure]:
    """Run all files with properties in each round, with a seed of its own."""
    files = [name for name in test_files() if "\n@given(" in (ROOT / name).read_text()]
    for number in range(1, ROUNDS + 1):
        draw = ("-m", "hypothesis and not recorded", f"--hypothesis-seed={number}")
        promise = f"properties hold for new examples, round {number}"
        yield run_files(state / f"round {number}", promise, files, *draw, **NEW)
