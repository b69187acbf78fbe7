# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Every property with new examples, again and again; `make test` draws the same ones every time."""

from collections.abc import Iterator
import json
import os
from pathlib import Path

from figures import Figure, ROOT
from tests import run_file

ROUNDS = int(os.environ.get("SCENARIO_GEN_SOAK_ROUNDS", "20"))


def run(state: Path) -> Iterator[Figure]:
    """Run all files with properties in each round, with a seed of its own; rounds that are done are not run again."""
    found = sorted((ROOT / "test").rglob("test_*.py"))
    files = [str(path.relative_to(ROOT)) for path in found if "\n@given(" in path.read_text()]
    kept = state / "rounds.json"
    rounds: dict[str, list[str]] = json.loads(kept.read_text()) if kept.exists() else {}
    for number in range(1, ROUNDS + 1):
        folder = state / f"round {number}"
        folder.mkdir(exist_ok=True)
        if rounds.get(str(number)) != []:  # one that failed is run again
            draw = ("-m", "hypothesis and not recorded", f"--hypothesis-seed={number}")
            new = {"SCENARIO_GEN_EXAMPLES": "new", "SCENARIO_GEN_TESTS": "short"}
            rounds[str(number)] = [name for name in files if not run_file(folder, name, *draw, **new)[1]]
            kept.write_text(json.dumps(rounds, indent=2) + "\n")
        failed = rounds[str(number)]
        seen = f"not {', '.join(failed)}: {folder}" if failed else "all"
        yield Figure(f"properties hold for new examples, round {number}", f"{len(files)} files", seen, not failed)
