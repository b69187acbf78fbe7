# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A hidden Markov model with known parameters: densities, smoothing, expected statistics."""

import math
from typing import NamedTuple

import numpy as np

from scenario_gen.method.segmentation.hdp_hmm.emission import add_sample
from scenario_gen.method.segmentation.hdp_hmm.observed import log_radial, without_hidden
from scenario_gen.numerics import Bools, Floats, Ints
from scenario_gen.numerics.kernels import B2, F, F1, F2, F3, I1, kernel, named, OUT1, OUT2
from scenario_gen.numerics.loops import copy_to

MIN_LOG_RATIO = -600.0  # of a density to the best state's


@kernel(F2, B2, F3, F, F, OUT2, on_demand=True)
def log_densities(
    v: Floats, hidden: Bools, coef: Floats, weight: float, dof: float, out: Floats
) -> None:
    """Fill out (T, K) with log p(y_t | z_t, state), hidden channels integrated out.

    It is 0 where no channel was observed. A weight below 1 tempers the density as in the sampler;
    the density is then known up to a constant per sample.

    Args:
        v: (T, P + D) rows (z, y), finite also where hidden.
        hidden: (T, D) which channels of y were not observed.
        coef: (K, D, P + D) emissions, see `draw_emission`.
        weight: of a sample.
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
    """Scale row (K,) to sum 1; return the sum that it had."""
    total = 0.0
    for k in range(len(row)):
        total += row[k]
    for k in range(len(row)):
        row[k] /= total
    return total


@kernel(inline=True)
def relative_likelihood(log_density: Floats, out: Floats) -> float:
    """Fill out (K,) with exp(log_density - its maximum), and return the maximum."""
    best: float = log_density.max()
    for k in range(len(out)):
        out[k] = np.exp(max(log_density[k] - best, MIN_LOG_RATIO))
    return best


@kernel(inline=True)
def predict(filtered: Floats, transition: Floats, ahead: Floats) -> None:
    """Fill ahead (K,) with the probabilities one sample after those of `filtered` (K,)."""
    for k in range(len(ahead)):
        ahead[k] = 0.0
        for j in range(len(ahead)):
            ahead[k] += filtered[j] * transition[j, k]


@kernel(inline=True)
def filter_forward(
    log_density: Floats, transition: Floats, initial: Floats, ends: Ints, out: Floats
) -> float:
    """Fill out (T, K) with the probability of each state given its past; return log p(samples)."""
    samples, states = log_density.shape
    likelihood, ahead = np.empty(states), np.empty(states)
    total = 0.0
    sequence = 0
    copy_to(ahead, initial)
    for t in range(samples):
        total += relative_likelihood(log_density[t], likelihood)
        for k in range(states):
            out[t, k] = ahead[k] * likelihood[k]
        total += np.log(scaled(out[t]))
        if t + 1 == ends[sequence]:
            sequence += 1
            copy_to(ahead, initial)
        else:
            predict(out[t], transition, ahead)
    return total


@kernel(inline=True)
def pass_back(transition: Floats, likelihood: Floats, before: Floats, message: Floats) -> float:
    """Fill message (K,) for the sample before; return the probability of a change of state.

    Args:
        transition: (K, K).
        likelihood: (K,) of this sample and all later ones.
        before: (K,) filtered probabilities of the sample before.
        message: (K,) output, up to a factor.
    """
    stays, whole = 0.0, 0.0
    for j in range(len(message)):
        message[j] = 0.0
        for k in range(len(message)):
            message[j] += transition[j, k] * likelihood[k]
        stays += before[j] * transition[j, j] * likelihood[j]
        whole += before[j] * message[j]
    return 1.0 - stays / whole


@kernel(F2, F2, F1, I1, OUT2, OUT1, on_demand=True)
def smooth(
    log_density: Floats,
    transition: Floats,
    initial: Floats,
    ends: Ints,
    out: Floats,
    changed: Floats,
) -> float:
    """Fill out (T, K) with the posterior probability of each state; return log p(samples).

    Source: Rabiner 1989, III-A and V-A, scaled.

    Args:
        log_density: (T, K) of each sample under each state.
        transition: (K, K) rows sum to 1.
        initial: (K,) of the first state of every sequence.
        ends: one past the index of the last sample of each sequence.
        out: output, rows sum to 1.
        changed: (T,) output, probability that the state differs from that of the sample before; 0
            at the start of a sequence.
    """
    samples, states = log_density.shape
    likelihood, message = np.empty(states), np.ones(states)
    total = filter_forward(log_density, transition, initial, ends, out)
    sequence = len(ends)
    for t in range(samples - 1, -1, -1):
        if t + 1 == ends[sequence - 1]:
            sequence -= 1
            message[:] = 1.0
        relative_likelihood(log_density[t], likelihood)
        for k in range(states):
            out[t, k] *= message[k]
            likelihood[k] *= message[k]
        scaled(out[t])
        change = pass_back(transition, likelihood, out[max(t - 1, 0)], message)
        begins = t == 0 or (sequence > 0 and t == ends[sequence - 1])
        changed[t] = 0.0 if begins else change
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
    """Set the hidden channels of y (D,) to their means given the others.

    Their covariance times `share` is added to outer (D, D).

    Args:
        hidden: (D,).
        factor: (D, D) R, see `without_hidden`: the covariance is (R Rᵀ)⁻¹.
        shift: (D,) see there.
        share: of the sample.
        inverse: (D, D) work space, for R⁻¹.
        y: updated.
        outer: updated; lower triangle.
    """
    channels = np.flatnonzero(hidden)
    a = len(channels)
    invert(factor, a, inverse)
    for b in range(a):
        i = channels[b]
        y[i] = 0.0
        for q in range(a):
            y[i] -= inverse[q, b] * shift[q]
        for c in range(b + 1):
            for q in range(a):
                outer[i, channels[c]] += share * inverse[q, b] * inverse[q, c]


@kernel(inline=True)
def invert(factor: Floats, n: int, inverse: Floats) -> None:
    """Fill inverse (D, D) with that of the leading (n, n) part of the triangular factor (D, D)."""
    for j in range(n):
        for i in range(n):
            value = 1.0 if i == j else 0.0
            for q in range(i):
                value -= factor[i, q] * inverse[q, j]
            inverse[i, j] = value / factor[i, i]


class Rows(NamedTuple):
    """Samples and what is known of them.

    Attributes:
        v: (T, P + D) rows (z, y), finite also where hidden.
        hidden: (T, D) which channels of y were not observed.
        unused: (T, D) the same, and all channels that follow from others.
        weight: of a sample.
        dof: degrees of freedom of Student-t noise; 0: Gaussian.
    """

    v: Floats
    hidden: Bools
    unused: Bools
    weight: float
    dof: float


@kernel(named(Rows, F2, B2, B2, F, F), F1, F2, OUT2, OUT1, on_demand=True)
def expected_statistics(
    rows: Rows, share: Floats, coef: Floats, outer: Floats, sums: Floats
) -> None:
    """Fill the expected statistics of one state, given its emission.

    Hidden channels and the masses of heavy-tailed noise have their conditional means.

    Args:
        rows: T samples.
        share: (T,) probability that the sample has this state; samples of 0 do not count.
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
        copy_to(row, v[t])
        if hidden[t].any():
            without_hidden(v[t], hidden[t], coef, factor, shift)
            fill_hidden(hidden[t], factor, shift, share[t], inverse, row[p:], outer[p:, p:])
        sums[0] += share[t]
        sums[1] += share[t] * mass
        add_sample(row, share[t] * mass, outer)
    for i in range(m):
        for j in range(i):
            outer[j, i] = outer[i, j]
