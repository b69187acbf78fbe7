# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Split and merge moves on the labels, with emissions and π integrated out.

Gibbs sampling moves a few samples at a time, and seldom through what lies between one state and two. A move (after Jain &
Neal 2004; Hughes, Fox, Sudderth 2012 for HMMs) splits a state or merges two. In a split two of its samples each start a state
of their own, a few rounds of fitting and labelling bring them to rest, and the labels of the last round are drawn, forward in
time, so that their probability is known. A merge draws such a pair, too, to know how probable the way back is.
"""

import math

import numpy as np

from scenario_gen.method.segmentation.hdp_hmm.emission import (
    add_sample,
    BLOCK,
    block_log_likelihood,
    log_marginal,
    mean_emission,
    posterior_factor,
)
from scenario_gen.method.segmentation.hdp_hmm.random import log_beta_draw, State, uniform
from scenario_gen.method.segmentation.hdp_hmm.transitions import count_transitions, log_transitions
from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.kernels import kernel

ROUNDS = 2
AROUND = 5
MOST_STAY, LEAST_STAY = 0.99, 0.6
MOST_LOG_RATIO, CERTAIN, LEAST_PRODUCT = 200.0, 1e150, 1e-150


@kernel(inline=True)
def members_of(labels: Ints, ends: Ints, i: int, j: int, index: Ints, opens: Ints) -> None:
    """Fill the head of index (T,) with the samples of states i and j, that of opens (T,) with 1 where a run of them begins."""
    count = 0
    before = -2
    sequence = 0
    for t in range(len(labels)):
        if labels[t] == i or labels[t] == j:
            index[count] = t
            opens[count] = 1 if before != t - 1 else 0
            before = t
            count += 1
        if t + 1 == ends[sequence]:
            sequence += 1
            before = -2


@kernel(inline=True)
def fit_side(v: Floats, mass: Floats, index: Ints, side: Ints, which: int, outer: Floats, sums: Floats) -> None:
    """Fill outer (M, M) and sums (2,) with the statistics of the samples on side `which`."""
    outer[:] = 0.0
    sums[:] = 0.0
    for r in range(len(index)):
        t = index[r]
        if side[r] == which and mass[t] > 0.0:
            add_sample(v[t], mass[t], outer)
            sums[0] += 1.0
            sums[1] += mass[t]


@kernel(inline=True)
def fit_sides(
    v: Floats, mass: Floats, index: Ints, side: Ints, whole: Floats, total: Floats, outer: Floats, sums: Floats
) -> None:
    """Fill outer (2, M, M) and sums (2, 2) with both sides' statistics: the rarer's, and what it leaves of all.

    Args:
        v: (T, M) samples.
        mass: (T,).
        index: (n,) samples of both.
        side: (n,) 0 or 1.
        whole: (M, M) statistics of all n.
        total: (2,) likewise.
        outer: output.
        sums: output.
    """
    rare = 1 if 2 * side.sum() <= len(side) else 0
    fit_side(v, mass, index, side, rare, outer[rare], sums[rare])
    rest = 1 - rare
    for i in range(len(whole)):
        for j in range(i + 1):
            outer[rest, i, j] = whole[i, j] - outer[rare, i, j]
    for i in range(2):
        sums[rest, i] = total[i] - sums[rare, i]


@kernel(inline=True)
def likelihood_ratios(
    vt: Floats, mass: Floats, coef: Floats, shape: Floats, weight: float, anchors: Ints, work: Floats, ratio: Floats
) -> None:
    """Fill ratio (n,) with the likelihood of side 1 over that of side 0; at the anchors there is no doubt.

    Args:
        vt: (M, n) samples.
        mass: (n,).
        coef: (2, D, M) emissions.
        shape: (2, 2), see `block_log_likelihood`.
        weight: what a sample counts for.
        anchors: (2,).
        work: (3, BLOCK).
        ratio: output.
    """
    alike = weight * (shape[1, 0] - shape[0, 0])
    shape[:, 0] = 0.0
    for start in range(0, len(mass), BLOCK):
        stop = min(start + BLOCK, len(mass))
        block_log_likelihood(vt, start, stop, coef, shape, weight, 0.0, work[:2], work[2])
        for r in range(start, stop):
            log_ratio = alike + mass[r] * (work[1, r - start] - work[0, r - start])
            ratio[r] = np.exp(min(max(log_ratio, -MOST_LOG_RATIO), MOST_LOG_RATIO)) if mass[r] > 0.0 else 1.0
    ratio[anchors[0]] = 1.0 / CERTAIN
    ratio[anchors[1]] = CERTAIN


@kernel(inline=True)
def through(odds: float, stay: float) -> float:
    """Odds of side 1 over side 0 one step away from a sample whose odds are given."""
    return (stay * odds + (1.0 - stay)) / ((1.0 - stay) * odds + stay)


@kernel(inline=True)
def ahead(ratio: Floats, opens: Ints, stay: float, message: Floats) -> None:
    """Fill message (n,) with the odds of side 1 over side 0 at each sample, by it and all later samples of its run."""
    later = 1.0
    for r in range(len(ratio) - 1, -1, -1):
        message[r] = ratio[r] * later
        later = 1.0 if opens[r] == 1 else through(message[r], stay)


@kernel(inline=True)
def best_sides(ratio: Floats, opens: Ints, stay: float, message: Floats, side: Ints) -> None:
    """Fill side (n,) with the more probable side of each sample given all others (forward and backward)."""
    ahead(ratio, opens, stay, message)
    before = 1.0
    for r in range(len(ratio)):
        if opens[r] == 1:
            before = 1.0
        side[r] = 1 if message[r] * before > 1.0 else 0
        before = through(ratio[r] * before, stay)


@kernel(inline=True)
def draw_sides(state: State, ratio: Floats, opens: Ints, stay: float, message: Floats, side: Ints, given: bool) -> float:
    """Draw side (n,) forward in time, or take it as given; returns the log-probability of it."""
    ahead(ratio, opens, stay, message)
    jump = stay / (1.0 - stay)
    value, product = 0.0, 1.0
    for r in range(len(ratio)):
        odds = message[r]
        if opens[r] == 0:
            odds *= jump if side[r - 1] == 1 else 1.0 / jump
        if not given:
            side[r] = 1 if uniform(state) * (1.0 + odds) < odds else 0
        product *= (odds if side[r] == 1 else 1.0) / (1.0 + odds)
        if product < LEAST_PRODUCT:
            value += np.log(product)
            product = 1.0
    return value + math.log(product)


@kernel(inline=True)
def propose_sides(
    state: State,
    v: Floats,
    mass: Floats,
    index: Ints,
    opens: Ints,
    anchors: Ints,
    whole: Floats,
    total: Floats,
    g0: Floats,
    p: int,
    nu: float,
    weight: float,
    blur: Floats,
    stay: float,
    side: Ints,
    given: bool,
) -> float:
    """Draw sides (n,) for the samples `index` (n,), or take them as given; returns the log-probability of drawing them.

    Everything but the last draw depends on the samples, their statistics `whole` (M, M) and `total` (2,), and the two anchors
    only, so that it is the same there and back.
    """
    m, n = g0.shape[0], len(index)
    d = m - p
    outer, sums, factor = np.empty((2, m, m)), np.empty((2, 2)), np.empty((m, m))
    coef, shape = np.empty((2, d, m)), np.empty((2, 2))
    ratio, message, scratch = np.empty(n), np.empty(n), np.empty((3, BLOCK))
    members, masses = np.empty((m, n)), np.empty(n)
    for r in range(n):
        masses[r] = mass[index[r]]
        for i in range(m):
            members[i, r] = v[index[r], i]
    work = np.full(n, -1, np.int64)
    for s in range(2):
        r = anchors[s]
        work[r] = s
        for step in range(1, AROUND + 1):
            if r - step < 0 or opens[r - step + 1] == 1 or work[r - step] == 1 - s:
                break
            work[r - step] = s
        for step in range(1, AROUND + 1):
            if r + step >= n or opens[r + step] == 1 or work[r + step] == 1 - s:
                break
            work[r + step] = s
    for turn in range(ROUNDS + 1):
        if turn > 0:
            fit_sides(v, mass, index, work, whole, total, outer, sums)
        for s in range(2):
            if turn == 0:
                fit_side(v, mass, index, work, s, outer[s], sums[s])
            posterior_factor(outer[s], sums[s, 1], g0, weight, blur, factor)
            mean_emission(factor, weight * sums[s, 0], p, nu, blur, coef[s], shape[s])
        likelihood_ratios(members, masses, coef, shape, weight, anchors, scratch, ratio)
        if turn < ROUNDS:
            best_sides(ratio, opens, stay, message, work)
    return draw_sides(state, ratio, opens, stay, message, side, given)


@kernel(inline=True)
def predecessors(n: Ints, k: int) -> int:
    """Rows of n (L + 1, L), other than k's own, from which state k is entered; at least 1. So many tables it has at least."""
    count = 0
    for j in range(n.shape[0]):
        if j != k and n[j, k] > 0:
            count += 1
    return max(count, 1)


