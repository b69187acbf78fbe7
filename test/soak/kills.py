# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""SIGKILLs of `mine`, its workers, its scheduler and its way to a store: `python -m benchmarks kills`.

A command that writes a folder is killed at every call to the system in the long form of `test_folder_faults.py` (`PART=tests`).
"""

from collections.abc import Iterator
from pathlib import Path

from figures import Figure, of_benchmark


def run(state: Path) -> Iterator[Figure]:
    """Run the benchmark."""
    yield from of_benchmark("kills", state / "mine.json")
