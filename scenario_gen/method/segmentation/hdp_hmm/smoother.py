# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Smoothing of a hidden Markov model with known parameters."""

import numpy as np

from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.kernels import F1, F2, I1, kernel, OUT1, OUT2
from scenario_gen.numerics.loops import copy_to

MIN_LOG_RATIO = -600.0  # of a density to the best state's


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