@kernel(inline=True)
def log_share(a: float, first: int, second: int, log_first: float, log_second: float) -> float:
    """Dirichlet prior of a pair of β over the density its shares are drawn with, Beta(a + first, a + second); logarithm."""
    value = math.lgamma(a + first) + math.lgamma(a + second) - math.lgamma(2.0 * a + first + second)
    return value - first * log_first - second * log_second


@kernel(inline=True)
def chosen_state(counts: Ints, number: int, occupied: bool) -> int:
    """Return state number `number` of those with counts (L,) above 0, or of the others."""
    for k in range(len(counts)):
        if (counts[k] > 0) == occupied:
            if number == 0:
                return k
            number -= 1
    return -1


@kernel(inline=True)
def draw_pair(state: State, counts: Ints, splits: bool, pair: Ints) -> bool:
    """Draw the states i and j of a move and the number of an anchor within each, into pair (4,); False if there are none.

    A split takes a state i of two samples or more, both anchors, and an empty state j; a merge two states in use.
    """
    used = 0
    for count in counts:
        used += 1 if count > 0 else 0
    empty = len(counts) - used
    i = chosen_state(counts, int(uniform(state) * used), True)
    if splits:
        if empty == 0 or counts[i] < 2:
            return False
        j = chosen_state(counts, int(uniform(state) * empty), False)
        first = int(uniform(state) * counts[i])
        second = int(uniform(state) * (counts[i] - 1))
        second += 1 if second >= first else 0
    else:
        if used < 2:
            return False
        rest = int(uniform(state) * (used - 1))
        j = chosen_state(counts, rest, True)
        if j >= i:
            j = chosen_state(counts, rest + 1, True)
        first, second = int(uniform(state) * counts[i]), int(uniform(state) * counts[j])
    pair[0], pair[1], pair[2], pair[3] = i, j, first, second
    return True


