"""One chain of the weak-limit blocked Gibbs sampler for the sticky HDP-HMM (Fox, Sudderth, Jordan, Willsky 2011)."""

import math

import numpy as np

from scenario_gen.arrays import Floats, Ints
from scenario_gen.kernels import F1, F2, I1, OUT1, OUT2, OUT3, OUTI1, OUTI2, F, I, kernel
from scenario_gen.segmentation._emission import (
    BLOCK,
    accumulate,
    block_log_likelihood,
    cholesky,
    draw_emission,
    log_marginal,
)
from scenario_gen.segmentation._random import (
    State,
    dirichlet_draw,
    log_beta_draw,
    log_gamma_draw,
    tables_draw,
    uniform,
)

TRACE = ("log_joint", "occupied", "gamma", "alpha_kappa", "rho")
HYPER = ("gamma_shape", "gamma_rate", "alpha_kappa_shape", "alpha_kappa_rate", "rho_a", "rho_b")


@kernel(inline=True)
def sample_labels(
    state: State, vt: Floats, coef: Floats, logdet: Floats, weight: float, pi: Floats, ends: Ints, labels: Ints, w: Floats
) -> None:
    """Draw all labels: backward messages, then forward sampling (Fox et al., algorithm 3, steps 1-2).

    Args:
        state: generator.
        vt: (M, T) samples; several sequences stand one after the other.
        coef: (L, D, M) and logdet (L,) the emissions.
        logdet: see coef.
        weight: what a sample counts for.
        pi: (L + 1, L) transition rows; the last is the initial distribution.
        ends: index one past the last sample of each sequence.
        labels: (T,) output.
        w: (T, L) work; becomes likelihood times message at each sample.
    """
    samples, states = w.shape
    block = np.empty((BLOCK, states))
    work = np.empty((2, BLOCK))
    message = np.ones(states)
    columns = np.ascontiguousarray(pi[:states].T)
    last = len(ends) - 1
    stop = samples
    while stop > 0:
        start = max(0, stop - BLOCK)
        block_log_likelihood(vt, start, stop, coef, logdet, weight, block, work)
        for t in range(stop - 1, start - 1, -1):
            if last >= 0 and t + 1 == ends[last]:
                last -= 1
                for k in range(states):
                    message[k] = 1.0
            log_row = block[t - start]
            row = w[t]
            top = log_row[0]
            for k in range(1, states):
                top = max(top, log_row[k])
            for k in range(states):
                row[k] = 0.0
                if log_row[k] - top > -300.0:
                    row[k] = math.exp(log_row[k] - top) * message[k]
            for j in range(states):
                message[j] = 0.0
            for k in range(states):
                c = row[k]
                if c > 0.0:
                    for j in range(states):
                        message[j] += columns[k, j] * c
            total = 0.0
            for j in range(states):
                total += message[j]
            for j in range(states):
                message[j] /= total
        stop = start
    sequence = 0
    previous = states
    for t in range(samples):
        total = 0.0
        for k in range(states):
            message[k] = pi[previous, k] * w[t, k]
            total += message[k]
        u = uniform(state) * total
        k = 0
        while k < states - 1 and u > message[k]:
            u -= message[k]
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
    n[:] = 0
    sequence = 0
    previous = states
    for t in range(len(labels)):
        n[previous, labels[t]] += 1
        previous = labels[t]
        if t + 1 == ends[sequence]:
            sequence += 1
            previous = states


