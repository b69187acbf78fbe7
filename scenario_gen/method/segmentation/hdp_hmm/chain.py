# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One chain of the weak-limit blocked Gibbs sampler for the sticky HDP-HMM.

Source: Fox, Sudderth, Jordan, Willsky 2011, algorithm 3; its steps are named beside the lines.

The prior's ν0 and κ0 are drawn from a grid, emissions integrated out. ν0 determines how similar
the states' covariances are, κ0 the distance of their means relative to their spread. Both
determine the cost of another state, so neither is fixed.
"""

import numpy as np

from scenario_gen.method.segmentation.hdp_hmm.emission import (
    accumulate,
    add_sample,
    block_likelihood,
    block_log_likelihood,
    BLOCK_SAMPLES,
    blurred,
    cholesky,
    draw_emission,
    log_marginal,
    posterior_factor,
)
from scenario_gen.method.segmentation.hdp_hmm.model import (
    DATA,
    Data,
    GRID,
    Grid,
    Hyper,
    HYPERS,
    Joint,
    Out,
    OUTPUT,
    START,
    Start,
    States,
    Statistics,
)
from scenario_gen.method.segmentation.hdp_hmm.random import pick, State, uniform
from scenario_gen.method.segmentation.hdp_hmm.split_merge import split_or_merge
from scenario_gen.method.segmentation.hdp_hmm.tails import draw_masses, log_masses
from scenario_gen.method.segmentation.hdp_hmm.transitions import (
    count_transitions,
    log_transitions,
    sample_transitions,
)
from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.kernels import I, kernel
from scenario_gen.numerics.loops import column_sums, copy_rows, copy_to


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


TRACE = ("log_joint", "occupied", "gamma", "alpha_kappa", "rho")
MIN_MESSAGE_RATIO = 1e-30  # a smaller sum of a message is rescaled
REFRESH_ITERATIONS = 20  # sweeps after which statistics are accumulated anew
PRIOR_ITERATIONS = 3  # sweeps after which the prior is drawn


@kernel(inline=True)
def backward_step(row: Floats, columns: Floats, message: Floats, rescale: bool) -> None:
    """Multiply `row` (L,), a sample's likelihoods, by `message` (L,); compute the next message.

    Only ratios within a row or a message matter, so they are rescaled only against underflow: a
    step shrinks a message by a factor of 1e-100 at most (see `dirichlet_draw`), so that every
    second step suffices.
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
        rescale_small(message)


@kernel(inline=True, forced=True)
def rescale_small(message: Floats) -> None:
    """Scale a message (L,) to sum 1 if its sum is small."""
    total = 0.0
    for j in range(len(message)):
        total += message[j]
    if total < MIN_MESSAGE_RATIO:
        for j in range(len(message)):
            message[j] /= total


@kernel(inline=True, forced=True)
def ignore_unobserved(mass: Floats, block: Floats) -> None:
    """Make all states equally likely, in block (L, BLOCK), where the mass (n,) is 0."""
    for t in range(len(mass)):
        if not mass[t] > 0.0:
            block[:, t] = 0.0


@kernel(inline=True, merged=True)
def backward_messages(data: Data, emitted: States, hyper: Hyper, pi: Floats, w: Floats) -> None:
    """Fill w (T, L) with likelihood times backward message (step 1), each row up to a factor.

    Transition rows are pi (L + 1, L); the last one is the initial distribution.
    """
    ends, states = data.ends, w.shape[1]
    block = np.empty((states, BLOCK_SAMPLES))
    work = np.empty((2, BLOCK_SAMPLES))
    best = np.empty(BLOCK_SAMPLES)
    message = np.ones(states)
    columns = np.empty((states, states))
    for j in range(states):
        for k in range(states):
            columns[k, j] = pi[j, k]
    last = len(ends) - 1
    stop = w.shape[0]
    while stop > 0:
        start = max(0, stop - BLOCK_SAMPLES)
        block_log_likelihood(data.vt, start, stop, emitted, hyper.weight, hyper.dof, block, best)
        ignore_unobserved(data.mass[start:stop], block)
        block_likelihood(block, stop - start, best, work, w[start:stop])
        for t in range(stop - 1, start - 1, -1):
            if last >= 0 and t + 1 == ends[last]:
                last -= 1
                message[:] = 1.0
            backward_step(w[t], columns, message, t % 2 == 0)
        stop = start


@kernel(inline=True)
def sample_labels(state: State, w: Floats, pi: Floats, ends: Ints, labels: Ints) -> None:
    """Draw labels (T,) forward in time (step 2) from w (T, L), see `backward_messages`."""
    samples, states = w.shape
    share = np.empty(states)
    whole = states - states % 4
    sequence = 0
    previous = states
    for t in range(samples):
        row, chances = w[t], pi[previous]
        for k in range(states):
            share[k] = chances[k] * row[k]
        s0, s1, s2, s3 = 0.0, 0.0, 0.0, 0.0  # four independent sums
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
        elif u > share[previous]:  # most samples stay in the state of the one before
            previous = pick(share, u - float(share[previous]), previous)
        labels[t] = previous
        if t + 1 == ends[sequence]:
            sequence += 1
            previous = states


@kernel(inline=True)
def update_outer(
    v: Floats, before: Ints, labels: Ints, mass: Floats, outer: Floats, sums: Floats
) -> None:
    """Update the statistics (see `accumulate`) from labels `before` (T,) to `labels` (T,).

    Few labels change in a sweep.
    """
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


