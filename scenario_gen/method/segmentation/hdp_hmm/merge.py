# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Greedy merging of states by marginal likelihood, which Gibbs sampling alone seldom does."""

import math

import numpy as np

from scenario_gen.method.segmentation.hdp_hmm.emission import (
    accumulate,
    log_marginal,
    posterior_factor,
)
from scenario_gen.method.segmentation.hdp_hmm.model import JOINT, Joint
from scenario_gen.method.segmentation.hdp_hmm.transitions import count_transitions
from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.kernels import F, F1, F2, I1, kernel, OUTI1
from scenario_gen.numerics.loops import add_to


@kernel(inline=True)
def merge_gain(n: Ints, i: int, j: int, stay: float, move: float) -> float:
    """Return the gain in log p(labels) from merging states i and j, by counts n (L + 1, L).

    Rows have Dirichlet priors with `stay` for the state itself and `move` for every other one.
    """
    states = n.shape[1]
    gain: float = 0.0
    joint_row = 0
    row_i, row_j = 0, 0
    for k in range(states):
        row_i += n[i, k]
        row_j += n[j, k]
        if k not in (i, j):
            joint = n[i, k] + n[j, k]
            joint_row += joint
            gain += (
                math.lgamma(move + joint)
                - math.lgamma(move + n[i, k])
                - math.lgamma(move + n[j, k])
                + math.lgamma(move)
            )
            joint = n[k, i] + n[k, j]
            gain += (
                math.lgamma(move + joint)
                - math.lgamma(move + n[k, i])
                - math.lgamma(move + n[k, j])
                + math.lgamma(move)
            )
    home = n[i, i] + n[i, j] + n[j, i] + n[j, j]
    joint_row += home
    gain += math.lgamma(stay + home) - math.lgamma(stay)
    gain -= (
        math.lgamma(stay + n[i, i])
        - math.lgamma(stay)
        + math.lgamma(stay + n[j, j])
        - math.lgamma(stay)
    )
    gain -= (
        math.lgamma(move + n[i, j])
        - math.lgamma(move)
        + math.lgamma(move + n[j, i])
        - math.lgamma(move)
    )
    total = stay + states * move
    gain += math.lgamma(total) - math.lgamma(total + joint_row)
    gain += -2.0 * math.lgamma(total) + math.lgamma(total + row_i) + math.lgamma(total + row_j)
    return gain


@kernel(inline=True)
def joint_marginal(
    outer: Floats, sums: Floats, i: int, j: int, prior: Joint, factor: Floats
) -> float:
    """Return the log marginal likelihood of states i and j as one, or of i if they are equal.

    Statistics are outer (L, M, M) and sums (L, 2).
    """
    count, total = sums[i, 0], sums[i, 1]
    both = outer[i].copy()
    if i != j:
        count += sums[j, 0]
        total += sums[j, 1]
        for row in range(len(both)):
            add_to(both[row], outer[j, row])
    posterior_factor(both, total, prior, factor)
    return log_marginal(factor, prior.weight * count, prior)


@kernel(inline=True)
def best_merge(
    pairs: Floats, single: Floats, counts: Ints, n: Ints, stay: float, move: float
) -> tuple[int, int]:
    """Return the states (i > j) whose merge gains most, or (-1, -1) if no merge gains anything.

    pairs (L, L) and single (L,) are log marginal likelihoods of two states as one, and of each.
    """
    best, best_i, best_j = 0.0, -1, -1
    for i in range(len(single)):
        for j in range(i):
            if counts[i] == 0 or counts[j] == 0:
                continue
            gain = pairs[i, j] - single[i] - single[j] + merge_gain(n, i, j, stay, move)
            if gain > best:
                best, best_i, best_j = gain, i, j
    return best_i, best_j


@kernel(inline=True)
def fill_pairs(
    outer: Floats,
    sums: Floats,
    counts: Ints,
    prior: Joint,
    base: float,
    factor: Floats,
    pairs: Floats,
) -> None:
    """Fill the missing log marginal likelihoods of pairs (L, L), in its lower triangle."""
    for i in range(len(counts)):
        for j in range(i):
            if counts[i] > 0 and counts[j] > 0 and np.isnan(pairs[i, j]):
                pairs[i, j] = joint_marginal(outer, sums, i, j, prior, factor) - base


@kernel(F2, F1, I1, JOINT, F, F, OUTI1)
def merge_states(
    v: Floats, mass: Floats, ends: Ints, prior: Joint, stay: float, move: float, labels: Ints
) -> None:
    """Merge states greedily while log p(labels, samples) grows, parameters integrated out.

    Gibbs sampling splits easily but seldom merges; this is run on the labels of a chain's start.

    Args:
        v: (T, M) samples.
        mass: (T,) see `accumulate`.
        ends: one past the index of the last sample of each sequence.
        prior: of the emissions.
        stay: prior weight of the state itself in a transition row.
        move: prior weight of every other state.
        labels: (T,) updated; `labels.max() + 1` states.
    """
    m, states = v.shape[1], labels.max() + 1
    outer, sums, factor = np.empty((states, m, m)), np.empty((states, 2)), np.empty((m, m))
    counts = np.zeros(states, np.int64)
    n = np.empty((states + 1, states), np.int64)
    posterior_factor(np.zeros((m, m)), 0.0, prior, factor)
    base = log_marginal(factor, 0.0, prior)
    single = np.zeros(states)
    pairs = np.full((states, states), np.nan)
    accumulate(v, labels, mass, outer, sums)
    for t in range(len(labels)):
        counts[labels[t]] += 1
    for k in range(states):
        single[k] = joint_marginal(outer, sums, k, k, prior, factor) - base
    while True:
        count_transitions(labels, ends, n)
        fill_pairs(outer, sums, counts, prior, base, factor, pairs)
        i, j = best_merge(pairs, single, counts, n, stay, move)
        if i < 0:
            break
        single[j], single[i] = pairs[i, j], 0.0
        for row in range(m):
            add_to(outer[j, row], outer[i, row])
        add_to(sums[j], sums[i])
        counts[j] += counts[i]
        counts[i] = 0
        for t in range(len(labels)):
            if labels[t] == i:
                labels[t] = j
        for k in range(states):
            pairs[j, k] = np.nan
            pairs[k, j] = np.nan
