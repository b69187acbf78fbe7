# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One chain of the weak-limit blocked Gibbs sampler for the sticky HDP-HMM (Fox, Sudderth, Jordan, Willsky 2011)."""

import numpy as np

from scenario_gen.method.segmentation.hdp_hmm.emission import (
    accumulate,
    add_sample,
    BLOCK,
    block_likelihood,
    block_log_likelihood,
    blurred,
    draw_emission,
    log_marginal,
    posterior_factor,
)
from scenario_gen.method.segmentation.hdp_hmm.observed import draw_hidden, draw_masses, log_masses, observed_log_likelihood
from scenario_gen.method.segmentation.hdp_hmm.prior import sample_prior, set_prior
from scenario_gen.method.segmentation.hdp_hmm.random import pick, State, uniform
from scenario_gen.method.segmentation.hdp_hmm.split_merge import split_or_merge
from scenario_gen.method.segmentation.hdp_hmm.transitions import count_transitions, log_transitions, sample_transitions
from scenario_gen.numerics import Bools, Floats, Ints
from scenario_gen.numerics.kernels import B2, F1, F2, I, I1, kernel, OUT1, OUT2, OUT3, OUTI1, OUTI2

TRACE = ("log_joint", "occupied", "gamma", "alpha_kappa", "rho")
LEAST_MESSAGE = 1e-30
REFRESH = 20
PRIOR_EVERY = 3


@kernel(inline=True)
def backward_step(row: Floats, columns: Floats, message: Floats, rescale: bool) -> None:
    """Turn `row` (L,), the likelihoods of a sample, into likelihood times message; pass `message` (L,) on to the sample before.

    Only ratios within a row or a message count, so they are rescaled no more often than underflow asks for: a step makes a
    message smaller by a factor of 1e-100 (see `dirichlet_draw`) at most, so that every second is often enough.
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
    if rescale:
        total = 0.0
        for j in range(states):
            total += message[j]
        if total < LEAST_MESSAGE:
            for j in range(states):
                message[j] /= total


@kernel(inline=True)
def backward_messages(
    vt: Floats,
    coef: Floats,
    shape: Floats,
    weight: float,
    dof: float,
    gaps: Ints,
    hidden: Bools,
    pi: Floats,
    ends: Ints,
    w: Floats,
) -> None:
    """Fill w (T, L) with likelihood times backward message at each sample (Fox et al., algorithm 3, step 1).

    Args:
        vt: (M, T) samples; several sequences stand one after the other.
        coef: (L, D, M) emissions, see `draw_emission`.
        shape: (L, 2) the rest of them, see `block_log_likelihood`.
        weight: what a sample counts for.
        dof: degrees of freedom of Student-t noise; 0: Gaussian.
        gaps: (R,) samples with channels that were not observed, rising.
        hidden: (R, D) which.
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
    gap = len(gaps) - 1
    stop = w.shape[0]
    while stop > 0:
        start = max(0, stop - BLOCK)
        block_log_likelihood(vt, start, stop, coef, shape, weight, dof, block, best)
        while gap >= 0 and gaps[gap] >= start:
            observed_log_likelihood(vt[:, gaps[gap]], hidden[gap], coef, shape, weight, dof, block[:, gaps[gap] - start])
            gap -= 1
        block_likelihood(block, stop - start, best, work, w[start:stop])
        for t in range(stop - 1, start - 1, -1):
            if last >= 0 and t + 1 == ends[last]:
                last -= 1
                for k in range(states):
                    message[k] = 1.0
            backward_step(w[t], columns, message, t % 2 == 0)
        stop = start


@kernel(inline=True)
def sample_labels(state: State, w: Floats, pi: Floats, ends: Ints, labels: Ints) -> None:
    """Draw labels (T,) forward in time from w (T, L), see `backward_messages` (Fox et al., algorithm 3, step 2)."""
    samples, states = w.shape
    share = np.empty(states)
    whole = states - states % 4
    sequence = 0
    previous = states
    for t in range(samples):
        row, chances = w[t], pi[previous]
        for k in range(states):
            share[k] = chances[k] * row[k]
        s0, s1, s2, s3 = 0.0, 0.0, 0.0, 0.0  # four sums that do not wait for each other
        for k in range(0, whole, 4):
            s0 += share[k]
            s1 += share[k + 1]
            s2 += share[k + 2]
            s3 += share[k + 3]
        total = (s0 + s1) + (s2 + s3)
        for k in range(whole, states):
            total += share[k]
        u = uniform(state) * total
        if previous == states:
            previous = pick(share, u, -1)
        elif u > share[previous]:  # most samples stay where the one before was: that is looked at first
            previous = pick(share, u - float(share[previous]), previous)
        labels[t] = previous
        if t + 1 == ends[sequence]:
            sequence += 1
            previous = states


@kernel(inline=True)
def update_outer(v: Floats, before: Ints, labels: Ints, mass: Floats, outer: Floats, sums: Floats) -> None:
    """Bring the statistics (see `accumulate`) from labels `before` (T,) to `labels`, few of which change in a sweep."""
    for t in range(len(labels)):
        a, b = before[t], labels[t]
        if a != b and mass[t] > 0.0:
            add_sample(v[t], mass[t], outer[b])
            add_sample(v[t], -mass[t], outer[a])
            sums[b, 0] += 1.0
            sums[b, 1] += mass[t]
            sums[a, 0] -= 1.0
            sums[a, 1] -= mass[t]
            if sums[a, 0] == 0.0:
                outer[a] = 0.0


