# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A hidden Markov model with known parameters: densities, forward-backward smoothing, and the statistics its emissions need."""

import math
from typing import NamedTuple

import numpy as np

from scenario_gen.method.segmentation.hdp_hmm.emission import add_sample
from scenario_gen.method.segmentation.hdp_hmm.observed import log_radial, without_hidden
from scenario_gen.numerics import Bools, Floats, Ints
from scenario_gen.numerics.kernels import B2, F, F1, F2, F3, I1, kernel, named, OUT1, OUT2

LEAST_LOG = -600.0


@kernel(F2, B2, F3, F, F, OUT2)
def log_densities(
    v: Floats, hidden: Bools, coef: Floats, weight: float, dof: float, out: Floats
) -> None:
    """Fill out (T, K) with log p(y_t | z_t, state), hidden channels integrated out; 0 where none was observed.

    A weight below 1 tempers the density as the sampler does; then it is known up to a constant of each sample.

    Args:
        v: (T, P + D) rows (z, y), finite also where hidden.
        hidden: (T, D) which channels of y were not observed.
        coef: (K, D, P + D) emissions, see `draw_emission`.
        weight: what a sample counts for.
        dof: degrees of freedom of Student-t noise; 0: Gaussian.
        out: output.
    """
    states, d = coef.shape[0], coef.shape[1]
    p = coef.shape[2] - d
    factor, shift = np.empty((d, d)), np.empty(d)
    for k in range(states):
        whole = 0.0
        for i in range(d):
            whole += np.log(coef[k, i, p + i])
        for t in range(len(v)):
            seen = d - hidden[t].sum()
            if seen == 0:
                out[t, k] = 0.0
                continue
            square, half = without_hidden(v[t], hidden[t], coef[k], factor, shift)
            n = weight * seen
            out[t, k] = weight * (whole - half) + log_radial(square, n, weight, dof)
            if dof > 0.0:
                out[t, k] += (
                    math.lgamma(0.5 * (dof + n))
                    - math.lgamma(0.5 * dof)
                    - 0.5 * n * np.log(math.pi * dof)
                )
            else:
                out[t, k] -= 0.5 * n * np.log(2.0 * math.pi)


@kernel(inline=True)
def scaled(row: Floats) -> float:
    """Scale row (K,) to sum to 1; returns the sum that it had."""
    total = 0.0
    for k in range(len(row)):
        total += row[k]
    for k in range(len(row)):
        row[k] /= total
    return total


@kernel(inline=True)
def relative_likelihood(log_density: Floats, out: Floats) -> float:
    """Fill out (K,) with the exponentials of log_density (K,) less its largest, which is returned."""
    best: float = log_density.max()
    for k in range(len(out)):
        out[k] = np.exp(max(log_density[k] - best, LEAST_LOG))
    return best


@kernel(F2, F2, F1, I1, OUT2, OUT1)
def smooth(
    log_density: Floats,
    transition: Floats,
    initial: Floats,
    ends: Ints,
    out: Floats,
    changed: Floats,
) -> float:
    """Fill out (T, K) with the posterior probability of each state; returns log p(samples) (Rabiner 1989, III-A and V-A, scaled).

    Args:
        log_density: (T, K) of each sample under each state.
        transition: (K, K) rows sum to 1.
        initial: (K,) of the first state of every sequence.
        ends: index one past the last sample of each sequence.
        out: output, rows sum to 1.
        changed: (T,) output, probability that the state differs from that of the sample before; 0 where a sequence begins.
    """
    samples, states = log_density.shape
    likelihood, ahead, message = np.empty(states), np.empty(states), np.ones(states)
    total = 0.0
    sequence = 0
    ahead[:] = initial
    for t in range(samples):
        total += relative_likelihood(log_density[t], likelihood)
        for k in range(states):
            out[t, k] = ahead[k] * likelihood[k]
        total += np.log(scaled(out[t]))
        if t + 1 == ends[sequence]:
            sequence += 1
            ahead[:] = initial
        else:
            for k in range(states):
                ahead[k] = 0.0
                for j in range(states):
                    ahead[k] += out[t, j] * transition[j, k]
    for t in range(samples - 1, -1, -1):
        if t + 1 == ends[sequence - 1]:
            sequence -= 1
            message[:] = 1.0
        relative_likelihood(log_density[t], likelihood)
        for k in range(states):
            out[t, k] *= message[k]
            likelihood[k] *= message[k]
        scaled(out[t])
        stays, whole = 0.0, 0.0
        for j in range(states):
            message[j] = 0.0
            for k in range(states):
                message[j] += transition[j, k] * likelihood[k]
            if t > 0:
                stays += out[t - 1, j] * transition[j, j] * likelihood[j]
                whole += out[t - 1, j] * message[j]
        begins = t == 0 or (sequence > 0 and t == ends[sequence - 1])
        changed[t] = 0.0 if begins else 1.0 - stays / whole
        scaled(message)
    return total


