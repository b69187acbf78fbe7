# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Local minimization without derivatives.

Source: Hooke & Jeeves, "Direct search" solution of numerical and statistical problems, 1961.
"""

from collections.abc import Callable

import numpy as np

from scenario_gen.numerics.arrays import Floats


def pattern_search(
    costs: Callable[[Floats], Floats], states: Floats, step: Floats, min_step: float
) -> tuple[Floats, Floats]:
    """Descend from some states by the best step along an axis; return the last states and costs.

    Args:
        costs: returns the costs (M,) of states (M, K).
        states: (R, K) the initial states; each descends by itself.
        step: (K,) the initial steps; a state halves its own when none of them lowers its cost.
        min_step: the search ends when the first step is not larger.
    """
    states, lowest = states.copy(), costs(states)
    steps = np.tile(step, (len(states), 1))
    directions = np.concatenate((np.eye(len(step)), -np.eye(len(step))))
    moving = np.arange(len(states))
    while len(moving):
        trials = states[moving, None] + directions * steps[moving, None]
        trial_costs = costs(np.concatenate(trials)).reshape(trials.shape[:2])
        # the first of equal ones on every CPU
        best = np.arange(len(moving)), np.argmin(np.round(trial_costs, 9), axis=1)
        lower = trial_costs[best] < lowest[moving] - 1e-9
        states[moving[lower]] = trials[best][lower]
        lowest[moving[lower]] = trial_costs[best][lower]
        steps[moving[~lower]] /= 2.0
        moving = moving[steps[moving, 0] > min_step]
    return states, lowest