@kernel(inline=True)
def place_anchors(side: Ints, pair: Ints, splits: bool, anchors: Ints) -> None:
    """Find the anchors (2,), which `pair` (4,) numbers within their states, among the samples of both, side (n,)."""
    seen = np.zeros(2, np.int64)
    for r in range(len(side)):
        if side[r] == 0 and seen[0] == pair[2]:
            anchors[0] = r
        if (side[r] == 1 or splits) and seen[0 if splits else 1] == pair[3]:
            anchors[1] = r
        seen[side[r]] += 1


@kernel(inline=True)
def divided(labels: Ints, index: Ints, side: Ints, i: int, j: int) -> Ints:
    """(T,) labels with the samples `index` (n,) in state i or j, by their side (n,)."""
    after = labels.copy()
    for r in range(len(index)):
        after[index[r]] = j if side[r] == 1 else i
    return after


@kernel(inline=True)
def united(labels: Ints, i: int, j: int) -> Ints:
    """(T,) labels with state j made part of state i."""
    after = labels.copy()
    for t in range(len(labels)):
        if labels[t] == j:
            after[t] = i
    return after


@kernel(inline=True)
def sides_of(labels: Ints, index: Ints, j: int, side: Ints) -> None:
    """Fill side (n,) with 1 where sample `index` (n,) is in state j, else 0."""
    for r in range(len(index)):
        side[r] = 1 if labels[index[r]] == j else 0


@kernel(inline=True)
def log_pair(members: int, left: int, right: int, used: int, empty: int) -> float:
    """Logarithm of how often a merge draws a pair and its anchors, over how often the split that undoes it does.

    Args:
        members: samples of both.
        left: of the first.
        right: of the second.
        used: states in use when they are one.
        empty: states not in use then.
    """
    return math.log(float(empty) * members * (members - 1.0) / ((used + 1.0) * left * right))


