# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Damaged inputs for every reader and every type of message, ten minutes each: errors of ours, or nothing, come out.

`make soak PART=fuzz MINUTES=1` is shorter.
"""

from collections.abc import Iterator
from dataclasses import asdict
from functools import partial
import os
from pathlib import Path
import sys

from figures import Figure, kept
from fuzzing.harness import fuzz, MEMORY, SECONDS, targets

MINUTES = float(os.environ.get("MINUTES", "10"))


def run(state: Path) -> Iterator[Figure]:
    """Fuzz one target after the other; those that are done are not begun again."""
    for name, target in targets().items():
        make = partial(fuzz, target, state, sys.maxsize, 60.0 * MINUTES)
        record = kept(state / f"{name}.json", lambda make=make: asdict(make()))
        yield Figure(
            promise=f"{name}: damaged inputs end in errors of ours",
            asked=f"{MINUTES:g} min; each ≤ {SECONDS:g} s of CPU and ≤ {MEMORY >> 30} GiB",
            seen=f"{record['executions']}: {'; '.join(record['failures']) or 'nothing else'}",
            met=not record["failures"],
        )
