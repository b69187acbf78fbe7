# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A hundred thousand damaged inputs for every reader and every type of message: errors of ours, or nothing, come out."""

from collections.abc import Iterator
import math
from pathlib import Path

from figures import Figure
from support.harness import fuzz, MEMORY, SECONDS, targets

EXECUTIONS = 100_000


def run(state: Path) -> Iterator[Figure]:
    """Fuzz one target after the other; those that are done are not begun again."""
    for name, target in targets().items():
        record = fuzz(target, state, EXECUTIONS, math.inf)
        found = [f"{failure.count} × {failure.signature}" for failure in record.failures.values()]
        yield Figure(
            promise=f"{name}: damaged inputs end in errors of ours",
            asked=f"{EXECUTIONS}; each ≤ {SECONDS:g} s of CPU and ≤ {MEMORY >> 30} GiB",
            seen=f"{record.executions} in {record.seconds / 60.0:.1f} min: {'; '.join(found) or 'nothing else'}",
            met=not found,
        )