@kernel(inline=True, merged=True)
def draw_samples(
    state: State, data: Data, emitted: States, hyper: Hyper, pi: Floats, w: Floats, labels: Ints
) -> None:
    """Draw labels (T,) and masses, given transitions pi (L + 1, L) and emissions.

    w (T, L) is work space.
    """
    backward_messages(data, emitted, hyper, pi, w)
    sample_labels(state, w, pi, data.ends, labels)
    if hyper.dof > 0.0:
        draw_masses(state, data, labels, emitted, hyper)


@kernel(inline=True)
def fit_states(stats: Statistics, joint: Joint) -> None:
    """Fill the factors and marginal likelihoods of all states from their other statistics."""
    for k in range(len(stats.marginal)):
        posterior_factor(stats.outer[k], stats.sums[k, 1], joint, stats.factors[k])
        n = joint.weight * stats.sums[k, 0]
        stats.marginal[k] = log_marginal(stats.factors[k], n, joint)


@kernel(inline=True)
def draw_emissions(state: State, stats: Statistics, joint: Joint, emitted: States) -> None:
    """Draw the emissions of all states from their posteriors."""
    for k in range(len(stats.marginal)):
        coef = emitted.coef[k]
        emitted.shape[k, 0] = draw_emission(
            state, stats.factors[k], joint.weight * stats.sums[k, 0], joint, coef
        )
        emitted.shape[k, 1] = blurred(coef, joint.blur)


@kernel(inline=True)
def write_trace(
    data: Data, hyper: Hyper, stats: Statistics, base: float, top: Floats, row: Floats
) -> None:
    """Fill row (5,), see TRACE; `base` is the log marginal likelihood of no samples."""
    counts = column_sums(stats.n)
    used, gain = 0, 0.0
    for k in range(len(counts)):
        if counts[k] > 0:
            used += 1
            gain += stats.marginal[k] - base
    row[0] = log_transitions(stats.n, top[1], top[2], top[3:]) + gain
    if hyper.dof > 0.0:
        row[0] += log_masses(data.mass, hyper.weight * len(hyper.blur), hyper.dof)
    row[1] = used
    copy_to(row[2:], top)


@kernel(inline=True)
def new_statistics(states: int, m: int) -> Statistics:
    """Return room for the statistics of L states of samples of M numbers."""
    return Statistics(
        np.empty((states, m, m)),
        np.empty((states, 2)),
        np.empty((states, m, m)),
        np.empty(states),
        np.empty((states + 1, states), np.int64),
    )


@kernel(inline=True)
def update_statistics(
    data: Data, hyper: Hyper, sweep: int, before: Ints, labels: Ints, stats: Statistics
) -> None:
    """Bring the sums of the statistics from labels `before` (T,) to `labels` (T,)."""
    is_due = sweep < 0 or sweep % REFRESH_ITERATIONS == REFRESH_ITERATIONS - 1
    if hyper.dof > 0.0 or is_due:
        accumulate(data.v, labels, data.mass, stats.outer, stats.sums)
    else:
        update_outer(data.v, before, labels, data.mass, stats.outer, stats.sums)


@kernel(DATA, GRID, HYPERS, START, OUTPUT, I)
def run_chain(data: Data, grid: Grid, hyper: Hyper, start: Start, out: Out, seed: int) -> None:
    """Run one chain from `start`.

    Every row of `out.trace` is one sweep; the last ones also leave their labels in `out.samples`.
    """
    m, states, sweeps = data.v.shape[1], len(out.emissions), len(out.trace)
    burn = sweeps - len(out.samples)
    state = np.empty(1, np.uint64)
    state[0] = np.uint64(seed)
    labels, before = start.labels.copy(), start.labels.copy()
    stats = new_statistics(states, m)
    emitted = States(out.emissions, np.empty((states, 2)))
    pi, w = np.empty((states + 1, states)), np.empty((len(labels), states))
    g0, factor = np.empty((m, m)), np.empty((m, m))
    top, chosen = start.top, start.chosen
    extra, worth = grid.extras[chosen[0]], grid.worths[chosen[1]]
    base, joint = set_prior(grid, extra, worth, hyper, g0, factor)
    for sweep in range(-1, sweeps):
        if sweep >= 0:
            draw_samples(state, data, emitted, hyper, pi, w, labels)  # steps 1 and 2
        update_statistics(data, hyper, sweep, before, labels, stats)
        if sweep % PRIOR_ITERATIONS == 0:
            sample_prior(state, stats, grid, hyper, chosen, g0, factor)
            extra, worth = grid.extras[chosen[0]], grid.worths[chosen[1]]
            base, joint = set_prior(grid, extra, worth, hyper, g0, factor)
        fit_states(stats, joint)
        count_transitions(labels, data.ends, stats.n)
        for _ in range(hyper.moves if sweep >= 0 else 0):
            split_or_merge(state, data, joint, top, labels, stats)
        copy_to(before, labels)
        sample_transitions(state, stats.n, hyper.levels, top, top[3:], pi)  # steps 3 to 5
        draw_emissions(state, stats, joint, emitted)
        if sweep >= 0:
            write_trace(data, hyper, stats, base, top, out.trace[sweep])
        if sweep >= burn:
            copy_to(out.samples[sweep - burn], labels)
