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

"""One chain of the weak-limit blocked Gibbs sampler for the sticky HDP-HMM (Fox, Sudderth, Jordan, Willsky 2011)."""

import numpy as np

from scenario_gen import exact
from scenario_gen.arrays import Floats, Ints
from scenario_gen.kernels import F1, F2, I, I1, kernel, OUT1, OUT2, OUT3, OUTI2
from scenario_gen.segmentation.hdp_hmm.emission import (
    add_sample,
    BLOCK,
    block_likelihood,
    block_log_likelihood,
    cholesky,
    draw_emission,
    log_marginal,
    posterior,
)
from scenario_gen.segmentation.hdp_hmm.random import dirichlet_draw, log_beta_draw, log_gamma_draw, State, tables_draw, uniform

TRACE = ("log_joint", "occupied", "gamma", "alpha_kappa", "rho")
LEAST_MESSAGE = 1e-30
REFRESH = 20
HYPER = ("gamma_shape", "gamma_rate", "alpha_kappa_shape", "alpha_kappa_rate", "rho_a", "rho_b")


@kernel(inline=True)
def backward_step(row: Floats, columns: Floats, message: Floats) -> None:
    """Turn `row` (L,), the likelihoods of a sample, into likelihood times message; pass `message` (L,) on to the sample before.

    Only ratios within a row or a message count, so they are rescaled no more often than underflow asks for.
    """
    states = len(message)
    for k in range(states):
        row[k] *= message[k]
    for j in range(states):
        message[j] = 0.0
    whole = states - states % 4
    for k in range(0, whole, 4):
        c0, c1, c2, c3 = row[k], row[k + 1], row[k + 2], row[k + 3]
        x0, x1, x2, x3 = columns[k], columns[k + 1], columns[k + 2], columns[k + 3]
        for j in range(states):
            message[j] += (c0 * x0[j] + c1 * x1[j]) + (c2 * x2[j] + c3 * x3[j])
    for k in range(whole, states):
        c0 = row[k]
        for j in range(states):
            message[j] += c0 * columns[k, j]
    total = 0.0
    for j in range(states):
        total += message[j]
    if total < LEAST_MESSAGE:
        for j in range(states):
            message[j] /= total


@kernel(inline=True)
def backward_messages(vt: Floats, coef: Floats, logdet: Floats, weight: float, pi: Floats, ends: Ints, w: Floats) -> None:
    """Fill w (T, L) with likelihood times backward message at each sample (Fox et al., algorithm 3, step 1).

    Args:
        vt: (M, T) samples; several sequences stand one after the other.
        coef: (L, D, M) and logdet (L,) the emissions.
        logdet: see coef.
        weight: what a sample counts for.
        pi: (L + 1, L) transition rows; the last is the initial distribution.
        ends: index one past the last sample of each sequence.
        w: output, each row up to a factor.
    """
    states = w.shape[1]
    block = np.empty((states, BLOCK))
    work = np.empty((2, BLOCK))
    best = np.empty(BLOCK)
    message = np.ones(states)
    columns = np.empty((states, states))
    for j in range(states):
        for k in range(states):
            columns[k, j] = pi[j, k]
    last = len(ends) - 1
    stop = w.shape[0]
    while stop > 0:
        start = max(0, stop - BLOCK)
        block_log_likelihood(vt, start, stop, coef, logdet, weight, block, best)
        block_likelihood(block, stop - start, best, work, w[start:stop])
        for t in range(stop - 1, start - 1, -1):
            if last >= 0 and t + 1 == ends[last]:
                last -= 1
                for k in range(states):
                    message[k] = 1.0
            backward_step(w[t], columns, message)
        stop = start


