# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Local minimization without derivatives.

Source: Hooke & Jeeves, "Direct search" solution of numerical and statistical problems, 1961.
"""

from collections.abc import Callable

import numpy as np

from scenario_gen.numerics.arrays import Floats


def pattern_search(
    costs: Callable[[Floats], Floats], state: Floats, step: Floats, min_step: float
) -> tuple[Floats, float]:
    """Descend by the best step along an axis; return the last state (K,) and its cost.

    Args:
        costs: returns the costs (M,) of states (M, K).
        state: (K,) the initial state.
        step: (K,) the initial steps; they are halved when none of them lowers the cost.
        min_step: the search ends when the first step is not larger.
    """
    cost = float(costs(state[None])[0])
    directions = np.concatenate((np.eye(len(state)), -np.eye(len(state))))
    while step[0] > min_step:
        trials = state + directions * step
        trial_costs = costs(trials)
        best = int(np.argmin(np.round(trial_costs, 9)))  # the first of equal ones on every CPU
        if trial_costs[best] < cost - 1e-9:
            state, cost = trials[best], float(trial_costs[best])
        else:
            step = step / 2.0
    return state, cost