@kernel(OUT2, OUT2, I1, B2, OUT1, I1, F2, F2, F2, F1, F1, F1, OUTI1, F1, I1, OUT1, I, I, I, I, OUTI2, OUT2, OUT3)
def run_chain(
    v: Floats,
    vt: Floats,
    gaps: Ints,
    hidden: Bools,
    mass: Floats,
    ends: Ints,
    mean: Floats,
    precision: Floats,
    within: Floats,
    extras: Floats,
    worths: Floats,
    odds: Floats,
    chosen: Ints,
    hyper: Floats,
    start: Ints,
    top: Floats,
    regressors: int,
    moves: int,
    seed: int,
    burn: int,
    samples: Ints,
    trace: Floats,
    emissions: Floats,
) -> None:
    """Run one chain from the labels `start`; every output row is one sweep.

    Args:
        v: (T, M) samples (z, y), M = P + D; what is hidden is drawn anew in every sweep.
        vt: (M, T) the same, transposed.
        gaps: (R,) samples with hidden channels, rising.
        hidden: (R, D) which channels were not observed.
        mass: (T,) see `accumulate`, to start from; updated. A sample of which nothing was observed has 0.
        ends: index one past the last sample of each sequence.
        mean: (D, P) prior mean M of the regressions.
        precision: (P, P) their prior precision K is this times one of `worths`.
        within: (D, D) prior mean of the states' covariances; S0 is (ν0 - D - 1) times it.
        extras: (A,) what ν0 - D may be, all equally probable beforehand.
        worths: (B,) what K may be in units of `precision`.
        odds: (B,) logarithms of how probable each is beforehand.
        chosen: (2,) which of them hold now; updated.
        hyper: hyperpriors (see HYPER), then the weight of a sample, the noise's degrees of freedom (0: Gaussian), and the
            blur of each of the D channels.
        start: (T,) labels to start from, 0 .. L - 1.
        top: (3 + L,) γ, α+κ, ρ and β to start from; updated.
        regressors: P.
        moves: split or merge moves that are tried in a sweep.
        seed: any integer.
        burn: sweeps that are run before the first row of `samples` is kept.
        samples: (S, T) output, labels of the kept sweeps.
        trace: (burn + S, 5) output, see TRACE.
        emissions: (L, D, M) output, `coef` of the last sweep.
    """
    sweeps = trace.shape[0]
    t_max, m = v.shape
    states, d = emissions.shape[0], emissions.shape[1]
    p = regressors
    weight, dof, blur = hyper[6], hyper[7], hyper[8:]
    state = np.empty(1, np.uint64)
    state[0] = np.uint64(seed)
    labels, before = start.copy(), start.copy()
    outer, factors = np.empty((states, m, m)), np.empty((states, m, m))
    sums, own = np.empty((states, 2)), np.empty(states)
    n = np.empty((states + 1, states), np.int64)
    pi = np.empty((states + 1, states))
    beta = top[3:]
    shape = np.empty((states, 2))
    w = np.empty((t_max, states))
    g0, factor = np.empty((m, m)), np.empty((m, m))
    base, nu = set_prior(mean, precision, within, extras[chosen[0]], worths[chosen[1]], g0, factor)
    for sweep in range(-1, sweeps):
        if sweep >= 0:
            backward_messages(vt, emissions, shape, weight, dof, gaps, hidden, pi, ends, w)
            sample_labels(state, w, pi, ends, labels)
            if dof > 0.0:
                draw_masses(state, v, labels, emissions, shape, weight, dof, gaps, hidden, mass)
            draw_hidden(state, v, vt, labels, emissions, mass, gaps, hidden)
        if dof > 0.0 or len(gaps) > 0 or sweep < 0 or sweep % REFRESH == REFRESH - 1:
            accumulate(v, labels, mass, outer, sums)
        else:
            update_outer(v, before, labels, mass, outer, sums)
        if sweep % PRIOR_EVERY == 0:
            sample_prior(state, outer, sums, mean, precision, within, extras, worths, odds, weight, blur, chosen, g0, factor)
            base, nu = set_prior(mean, precision, within, extras[chosen[0]], worths[chosen[1]], g0, factor)
        for k in range(states):
            posterior_factor(outer[k], sums[k, 1], g0, weight, blur, factors[k])
            own[k] = log_marginal(factors[k], weight * sums[k, 0], p, nu)
        count_transitions(labels, ends, n)
        if sweep >= 0:
            for _ in range(moves):
                split_or_merge(state, v, mass, ends, g0, p, nu, weight, blur, top, beta, labels, n, outer, sums, factors, own)
        before[:] = labels
        sample_transitions(state, n, hyper, top, beta, pi)
        for k in range(states):
            shape[k, 0] = draw_emission(state, factors[k], weight * sums[k, 0], p, nu, emissions[k])
            shape[k, 1] = blurred(emissions[k], blur)
        if sweep >= 0:
            used = n.sum(axis=0) > 0
            trace[sweep, 0] = log_transitions(n, top[1], top[2], beta) + (own[used] - base).sum()
            trace[sweep, 0] += log_masses(mass, weight * d, dof) if dof > 0.0 else 0.0
            trace[sweep, 1], trace[sweep, 2:] = used.sum(), top[:3]
        if sweep >= burn:
            samples[sweep - burn] = labels
