# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The emissions' prior: how alike and how far apart states are is drawn with the emissions integrated out.

ν0 says how alike the states' covariances are, κ0 how far apart their means lie beside their own spread. Both decide what a state
of its own costs, so neither is fixed: each is one of a grid, drawn given the labels.
"""

import numpy as np

from scenario_gen.method.segmentation.hdp_hmm.emission import cholesky, log_marginal, posterior_factor
from scenario_gen.method.segmentation.hdp_hmm.random import pick, State, uniform
from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.kernels import kernel


@kernel(inline=True)
def set_prior(
    mean: Floats, precision: Floats, within: Floats, extra: float, worth: float, g0: Floats, factor: Floats
) -> tuple[float, float]:
    """Fill g0 (M, M), see `emission`; returns the log marginal of no samples, and ν0.

    Args:
        mean: (D, P) M.
        precision: (P, P) of which K is `worth` times.
        within: (D, D) of which S0 is (ν0 - D - 1) times.
        extra: ν0 - D.
        worth: see precision.
        g0: output.
        factor: (M, M) output, its Cholesky factor.
    """
    d, p = mean.shape
    for i in range(p):
        for j in range(p):
            g0[i, j] = worth * precision[i, j]
    for i in range(d):
        for j in range(p):
            value = 0.0
            for q in range(p):
                value += mean[i, q] * g0[q, j]
            g0[p + i, j] = value
            g0[j, p + i] = value
    for i in range(d):
        for j in range(d):
            value = (extra - 1.0) * within[i, j]
            for q in range(p):
                value += g0[p + i, q] * mean[j, q]
            g0[p + i, p + j] = value
    factor[:] = g0
    cholesky(factor)
    return log_marginal(factor, 0.0, p, d + extra), d + extra


@kernel(inline=True)
def sample_prior(
    state: State,
    outer: Floats,
    sums: Floats,
    mean: Floats,
    precision: Floats,
    within: Floats,
    extras: Floats,
    worths: Floats,
    odds: Floats,
    weight: float,
    blur: Floats,
    chosen: Ints,
    g0: Floats,
    factor: Floats,
) -> None:
    """Draw `chosen` (2,), which of `extras` and `worths` hold, one given the other, from the states' statistics.

    `odds` (B,) are the logarithms of how probable each of `worths` is beforehand.
    """
    p = mean.shape[1]
    for side in range(2):
        options = extras if side == 0 else worths
        if len(options) < 2:
            continue
        logs = np.empty(len(options))
        for option in range(len(options)):
            extra = options[option] if side == 0 else extras[chosen[0]]
            worth = options[option] if side == 1 else worths[chosen[1]]
            base, nu = set_prior(mean, precision, within, extra, worth, g0, factor)
            logs[option] = odds[option] if side == 1 else 0.0
            for k in range(len(outer)):
                if sums[k, 0] > 0.0:
                    posterior_factor(outer[k], sums[k, 1], g0, weight, blur, factor)
                    logs[option] += log_marginal(factor, weight * sums[k, 0], p, nu) - base
        top = logs.max()
        total = 0.0
        for option in range(len(options)):
            logs[option] = np.exp(logs[option] - top)
            total += logs[option]
        chosen[side] = pick(logs, uniform(state) * total, -1)
