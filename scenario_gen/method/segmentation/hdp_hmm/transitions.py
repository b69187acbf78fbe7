# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Labels' transitions: counts, what they say of concentrations and stickiness, and draws of π (Fox et al. 2011, algorithm 3)."""

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

# Hyperpriors in the order of `hyper`; what follows them there is the weight of a sample, the noise's degrees of freedom (0:
# Gaussian) and the blur of each of the D channels.
HYPER = ("gamma_shape", "gamma_rate", "alpha_kappa_shape", "alpha_kappa_rate", "rho_a", "rho_b")
SLICE_WIDTH = 1.0
MOST_STEPS = 8
SLICE_ROUNDS = 1


@kernel(inline=True)
def count_transitions(labels: Ints, ends: Ints, n: Ints) -> None:
    """Fill n (L + 1, L) with transition counts; the last row counts the first labels of the sequences."""
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
def sample_tables(state: State, n: Ints, top: Floats, beta: Floats, tables: Floats) -> None:
    """Draw the tables of every dish in every restaurant, and override those that stickiness alone opened.

    Args:
        state: generator.
        n: (L + 1, L) counts.
        top: (γ, α+κ, ρ).
        beta: (L,).
        tables: (L,) output, tables of each dish that β explains.
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
    """Return log p(labels | β, α+κ, ρ) with π integrated out, from counts n (L + 1, L) and β (L,)."""
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
    """Log density of x = log(α+κ) and y = logit ρ, given counts n (L + 1, L) and β (L,), π integrated out, up to a constant."""
    total = np.exp(x)
    rho = 1.0 / (1.0 + np.exp(-y))
    value = log_transitions(n, total, rho, beta)
    if hyper[2] > 0.0:
        value += hyper[2] * x - hyper[3] * total
    if hyper[4] > 0.0:
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
    here = x if along == 0 else y
    low = here - SLICE_WIDTH * uniform(state)
    high = low + SLICE_WIDTH
    left = int(MOST_STEPS * uniform(state))
    right = MOST_STEPS - 1 - left
    while left > 0 and along_density(n, hyper, beta, x, y, low, along) > height:
        low -= SLICE_WIDTH
        left -= 1
    while right > 0 and along_density(n, hyper, beta, x, y, high, along) > height:
        high += SLICE_WIDTH
        right -= 1
    while True:
        there = low + (high - low) * uniform(state)
        new = along_density(n, hyper, beta, x, y, there, along)
        if new > height:
            break
        if there < here:
            low = there
        else:
            high = there
    if along == 0:
        return there, y, new
    return x, there, new


@kernel(inline=True)
def along_density(
    n: Ints, hyper: Floats, beta: Floats, x: float, y: float, at: float, along: int
) -> float:
    """`log_concentration` of counts n (L + 1, L) and β (L,) with x or y replaced by `at`."""
    return (
        log_concentration(n, hyper, beta, at, y)
        if along == 0
        else log_concentration(n, hyper, beta, x, at)
    )


@kernel(inline=True)
def sample_stickiness(state: State, n: Ints, hyper: Floats, top: Floats, beta: Floats) -> None:
    """Draw α+κ and ρ, in top (3,), given counts n (L + 1, L) and β (L,), by slices in log(α+κ) and logit ρ.

    Tables and π are integrated out.
    The usual draws given tables (Fox et al. 2011, appendix) move by little: tables nearly determine both.
    """
    x = np.log(top[1])
    y = np.log(top[2] / (1.0 - top[2]))
    value = log_concentration(n, hyper, beta, x, y)
    for _ in range(SLICE_ROUNDS):
        if hyper[2] > 0.0:
            x, y, value = slice_concentration(state, n, hyper, beta, x, y, value, 0)
        if hyper[4] > 0.0:
            x, y, value = slice_concentration(state, n, hyper, beta, x, y, value, 1)
    top[1] = np.exp(x)
    top[2] = min(max(1.0 / (1.0 + np.exp(-y)), 1e-9), 1.0 - 1e-9)


@kernel(inline=True)
def sample_transitions(
    state: State, n: Ints, hyper: Floats, top: Floats, beta: Floats, pi: Floats
) -> None:
    """Draw α+κ, ρ, then γ and β, then π, given transition counts (Fox et al., algorithm 3, steps 3-5, and appendix).

    γ is drawn with β integrated out, exactly for the weak limit: each dish's tables are seated once more, in a
    restaurant of concentration γ / L.

    Args:
        state: generator.
        n: (L + 1, L) counts.
        hyper: see HYPER; a shape (or rho_a) <= 0 keeps that concentration as it is.
        top: (γ, α+κ, ρ), updated.
        beta: (L,) updated.
        pi: (L + 1, L) updated.
    """
    states = n.shape[1]
    tables, weights = np.empty(states), np.empty(states)
    sample_stickiness(state, n, hyper, top, beta)
    sample_tables(state, n, top, beta, tables)
    if hyper[0] > 0.0:
        dishes = 0
        for k in range(states):
            dishes += tables_draw(state, int(tables[k]), top[0] / states)
        considered = 0.0
        for k in range(states):
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