@kernel(inline=True)
def sample_labels(state: State, w: Floats, pi: Floats, ends: Ints, labels: Ints) -> None:
    """Draw labels (T,) forward in time from w (T, L), see `backward_messages` (Fox et al., algorithm 3, step 2)."""
    samples, states = w.shape
    share = np.empty(states)
    sequence = 0
    previous = states
    for t in range(samples):
        row, chances = w[t], pi[previous]
        for k in range(states):
            share[k] = chances[k] * row[k]
        total = 0.0
        for k in range(states):
            total += share[k]
        u = uniform(state) * total
        k = 0
        while k < states - 1 and u > share[k]:
            u -= share[k]
            k += 1
        labels[t] = k
        previous = k
        if t + 1 == ends[sequence]:
            sequence += 1
            previous = states


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
def sample_tables(state: State, n: Ints, top: Floats, beta: Floats, tables: Floats, sums: Floats) -> None:
    """Draw the tables of every dish in every restaurant, and override those that stickiness alone opened.

    Args:
        state: generator.
        n: (L + 1, L) counts.
        top: (γ, α+κ, ρ).
        beta: (L,).
        tables: (L,) output, tables of each dish that β explains.
        sums: (3,) output: tables of all rows but the initial one, those overridden, Σ log r_j with r_j ~ Beta(α+κ, n_j).
    """
    states = n.shape[1]
    total, rho = top[1], top[2]
    alpha, kappa = (1.0 - rho) * total, rho * total
    sums[0] = sums[1] = sums[2] = 0.0
    for k in range(states):
        tables[k] = tables_draw(state, n[states, k], alpha * beta[k])
    for j in range(states):
        customers = 0
        for k in range(states):
            if k != j and n[j, k] > 0:
                customers += n[j, k]
                opened = tables_draw(state, n[j, k], alpha * beta[k])
                tables[k] += opened
                sums[0] += opened
        customers += n[j, j]
        opened = tables_draw(state, n[j, j], alpha * beta[j] + kappa)
        overridden = 0
        for _ in range(opened):
            if uniform(state) * (rho + beta[j] * (1.0 - rho)) < rho:
                overridden += 1
        tables[j] += opened - overridden
        sums[0] += opened
        sums[1] += overridden
        if customers > 0:
            sums[2] += log_beta_draw(state, total, float(customers))


