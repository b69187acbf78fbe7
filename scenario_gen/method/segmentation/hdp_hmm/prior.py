# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The prior of the emissions, whose ν0 and κ0 are drawn from a grid, emissions integrated out.

ν0 determines how similar the states' covariances are, κ0 the distance of their means relative to
their spread. Both determine the cost of another state, so neither is fixed.
"""

import numpy as np

from scenario_gen.method.segmentation.hdp_hmm.emission import (
    cholesky,
    log_marginal,
    posterior_factor,
)
from scenario_gen.method.segmentation.hdp_hmm.model import Grid, Hyper, Joint, Statistics
from scenario_gen.method.segmentation.hdp_hmm.random import pick, State, uniform
from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.kernels import kernel
from scenario_gen.numerics.loops import copy_rows


@kernel(inline=True)
def set_prior(
    grid: Grid, extra: float, worth: float, hyper: Hyper, g0: Floats, factor: Floats
) -> tuple[float, Joint]:
    """Return the log marginal likelihood of no samples, and the prior.

    Args:
        grid: M, unit of K and of S0.
        extra: ν0 - D.
        worth: K in its unit.
        hyper: weight and blur of a sample.
        g0: (M, M) output, of the prior.
        factor: (M, M) output, its Cholesky factor.
    """
    mean = grid.mean
    d, p = mean.shape
    for i in range(p):
        for j in range(p):
            g0[i, j] = worth * grid.precision[i, j]
    for i in range(d):
        for j in range(p):
            value = 0.0
            for q in range(p):
                value += mean[i, q] * g0[q, j]
            g0[p + i, j] = value
            g0[j, p + i] = value
    for i in range(d):
        for j in range(d):
            value = (extra - 1.0) * grid.within[i, j]
            for q in range(p):
                value += g0[p + i, q] * mean[j, q]
            g0[p + i, p + j] = value
    copy_rows(factor, g0)
    cholesky(factor)
    joint = Joint(g0, d + extra, hyper.weight, hyper.blur)
    return log_marginal(factor, 0.0, joint), joint


@kernel(inline=True)
def log_evidence(
    stats: Statistics, base: float, joint: Joint, weight: float, factor: Floats, value: float
) -> float:
    """Return `value` plus the log marginal likelihood of all states under a prior.

    `base` is that of no samples; factor (M, M) is work space.
    """
    for k in range(len(stats.marginal)):
        if stats.sums[k, 0] > 0.0:
            posterior_factor(stats.outer[k], stats.sums[k, 1], joint, factor)
            value += log_marginal(factor, weight * stats.sums[k, 0], joint) - base
    return value


@kernel(inline=True)
def draw_option(state: State, logs: Floats) -> int:
    """Draw an index with these log probabilities (n,), up to a constant; they are overwritten."""
    top = logs[0]
    for option in range(1, len(logs)):
        top = max(top, logs[option])
    total = 0.0
    for option in range(len(logs)):
        logs[option] = np.exp(logs[option] - top)
        total += logs[option]
    return pick(logs, uniform(state) * total, -1)


@kernel(inline=True)
def sample_prior(
    state: State,
    stats: Statistics,
    grid: Grid,
    hyper: Hyper,
    chosen: Ints,
    g0: Floats,
    factor: Floats,
) -> None:
    """Draw the indices `chosen` (2,) of the grid's `extras` and `worths`, one given the other."""
    for side in range(2):
        count = len(grid.extras) if side == 0 else len(grid.worths)
        if count < 2:
            continue
        logs = np.zeros(count)
        index = chosen.copy()
        for option in range(count):
            index[side] = option
            extra, worth = grid.extras[index[0]], grid.worths[index[1]]
            base, joint = set_prior(grid, extra, worth, hyper, g0, factor)
            odds = grid.odds[option] if side == 1 else 0.0
            logs[option] = log_evidence(stats, base, joint, hyper.weight, factor, odds)
        chosen[side] = draw_option(state, logs)
