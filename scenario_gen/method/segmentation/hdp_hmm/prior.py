# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The emissions' prior: how alike and how far apart states are is drawn with the emissions integrated out.

ν0 says how alike the states' covariances are, κ0 how far apart their means lie beside their own spread. Both decide what a state
of its own costs, so neither is fixed: each is one of a grid, drawn given the labels.
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


@kernel(inline=True)
def set_prior(
    grid: Grid, extra: float, worth: float, hyper: Hyper, g0: Floats, factor: Floats
) -> tuple[float, Joint]:
    """Return the log marginal likelihood of no samples, and the prior.

    Args:
        grid: M, unit of K and of S0.
        extra: ν0 - D.
        worth: K in its unit.
        hyper: a sample's weight and blur.
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
    factor[:] = g0
    cholesky(factor)
    joint = Joint(g0, d + extra, hyper.weight, hyper.blur)
    return log_marginal(factor, 0.0, joint), joint


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
    """Draw `chosen` (2,), which of the grid's `extras` and `worths` hold, one given the other, from the states' statistics."""
    for side in range(2):
        options = grid.extras if side == 0 else grid.worths
        if len(options) < 2:
            continue
        logs = np.empty(len(options))
        for option in range(len(options)):
            extra = options[option] if side == 0 else grid.extras[chosen[0]]
            worth = options[option] if side == 1 else grid.worths[chosen[1]]
            base, joint = set_prior(grid, extra, worth, hyper, g0, factor)
            logs[option] = grid.odds[option] if side == 1 else 0.0
            for k in range(len(stats.own)):
                if stats.sums[k, 0] > 0.0:
                    posterior_factor(stats.outer[k], stats.sums[k, 1], joint, factor)
                    logs[option] += (
                        log_marginal(factor, hyper.weight * stats.sums[k, 0], joint) - base
                    )
        top = logs.max()
        total = 0.0
        for option in range(len(options)):
            logs[option] = np.exp(logs[option] - top)
            total += logs[option]
        chosen[side] = pick(logs, uniform(state) * total, -1)
