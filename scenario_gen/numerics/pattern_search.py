# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A local minimum without derivatives.

Source: Hooke & Jeeves, "Direct search" solution of numerical and statistical problems, 1961.
"""

from collections.abc import Callable

import numpy as np

from scenario_gen.numerics.arrays import Floats


def pattern_search(
    costs: Callable[[Floats], Floats], state: Floats, step: Floats, least: float
) -> tuple[Floats, float]:
    """Return the state (K,) to which steps along the axes lead, the best first, and its cost.

    Args:
        costs: returns the costs (M,) of states (M, K).
        state: (K,) where it begins.
        step: (K,) the first steps; where none of them is better, they are halved.
        least: of the first component of the last steps.
    """
    cost = float(costs(state[None])[0])
    ways = np.concatenate((np.eye(len(state)), -np.eye(len(state))))
    while step[0] > least:
        trials = state + ways * step
        trial_costs = costs(trials)
        best = int(np.argmin(np.round(trial_costs, 9)))  # of equal ones the first, on every CPU
        if trial_costs[best] < cost - 1e-9:
            state, cost = trials[best], float(trial_costs[best])
        else:
            step = step / 2.0
    return state, cost
