# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Transitions: counts, concentrations, stickiness, and draws of β and π.

Source: Fox et al. 2011, algorithm 3 and appendix.
"""

import math

import numpy as np

from scenario_gen.method.segmentation.hdp_hmm.random import (
    dirichlet_draw,
    log_beta_draw,
    log_gamma_draw,
    State,
    tables_draw,
    uniform,
)
from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.kernels import kernel

# Hyperpriors, in the order of `hyper`.
HYPER = ("gamma_shape", "gamma_rate", "alpha_kappa_shape", "alpha_kappa_rate", "rho_a", "rho_b")
SLICE_WIDTH_LOG_RATIO = 1.0
MAX_OUT_STEPS = 8


@kernel(inline=True)
def count_transitions(labels: Ints, ends: Ints, n: Ints) -> None:
    """Fill n (L + 1, L) with transition counts; the last row counts first labels."""
    states = n.shape[1]
    for j in range(states + 1):
        for k in range(states):
            n[j, k] = 0
    sequence = 0
    previous = states
    for t in range(len(labels)):
        n[previous, labels[t]] += 1
        previous = labels[t]
        if t + 1 == ends[sequence]:
            sequence += 1
            previous = states


@kernel(inline=True)
def predecessors(n: Ints, k: int) -> int:
    """Return the number of rows of n (L + 1, L), except row k, that enter state k.

    It is at least 1 if any row enters it: a lower bound of the number of tables of state k.
    """
    count = 0
    for j in range(n.shape[0]):
        if j != k and n[j, k] > 0:
            count += 1
    return 1 if count == 0 and n[k, k] > 0 else count


@kernel(inline=True)
def chosen_state(counts: Ints, number: int, occupied: bool) -> int:
    """Return state number `number` of the occupied states by counts (L,), or of the empty ones."""
    for k in range(len(counts)):
        if (counts[k] > 0) == occupied:
            if number == 0:
                return k
            number -= 1
    return -1


@kernel(inline=True)
def count_used(counts: Ints) -> int:
    """Return the number of occupied states by counts (L,)."""
    used = 0
    for k in range(len(counts)):
        if counts[k] > 0:
            used += 1
    return used


@kernel(inline=True)
def sample_tables(state: State, n: Ints, top: Floats, beta: Floats, tables: Floats) -> None:
    """Draw the tables m_jk of every dish k in every restaurant j, less the overridden ones.

    Args:
        state: generator.
        n: (L + 1, L) counts.
        top: (γ, α+κ, ρ).
        beta: (L,).
        tables: (L,) output, tables of each dish that β explains: Σ_j m_jk without the sticky ones.
    """
    states = n.shape[1]
    total, rho = top[1], top[2]
    alpha, kappa = (1.0 - rho) * total, rho * total
    for k in range(states):
        tables[k] = tables_draw(state, n[states, k], alpha * beta[k])
    for j in range(states):
        for k in range(states):
            if k != j and n[j, k] > 0:
                tables[k] += tables_draw(state, n[j, k], alpha * beta[k])
        opened = tables_draw(state, n[j, j], alpha * beta[j] + kappa)
        overridden = 0
        for _ in range(opened):
            if uniform(state) * (rho + beta[j] * (1.0 - rho)) < rho:
                overridden += 1
        tables[j] += opened - overridden


@kernel(inline=True)
def log_rising(a: float, n: int) -> float:
    """Return log Γ(a + n) / Γ(a); small n are multiplied out."""
    if n > 6:
        return math.lgamma(a + n) - math.lgamma(a)
    product = a
    for i in range(1, n):
        product *= a + i
    return math.log(product)


@kernel(inline=True)
def log_transitions(n: Ints, total: float, rho: float, beta: Floats) -> float:
    """Return log p(labels | β, α+κ, ρ), π integrated out, from counts n (L + 1, L), β (L,)."""
    states = n.shape[1]
    alpha, kappa = (1.0 - rho) * total, rho * total
    value = 0.0
    for j in range(states + 1):
        customers = 0
        for k in range(states):
            if n[j, k] > 0:
                value += log_rising(alpha * beta[k] + (kappa if j == k else 0.0), n[j, k])
                customers += n[j, k]
        if customers > 0:
            value -= log_rising(total if j < states else alpha, customers)
    return value


@kernel(inline=True)
def log_concentration(n: Ints, hyper: Floats, beta: Floats, x: float, y: float) -> float:
    """Return the log density of x = log(α+κ) and y = logit ρ, π integrated out, up to a constant.

    Given are counts n (L + 1, L) and β (L,).
    """
    total = np.exp(x)
    rho = 1.0 / (1.0 + np.exp(-y))
    value: float = log_transitions(n, total, rho, beta)
    value += hyper[2] * x - hyper[3] * total
    value += hyper[4] * np.log(rho) + hyper[5] * np.log(1.0 - rho)
    return value


@kernel(inline=True)
def slice_concentration(
    state: State,
    n: Ints,
    hyper: Floats,
    beta: Floats,
    x: float,
    y: float,
    value: float,
    along: int,
) -> tuple[float, float, float]:
    """One slice-sampling step (Neal 2003, stepping out) in x (along = 0) or y (along = 1).

    Args:
        state: generator.
        n: (L + 1, L) counts.
        hyper: (6 or more,) see HYPER.
        beta: (L,).
        x: log(α+κ).
        y: logit ρ.
        value: `log_concentration` there.
        along: see above.

    Returns:
        x and y after the step, and `log_concentration` there.
    """
    height = value + np.log(uniform(state))
    current = x if along == 0 else y
    low = current - SLICE_WIDTH_LOG_RATIO * uniform(state)
    high = low + SLICE_WIDTH_LOG_RATIO
    left = int(MAX_OUT_STEPS * uniform(state))
    right = MAX_OUT_STEPS - 1 - left
    while left > 0 and along_density(n, hyper, beta, x, y, low, along) > height:
        low -= SLICE_WIDTH_LOG_RATIO
        left -= 1
    while right > 0 and along_density(n, hyper, beta, x, y, high, along) > height:
        high += SLICE_WIDTH_LOG_RATIO
        right -= 1
    while True:
        proposed = low + (high - low) * uniform(state)
        new = along_density(n, hyper, beta, x, y, proposed, along)
        if new > height:
            break
        if proposed < current:
            low = proposed
        else:
            high = proposed
    if along == 0:
        return proposed, y, new
    return x, proposed, new


@kernel(inline=True)
def along_density(
    n: Ints, hyper: Floats, beta: Floats, x: float, y: float, at: float, along: int
) -> float:
    """Return `log_concentration` with x (along = 0) or y (along = 1) replaced by `at`."""
    if along == 0:
        return log_concentration(n, hyper, beta, at, y)
    return log_concentration(n, hyper, beta, x, at)


@kernel(inline=True)
def sample_stickiness(state: State, n: Ints, hyper: Floats, top: Floats, beta: Floats) -> None:
    """Draw α+κ and ρ, in top (3,), by slice sampling of log(α+κ) and logit ρ.

    Given are counts n (L + 1, L) and β (L,); tables and π are integrated out. The usual draws
    given the tables (Fox et al. 2011, appendix) mix slowly, since tables nearly determine both.
    """
    x = np.log(top[1])
    y = np.log(top[2] / (1.0 - top[2]))
    value = log_concentration(n, hyper, beta, x, y)
    x, y, value = slice_concentration(state, n, hyper, beta, x, y, value, 0)
    x, y, value = slice_concentration(state, n, hyper, beta, x, y, value, 1)
    top[1] = np.exp(x)
    top[2] = min(max(1.0 / (1.0 + np.exp(-y)), 1e-9), 1.0 - 1e-9)


@kernel(inline=True)
def sample_transitions(
    state: State, n: Ints, hyper: Floats, top: Floats, beta: Floats, pi: Floats
) -> None:
    """Draw α+κ, ρ, then γ and β, then π, given transition counts (steps 3 to 5, and appendix).

    γ is drawn with β integrated out, which is exact for the weak limit: each dish's tables are
    seated again, in a restaurant of concentration γ / L.

    Args:
        state: generator.
        n: (L + 1, L) counts.
        hyper: see HYPER.
        top: (γ, α+κ, ρ), updated.
        beta: (L,) updated.
        pi: (L + 1, L) updated.
    """
    states = n.shape[1]
    tables, weights = np.empty(states), np.empty(states)
    sample_stickiness(state, n, hyper, top, beta)
    sample_tables(state, n, top, beta, tables)
    dishes, considered = 0, 0.0
    for k in range(states):
        dishes += tables_draw(state, int(tables[k]), top[0] / states)
        considered += tables[k]
    log_eta = log_beta_draw(state, top[0], considered)[0]
    top[0] = np.exp(log_gamma_draw(state, hyper[0] + dishes)) / (hyper[1] - log_eta)
    for k in range(states):
        weights[k] = top[0] / states + tables[k]
    dirichlet_draw(state, weights, beta)
    for j in range(states + 1):
        for k in range(states):
            weights[k] = (1.0 - top[2]) * top[1] * beta[k] + n[j, k]
        if j < states:
            weights[j] += top[2] * top[1]
        dirichlet_draw(state, weights, pi[j])
