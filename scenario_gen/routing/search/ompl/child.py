# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""What runs in the child process of `planners`; its server imports this module once, and every child starts from there."""

import os
from time import process_time
from typing import Any

import numpy as np

from scenario_gen.roads.clearance import segment_free
from scenario_gen.routing.search.ompl.solve import solve

segment_free(np.full((2, 2), 0.5), 0.5, 0.5, 0.5, 0.5, 0.0)  # load the kernel here, not in every child


def search(answer: Any, request: tuple[Any, ...], iterations: int | None, seconds: float | None, seed: int) -> None:
    """The child's work."""
    clearance, ends, radius, name, config = request
    started = process_time()

    def stop(calls: int) -> bool:
        return (iterations is not None and calls > iterations) or (seconds is not None and process_time() - started > seconds)

    found = solve(clearance, ends, radius, name, stop, step=config.step or None, seed=seed, simplify=config.simplify)
    answer.send((found.simplified, found.checks, process_time() - started))
    answer.close()
    os._exit(0)  # OMPL's destructors are among the things that crash