@kernel(inline=True)
def sample_transitions(state: State, n: Ints, hyper: Floats, top: Floats, beta: Floats, pi: Floats) -> None:
    """Draw tables, overrides, γ, β, α+κ, ρ and π given transition counts (Fox et al., algorithm 3, steps 3-5 and appendix).

    Args:
        state: generator.
        n: (L + 1, L) counts.
        hyper: see HYPER.
        top: (γ, α+κ, ρ), updated; hyper[0] <= 0 (or hyper[2], hyper[4]) keeps γ (α+κ, ρ) as it is.
        beta: (L,) updated.
        pi: (L + 1, L) updated.
    """
    states = n.shape[1]
    gamma, total, rho = top[0], top[1], top[2]
    alpha, kappa = (1.0 - rho) * total, rho * total
    tables = np.zeros(states)
    all_tables = 0
    overrides = 0
    log_r = 0.0
    for j in range(states + 1):
        customers = 0
        for k in range(states):
            if n[j, k] == 0:
                continue
            customers += n[j, k]
            if j == states:
                tables[k] += tables_draw(state, n[j, k], alpha * beta[k])
                continue
            m = tables_draw(state, n[j, k], alpha * beta[k] + (kappa if j == k else 0.0))
            all_tables += m
            if j == k:
                share = rho / (rho + beta[k] * (1.0 - rho))
                for _ in range(m):
                    if uniform(state) < share:
                        overrides += 1
                        m -= 1
            tables[k] += m
        if j < states and customers > 0:
            log_r += log_beta_draw(state, total, float(customers))
    considered = 0.0
    for k in range(states):
        considered += tables[k]
    if hyper[0] > 0.0:
        dishes = 0
        for k in range(states):
            dishes += tables_draw(state, int(tables[k]), gamma / states)
        log_eta = log_beta_draw(state, gamma, considered)
        gamma = math.exp(log_gamma_draw(state, hyper[0] + dishes)) / (hyper[1] - log_eta)
    if hyper[4] > 0.0:
        free = float(all_tables - overrides)
        rho = math.exp(log_beta_draw(state, hyper[4] + overrides, hyper[5] + free))
        rho = min(max(rho, 1e-12), 1.0 - 1e-12)
    if hyper[2] > 0.0:
        total = math.exp(log_gamma_draw(state, hyper[2] + all_tables)) / (hyper[3] - log_r)
    top[0], top[1], top[2] = gamma, total, rho
    weights = np.empty(states)
    for k in range(states):
        weights[k] = gamma / states + tables[k]
    dirichlet_draw(state, weights, beta)
    for j in range(states + 1):
        for k in range(states):
            weights[k] = (1.0 - rho) * total * beta[k] + n[j, k]
        if j < states:
            weights[j] += rho * total
        dirichlet_draw(state, weights, pi[j])


@kernel(inline=True)
def log_transitions(n: Ints, top: Floats, beta: Floats) -> float:
    """Return log p(labels | β, α+κ, ρ) with π integrated out."""
    states = n.shape[1]
    alpha, kappa = (1.0 - top[2]) * top[1], top[2] * top[1]
    value = 0.0
    for j in range(states + 1):
        customers = 0
        for k in range(states):
            if n[j, k] > 0:
                a = alpha * beta[k] + (kappa if j == k else 0.0)
                value += math.lgamma(a + n[j, k]) - math.lgamma(a)
                customers += n[j, k]
        if customers > 0:
            a = top[1] if j < states else alpha
            value += math.lgamma(a) - math.lgamma(a + customers)
    return value


@kernel(inline=True)
def merge_gain(n: Ints, i: int, j: int, stay: float, move: float) -> float:
    """Gain in log p(labels) from making states i and j one; rows are Dirichlet with `stay` at home and `move` elsewhere."""
    states = n.shape[1]
    gain = 0.0
    joint_row = 0
    row_i, row_j = 0, 0
    for k in range(states):
        row_i += n[i, k]
        row_j += n[j, k]
        if k not in (i, j):
            joint = n[i, k] + n[j, k]
            joint_row += joint
            gain += math.lgamma(move + joint) - math.lgamma(move + n[i, k]) - math.lgamma(move + n[j, k]) + math.lgamma(move)
            joint = n[k, i] + n[k, j]
            gain += math.lgamma(move + joint) - math.lgamma(move + n[k, i]) - math.lgamma(move + n[k, j]) + math.lgamma(move)
    home = n[i, i] + n[i, j] + n[j, i] + n[j, j]
    joint_row += home
    gain += math.lgamma(stay + home) - math.lgamma(stay)
    gain -= math.lgamma(stay + n[i, i]) - math.lgamma(stay) + math.lgamma(stay + n[j, j]) - math.lgamma(stay)
    gain -= math.lgamma(move + n[i, j]) - math.lgamma(move) + math.lgamma(move + n[j, i]) - math.lgamma(move)
    total = stay + states * move
    gain += math.lgamma(total) - math.lgamma(total + joint_row)
    return gain - 2.0 * math.lgamma(total) + math.lgamma(total + row_i) + math.lgamma(total + row_j)


