# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What runs in the child process of `planners`; its server imports this module once, and every child starts from there."""

import os
from time import process_time
from typing import Any

import numpy as np

from scenario_gen.method.routing.search.ompl.solve import Options, solve
from scenario_gen.roads import segment_free

segment_free(
    np.full((2, 2), 0.5), 0.5, 0.5, 0.5, 0.5, 0.0
)  # load the kernel here, not in every child


def search(
    answer: Any, request: tuple[Any, ...], iterations: int | None, seconds: float | None, seed: int
) -> None:
    """The child's work."""
    clearance, ends, radius, name, config = request
    started = process_time()

    def stop(calls: int) -> bool:
        return (iterations is not None and calls > iterations) or (
            seconds is not None and process_time() - started > seconds
        )

    solution = solve(
        clearance, ends, radius, name, stop, Options(config.step or None, config.simplify), seed
    )
    answer.send((solution.simplified, solution.checks, process_time() - started))
    answer.close()
    os._exit(0)  # OMPL's destructors are among the things that crash
