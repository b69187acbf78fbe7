# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How much a benchmark does: all of it, or with `--quick` next to nothing along the same way, to see that it runs."""

import os
from typing import TypeVar

QUICK = "SCENARIO_GEN_BENCHMARK_QUICK"  # in the environment, so that processes of a benchmark know it too
Size = TypeVar("Size")


def sized(full: Size, quick: Size) -> Size:
    """Return the size that is wanted; figures of the quick one say nothing."""
    return quick if os.environ.get(QUICK) else full