@kernel(F2, I1, F2, F1, I, F, F, OUT1, OUTI1)
def merge_states(
    v: Floats, ends: Ints, g0: Floats, hyper: Floats, regressors: int, stay: float, move: float, score: Floats, labels: Ints
) -> None:
    """Merge states greedily while the probability of the labels, emissions and transitions integrated out, grows.

    Gibbs sampling alone splits easily and merges with difficulty; this is run on the labels that a chain starts from.

    Args:
        v: (T, M) samples.
        ends: index one past the last sample of each sequence.
        g0: (M, M) joint prior of the emissions.
        hyper: as `run_chain` has it.
        regressors: P.
        stay: prior weight of the own state in a transition row.
        move: prior weight of every other one.
        score: (1,) output, log p(samples | labels).
        labels: (T,) updated; `labels.max() + 1` states.
    """
    m = v.shape[1]
    nu, weight, blur = hyper[6], hyper[7], hyper[8:]
    states = labels.max() + 1
    g = np.empty((states, m, m))
    counts = np.empty(states, np.int64)
    n = np.empty((states + 1, states), np.int64)
    factor = g0.copy()
    cholesky(factor)
    base = log_marginal(factor, 0, regressors, nu)
    own = np.zeros(states)
    data = np.full((states, states), np.nan)
    accumulate(v, labels, g0, weight, blur, g, counts)
    for k in range(states):
        factor[:] = g[k]
        cholesky(factor)
        own[k] = log_marginal(factor, weight * counts[k], regressors, nu) - base
    while True:
        count_transitions(labels, ends, n)
        best, best_i, best_j = 0.0, -1, -1
        for i in range(states):
            for j in range(i):
                if counts[i] == 0 or counts[j] == 0:
                    continue
                if np.isnan(data[i, j]):
                    for a in range(m):
                        for b in range(a + 1):
                            factor[a, b] = g[i, a, b] + g[j, a, b] - g0[a, b]
                    cholesky(factor)
                    data[i, j] = log_marginal(factor, weight * (counts[i] + counts[j]), regressors, nu) - base
                gain = data[i, j] - own[i] - own[j] + merge_gain(n, i, j, stay, move)
                if gain > best:
                    best, best_i, best_j = gain, i, j
        if best_i < 0:
            break
        own[best_j] = data[best_i, best_j]
        own[best_i] = 0.0
        g[best_j] += g[best_i] - g0
        counts[best_j] += counts[best_i]
        counts[best_i] = 0
        for t in range(len(labels)):
            if labels[t] == best_i:
                labels[t] = best_j
        for k in range(states):
            data[best_j, k] = np.nan
            data[k, best_j] = np.nan
    score[0] = own.sum()


@kernel(F2, F2, I1, F2, F1, I1, F1, I, I, I, OUTI2, OUT2, OUT3)
def run_chain(
    v: Floats,
    vt: Floats,
    ends: Ints,
    g0: Floats,
    hyper: Floats,
    start: Ints,
    start_top: Floats,
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
        start_top: (γ, α+κ, ρ) to start from.
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
    labels = start.copy()
    top = start_top.copy()
    g = np.empty((states, m, m))
    counts = np.empty(states, np.int64)
    n = np.empty((states + 1, states), np.int64)
    pi = np.empty((states + 1, states))
    beta = np.full(states, 1.0 / states)
    logdet = np.empty(states)
    w = np.empty((t_max, states))
    factor = g0.copy()
    cholesky(factor)
    base = log_marginal(factor, 0, p, nu)
    for sweep in range(-1, sweeps):
        if sweep >= 0:
            sample_labels(state, vt, emissions, logdet, weight, pi, ends, labels, w)
        count_transitions(labels, ends, n)
        sample_transitions(state, n, hyper, top, beta, pi)
        accumulate(v, labels, g0, weight, blur, g, counts)
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
            samples[sweep - burn] = labels
