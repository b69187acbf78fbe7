# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Greedy merging of states by marginal likelihood: what Gibbs sampling alone does with difficulty."""

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


@kernel(inline=True)
def merge_gain(n: Ints, i: int, j: int, stay: float, move: float) -> float:
    """Gain in log p(labels) from making states i and j one, by counts n (L + 1, L).

    Rows are Dirichlet with `stay` at home and `move` elsewhere.
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
    """Log marginal likelihood of states i and j as one, or of i alone if they are the same; outer (L, M, M), sums (L, 2)."""
    count, total = sums[i, 0], sums[i, 1]
    both = outer[i].copy()
    if i != j:
        count += sums[j, 0]
        total += sums[j, 1]
        for a in range(len(both)):
            for b in range(a + 1):
                both[a, b] += outer[j, a, b]
    posterior_factor(both, total, prior, factor)
    return log_marginal(factor, prior.weight * count, prior)


@kernel(inline=True)
def best_merge(
    data: Floats, own: Floats, counts: Ints, n: Ints, stay: float, move: float
) -> tuple[int, int]:
    """Return the pair of states (i > j), of data (L, M, M), whose merge gains most, or (-1, -1) if none gains anything."""
    best, best_i, best_j = 0.0, -1, -1
    for i in range(len(own)):
        for j in range(i):
            if counts[i] > 0 and counts[j] > 0:
                gain = data[i, j] - own[i] - own[j] + merge_gain(n, i, j, stay, move)
                if gain > best:
                    best, best_i, best_j = gain, i, j
    return best_i, best_j


@kernel(F2, F1, I1, JOINT, F, F, OUTI1)
def merge_states(
    v: Floats, mass: Floats, ends: Ints, prior: Joint, stay: float, move: float, labels: Ints
) -> None:
    """Merge states greedily while the probability of the labels, emissions and transitions integrated out, grows.

    Gibbs sampling alone splits easily and merges with difficulty; this is run on the labels that a chain starts from.

    Args:
        v: (T, M) samples.
        mass: (T,) see `accumulate`.
        ends: index one past the last sample of each sequence.
        prior: of the emissions.
        stay: prior weight of the own state in a transition row.
        move: prior weight of every other one.
        labels: (T,) updated; `labels.max() + 1` states.
    """
    m, states = v.shape[1], 0
    for t in range(len(labels)):
        states = max(states, labels[t] + 1)
    outer, sums, factor = np.empty((states, m, m)), np.empty((states, 2)), np.empty((m, m))
    counts = np.zeros(states, np.int64)
    n = np.empty((states + 1, states), np.int64)
    posterior_factor(np.zeros((m, m)), 0.0, prior, factor)
    base = log_marginal(factor, 0.0, prior)
    own = np.zeros(states)
    data = np.full((states, states), np.nan)
    accumulate(v, labels, mass, outer, sums)
    for t in range(len(labels)):
        counts[labels[t]] += 1
    for k in range(states):
        own[k] = joint_marginal(outer, sums, k, k, prior, factor) - base
    while True:
        count_transitions(labels, ends, n)
        for i in range(states):
            for j in range(i):
                if counts[i] > 0 and counts[j] > 0 and np.isnan(data[i, j]):
                    data[i, j] = joint_marginal(outer, sums, i, j, prior, factor) - base
        i, j = best_merge(data, own, counts, n, stay, move)
        if i < 0:
            break
        own[j], own[i] = data[i, j], 0.0
        outer[j] += outer[i]
        sums[j] += sums[i]
        counts[j] += counts[i]
        counts[i] = 0
        for t in range(len(labels)):
            if labels[t] == i:
                labels[t] = j
        for k in range(states):
            data[j, k] = np.nan
            data[k, j] = np.nan