@kernel(inline=True)
def fill_hidden(
    hidden: Bools,
    factor: Floats,
    shift: Floats,
    share: float,
    inverse: Floats,
    y: Floats,
    outer: Floats,
) -> None:
    """Put the hidden channels of y (D,) at their means given the others, and add `share` × their covariance to outer (D, D).

    Args:
        hidden: (D,).
        factor: (D, D) R, see `without_hidden`: the covariance is (R Rᵀ)⁻¹.
        shift: (D,) see there.
        share: what the sample counts for.
        inverse: (D, D) work space, for R⁻¹.
        y: updated.
        outer: updated; lower triangle.
    """
    at = np.flatnonzero(hidden)
    a = len(at)
    for j in range(a):
        for i in range(a):
            value = 1.0 if i == j else 0.0
            for q in range(i):
                value -= factor[i, q] * inverse[q, j]
            inverse[i, j] = value / factor[i, i]
    for b in range(a):
        y[at[b]] = 0.0
        for q in range(a):
            y[at[b]] -= inverse[q, b] * shift[q]
        for c in range(b + 1):
            for q in range(a):
                outer[at[b], at[c]] += share * inverse[q, b] * inverse[q, c]


class Rows(NamedTuple):
    """Samples and what is known of them.

    Attributes:
        v: (T, P + D) rows (z, y), finite also where hidden.
        hidden: (T, D) which channels of y were not observed.
        unused: (T, D) the same, and all channels that say nothing of their own about how far off a sample is.
        weight: what a sample counts for.
        dof: degrees of freedom of Student-t noise; 0: Gaussian.
    """

    v: Floats
    hidden: Bools
    unused: Bools
    weight: float
    dof: float


@kernel(named(Rows, F2, B2, B2, F, F), F1, F2, OUT2, OUT1)
def expected_statistics(
    rows: Rows, share: Floats, coef: Floats, outer: Floats, sums: Floats
) -> None:
    """Fill the expected statistics of one state: hidden channels and the masses of heavy-tailed noise at their conditional means.

    Args:
        rows: T samples.
        share: (T,) probability that the sample is this state's; 0 leaves it out.
        coef: (D, P + D) emission, see `draw_emission`.
        outer: (P + D, P + D) output, Σ share E[mass v vᵀ].
        sums: (2,) output, Σ share and Σ share E[mass].
    """
    v, hidden, unused, weight, dof = rows
    d, m = coef.shape
    p = m - d
    factor, inverse, shift, row = np.empty((d, d)), np.empty((d, d)), np.empty(d), np.empty(m)
    outer[:] = 0.0
    sums[:] = 0.0
    for t in range(len(v)):
        if not share[t] > 0.0:
            continue
        mass = 1.0
        if dof > 0.0:
            seen = weight * (d - unused[t].sum())
            mass = (dof + seen) / (
                dof + weight * without_hidden(v[t], unused[t], coef, factor, shift)[0]
            )
        row[:] = v[t]
        if hidden[t].any():
            without_hidden(v[t], hidden[t], coef, factor, shift)
            fill_hidden(hidden[t], factor, shift, share[t], inverse, row[p:], outer[p:, p:])
        sums[0] += share[t]
        sums[1] += share[t] * mass
        add_sample(row, share[t] * mass, outer)
    for i in range(m):
        for j in range(i):
            outer[j, i] = outer[i, j]