@kernel(inline=True)
def sample_transitions(state: State, n: Ints, hyper: Floats, top: Floats, beta: Floats, pi: Floats) -> None:
    """Draw γ, β, α+κ, ρ and π given transition counts (Fox et al., algorithm 3, steps 3-5, and appendix).

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
    tables, sums, weights = np.empty(states), np.empty(3), np.empty(states)
    sample_tables(state, n, top, beta, tables, sums)
    if hyper[0] > 0.0:
        dishes = 0
        for k in range(states):
            dishes += tables_draw(state, int(tables[k]), top[0] / states)
        considered = 0.0
        for k in range(states):
            considered += tables[k]
        log_eta = log_beta_draw(state, top[0], considered)
        top[0] = exact.exp(log_gamma_draw(state, hyper[0] + dishes)) / (hyper[1] - log_eta)
    if hyper[2] > 0.0:
        top[1] = exact.exp(log_gamma_draw(state, hyper[2] + sums[0])) / (hyper[3] - sums[2])
    if hyper[4] > 0.0:
        top[2] = exact.exp(log_beta_draw(state, hyper[4] + sums[1], hyper[5] + sums[0] - sums[1]))
        top[2] = min(max(top[2], 1e-9), 1.0 - 1e-9)
    for k in range(states):
        weights[k] = top[0] / states + tables[k]
    dirichlet_draw(state, weights, beta)
    for j in range(states + 1):
        for k in range(states):
            weights[k] = (1.0 - top[2]) * top[1] * beta[k] + n[j, k]
        if j < states:
            weights[j] += top[2] * top[1]
        dirichlet_draw(state, weights, pi[j])


@kernel(inline=True)
def update_outer(v: Floats, before: Ints, labels: Ints, refresh: bool, outer: Floats, counts: Ints) -> None:
    """Bring outer (L, M, M), the states' Σ v vᵀ, and counts (L,) from labels `before` (T,) to `labels`; then `before` is those.

    Few samples change their label in a sweep. `refresh` adds everything up from nothing, so that rounding does not pile up.
    """
    if refresh:
        for k in range(len(counts)):
            counts[k] = 0
            outer[k] = 0.0
    for t in range(len(labels)):
        a, b = before[t], labels[t]
        if refresh or a != b:
            add_sample(v[t], 1.0, outer[b])
            counts[b] += 1
            before[t] = b
            if not refresh:
                add_sample(v[t], -1.0, outer[a])
                counts[a] -= 1
                if counts[a] == 0:
                    outer[a] = 0.0


@kernel(inline=True)
def log_transitions(n: Ints, top: Floats, beta: Floats) -> float:
    """Return log p(labels | β, α+κ, ρ) with π integrated out, from counts n (L + 1, L) and β (L,)."""
    states = n.shape[1]
    alpha, kappa = (1.0 - top[2]) * top[1], top[2] * top[1]
    value = 0.0
    for j in range(states + 1):
        customers = 0
        for k in range(states):
            if n[j, k] > 0:
                a = alpha * beta[k] + (kappa if j == k else 0.0)
                value += exact.lgamma(a + n[j, k]) - exact.lgamma(a)
                customers += n[j, k]
        if customers > 0:
            a = top[1] if j < states else alpha
            value += exact.lgamma(a) - exact.lgamma(a + customers)
    return value


@kernel(F2, F2, I1, F2, F1, I1, OUT1, I, I, I, OUTI2, OUT2, OUT3)
def run_chain(
    v: Floats,
    vt: Floats,
    ends: Ints,
    g0: Floats,
    hyper: Floats,
    start: Ints,
    top: Floats,
    regressors: int,
    seed: int,
    burn: int,
    samples: Ints,
    trace: Floats,
    emissions: Floats,
) -> None:
    """Run one chain from the labels `start`; every output row is one sweep.

    Args:
        v: (T, M) samples (z, y), M = P + D.
        vt: (M, T) the same, transposed.
        ends: index one past the last sample of each sequence.
        g0: (M, M) joint prior of the emissions.
        hyper: hyperpriors (see HYPER), then ν0, the weight of a sample, and the blur of each of the D channels.
        start: (T,) labels to start from, 0 .. L - 1.
        top: (3 + L,) γ, α+κ, ρ and β to start from; updated.
        regressors: P.
        seed: any integer.
        burn: sweeps that are run before the first row of `samples` is kept.
        samples: (S, T) output, labels of the kept sweeps.
        trace: (burn + S, 5) output, see TRACE.
        emissions: (L, D, M) output, `coef` of the last sweep.
    """
    sweeps = trace.shape[0]
    t_max, m = v.shape
    states = emissions.shape[0]
    p = regressors
    nu, weight, blur = hyper[6], hyper[7], hyper[8:]
    state = np.empty(1, np.uint64)
    state[0] = np.uint64(seed)
    labels, before = start.copy(), start.copy()
    outer, g = np.zeros((states, m, m)), np.empty((states, m, m))
    counts = np.zeros(states, np.int64)
    n = np.empty((states + 1, states), np.int64)
    pi = np.empty((states + 1, states))
    beta = top[3:]
    logdet = np.empty(states)
    w = np.empty((t_max, states))
    factor = g0.copy()
    cholesky(factor)
    base = log_marginal(factor, 0, p, nu)
    for sweep in range(-1, sweeps):
        if sweep >= 0:
            backward_messages(vt, emissions, logdet, weight, pi, ends, w)
            sample_labels(state, w, pi, ends, labels)
        count_transitions(labels, ends, n)
        sample_transitions(state, n, hyper, top, beta, pi)
        refresh = sweep % REFRESH == REFRESH - 1
        update_outer(v, before, labels, refresh, outer, counts)
        posterior(outer, counts, g0, weight, blur, g)
        score = log_transitions(n, top, beta)
        occupied = 0
        for k in range(states):
            cholesky(g[k])
            logdet[k] = draw_emission(state, g[k], weight * counts[k], p, nu, blur, emissions[k])
            if counts[k] > 0:
                occupied += 1
                score += log_marginal(g[k], weight * counts[k], p, nu) - base
        if sweep >= 0:
            trace[sweep, 0], trace[sweep, 1] = score, occupied
            trace[sweep, 2], trace[sweep, 3], trace[sweep, 4] = top[0], top[1], top[2]
        if sweep >= burn:
            for t in range(t_max):
                samples[sweep - burn, t] = labels[t]