@kernel(inline=True)
def split_or_merge(  # noqa: PLR0915 - one step of Metropolis-Hastings, read from top to bottom
    state: State,
    v: Floats,
    mass: Floats,
    ends: Ints,
    g0: Floats,
    p: int,
    nu: float,
    weight: float,
    blur: Floats,
    top: Floats,
    beta: Floats,
    labels: Ints,
    n: Ints,
    outer: Floats,
    sums: Floats,
    factors: Floats,
    own: Floats,
) -> bool:
    """Propose one move and accept or reject it; returns whether it was accepted.

    Args:
        state: generator.
        v: (T, M) samples.
        mass: (T,) see `accumulate`.
        ends: of the sequences.
        g0: (M, M) joint prior.
        p: regressors.
        nu: prior degrees of freedom ν0.
        weight: what a sample counts for.
        blur: (D,).
        top: (γ, α+κ, ρ).
        beta: (L,) updated.
        labels: (T,) updated.
        n: (L + 1, L) transition counts, updated.
        outer: (L, M, M) statistics, updated.
        sums: (L, 2) updated.
        factors: (L, M, M) Cholesky factors of the posteriors, updated.
        own: (L,) log marginal likelihood of each state's samples, updated.
    """
    threshold = np.log(uniform(state))
    splits = uniform(state) < 0.5
    counts = n.sum(axis=0)
    pair = np.empty(4, np.int64)
    if not draw_pair(state, counts, splits, pair):
        return False
    i, j = pair[0], pair[1]
    m, members = len(g0), counts[i] + counts[j]
    index, opens = np.empty(len(labels), np.int64), np.empty(len(labels), np.int64)
    side, anchors, after = np.zeros(members, np.int64), np.empty(2, np.int64), labels
    whole, total = outer[i] + outer[j], sums[i] + sums[j]
    stay = min(max(top[2], LEAST_STAY), MOST_STAY)
    two_outer, two_sums, two_factors, two_own = np.zeros((2, m, m)), np.zeros((2, 2)), np.empty((2, m, m)), np.zeros(2)
    gain, n_after = 0.0, n.copy()
    if splits:
        members_of(labels, ends, i, j, index, opens)
        place_anchors(side, pair, True, anchors)
        gain -= propose_sides(
            state, v, mass, index[:members], opens[:members], anchors, whole, total, g0, p, nu, weight, blur, stay, side, False
        )
        fit_sides(v, mass, index[:members], side, whole, total, two_outer, two_sums)
        after = divided(labels, index[:members], side, i, j)
        count_transitions(after, ends, n_after)
    else:
        two_outer[0], two_sums[0] = whole, total
        n_after[i] += n_after[j]
        n_after[j] = 0
        n_after[:, i] += n_after[:, j]
        n_after[:, j] = 0
    for s in range(2):
        posterior_factor(two_outer[s], two_sums[s, 1], g0, weight, blur, two_factors[s])
        two_own[s] = log_marginal(two_factors[s], weight * two_sums[s, 0], p, nu)
    gain += two_own[0] + two_own[1] - own[i] - own[j]
    a, both = top[0] / n.shape[1], beta[i] + beta[j]
    here, there = (0 if splits else predecessors(n, j)), (predecessors(n_after, j) if splits else 0)
    share_i, share_j = log_beta_draw(state, a + predecessors(n_after, i), a + there)
    gain += log_share(a, predecessors(n_after, i), there, share_i, share_j)
    gain -= log_share(a, predecessors(n, i), here, np.log(beta[i] / both), np.log(beta[j] / both))
    used, right = (counts > 0).sum(), side.sum() if splits else counts[j]
    if splits:
        gain += log_pair(members, members - right, right, used, len(counts) - used)
    else:
        gain -= log_pair(members, members - right, right, used - 1, len(counts) - used + 1)
    gain -= log_transitions(n, top[1], top[2], beta)
    keep_i, keep_j = beta[i], beta[j]
    beta[i], beta[j] = max(both * np.exp(share_i), 1e-100), max(both * np.exp(share_j), 1e-100)
    gain += log_transitions(n_after, top[1], top[2], beta)
    if not splits and gain >= threshold:
        members_of(labels, ends, i, j, index, opens)
        sides_of(labels, index[:members], j, side)
        place_anchors(side, pair, False, anchors)
        gain += propose_sides(
            state, v, mass, index[:members], opens[:members], anchors, whole, total, g0, p, nu, weight, blur, stay, side, True
        )
    if not gain >= threshold:
        beta[i], beta[j] = keep_i, keep_j
        return False
    labels[:] = after if splits else united(labels, i, j)
    n[:] = n_after
    for s in range(2):
        outer[pair[s]], sums[pair[s]] = two_outer[s], two_sums[s]
        factors[pair[s]], own[pair[s]] = two_factors[s], two_own[s]
    return True
