# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Split and merge moves on the labels, with emissions and π integrated out.

Gibbs sampling moves a few samples at a time, and seldom crosses the region between one state and
two. A move (after Jain & Neal 2004; Hughes, Fox, Sudderth 2012 for HMMs) splits a state or merges
two. In a split, two of its samples, the anchors, each start a state; a few rounds of fitting and
labelling refine them; the labels of the last round are drawn, forward in time, so that their
probability is known. A merge draws such anchors, too, for the probability of the reverse move.
"""

import math
from typing import NamedTuple

import numpy as np

from scenario_gen.method.segmentation.hdp_hmm.emission import (
    add_sample,
    block_log_likelihood,
    BLOCK_SAMPLES,
    log_marginal,
    mean_emission,
    posterior_factor,
)
from scenario_gen.method.segmentation.hdp_hmm.model import Data, Joint, States, Statistics
from scenario_gen.method.segmentation.hdp_hmm.random import log_beta_draw, State, uniform
from scenario_gen.method.segmentation.hdp_hmm.transitions import (
    chosen_state,
    count_transitions,
    count_used,
    log_transitions,
    predecessors,
)
from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.kernels import kernel
from scenario_gen.numerics.loops import add_to, column_sums, copy_rows, copy_to

REFINEMENTS_COUNT = 2  # rounds of fitting and labelling
ANCHOR_SAMPLES = 5  # on either side of an anchor, which share its label at first
MAX_STAY_PROBABILITY, MIN_STAY_PROBABILITY = 0.99, 0.6
MAX_LOG_RATIO = 200.0  # of the likelihoods of two sides
CERTAIN_RATIO = 1e150  # of the likelihoods at an anchor
MIN_PRODUCT_RATIO = 1e-150  # below which a product is replaced by its logarithm


class Group(NamedTuple):
    """The samples of both states of a move.

    Attributes:
        members: (n,) their numbers.
        opens: (n,) 1 where a run of them begins.
        outer: (M, M) their Σ mass v vᵀ.
        sums: (2,) number of observed samples, and Σ mass.
    """

    members: Ints
    opens: Ints
    outer: Floats
    sums: Floats


class Proposal(NamedTuple):
    """A move.

    Attributes:
        pair: (2,) the states i and j.
        group: their samples; of a merge none, since all get state i.
        side: (n,) 1 where a sample of the group gets state j; 0: state i.
        n: (L + 1, L) transition counts after it.
        outer: (2, M, M) statistics of both states after it.
        sums: (2, 2) likewise.
        gain: log of the proposal probability of the reverse move over that of this move, as far
            as known.
    """

    pair: Ints
    group: Group
    side: Ints
    n: Ints
    outer: Floats
    sums: Floats
    gain: float


@kernel(inline=True)
def group_of(labels: Ints, ends: Ints, i: int, j: int, stats: Statistics) -> Group:
    """Return the samples of states i and j."""
    index, opens = np.empty(len(labels), np.int64), np.empty(len(labels), np.int64)
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
    outer, sums = stats.outer[i].copy(), stats.sums[i].copy()
    add_state(stats, j, outer, sums)
    return Group(index[:count], opens[:count], outer, sums)


@kernel(inline=True)
def add_state(stats: Statistics, k: int, outer: Floats, sums: Floats) -> None:
    """Add the statistics of state k to outer (M, M) and sums (2,)."""
    for row in range(len(outer)):
        add_to(outer[row], stats.outer[k, row])
    add_to(sums, stats.sums[k])


@kernel(inline=True)
def fit_side(
    data: Data, group: Group, side: Ints, which: int, outer: Floats, sums: Floats
) -> None:
    """Fill outer (M, M) and sums (2,) with the statistics of the samples on side `which`."""
    outer[:] = 0.0
    sums[:] = 0.0
    for r in range(len(side)):
        t = group.members[r]
        if side[r] == which and data.mass[t] > 0.0:
            add_sample(data.v[t], data.mass[t], outer)
            sums[0] += 1.0
            sums[1] += data.mass[t]


@kernel(inline=True)
def fit_sides(data: Data, group: Group, side: Ints, outer: Floats, sums: Floats) -> None:
    """Fill outer (2, M, M) and sums (2, 2) with the statistics of sides (n,).

    Those of the smaller side are summed; the others are the rest of the group's.
    """
    rare = 1 if 2 * side.sum() <= len(side) else 0
    fit_side(data, group, side, rare, outer[rare], sums[rare])
    rest = 1 - rare
    for i in range(len(group.outer)):
        for j in range(i + 1):
            outer[rest, i, j] = group.outer[i, j] - outer[rare, i, j]
    for i in range(2):
        sums[rest, i] = group.sums[i] - sums[rare, i]


@kernel(inline=True)
def likelihood_ratios(
    vt: Floats, mass: Floats, emitted: States, weight: float, work: Floats, ratio: Floats
) -> None:
    """Fill ratio (n,) with the likelihood of side 1 over that of side 0.

    Args:
        vt: (M, n) samples.
        mass: (n,).
        emitted: of both sides.
        weight: of a sample.
        work: (3, BLOCK_SAMPLES).
        ratio: output.
    """
    alike = weight * (emitted.shape[1, 0] - emitted.shape[0, 0])
    emitted.shape[:, 0] = 0.0
    for start in range(0, len(mass), BLOCK_SAMPLES):
        stop = min(start + BLOCK_SAMPLES, len(mass))
        block_log_likelihood(vt, start, stop, emitted, weight, 0.0, work[:2], work[2])
        for r in range(start, stop):
            log_ratio = alike + mass[r] * (work[1, r - start] - work[0, r - start])
            ratio[r] = 1.0
            if mass[r] > 0.0:
                ratio[r] = np.exp(min(max(log_ratio, -MAX_LOG_RATIO), MAX_LOG_RATIO))


@kernel(inline=True)
def through(odds: float, stay: float) -> float:
    """Return the odds of side 1 over side 0 one step away from a sample with these odds."""
    return (stay * odds + (1.0 - stay)) / ((1.0 - stay) * odds + stay)


@kernel(inline=True)
def ahead(ratio: Floats, opens: Ints, stay: float, message: Floats) -> None:
    """Fill message (n,) with the odds of side 1, given the sample and the rest of its run."""
    later = 1.0
    for r in range(len(ratio) - 1, -1, -1):
        message[r] = ratio[r] * later
        later = 1.0 if opens[r] == 1 else through(message[r], stay)


@kernel(inline=True)
def best_sides(ratio: Floats, opens: Ints, stay: float, message: Floats, side: Ints) -> None:
    """Fill side (n,) with the more probable side of each sample given all (forward, backward)."""
    ahead(ratio, opens, stay, message)
    before = 1.0
    for r in range(len(ratio)):
        if opens[r] == 1:
            before = 1.0
        side[r] = 1 if message[r] * before > 1.0 else 0
        before = through(ratio[r] * before, stay)


@kernel(inline=True)
def draw_sides(
    state: State, ratio: Floats, opens: Ints, stay: float, message: Floats, side: Ints, given: bool
) -> float:
    """Draw side (n,) forward in time, or use the given one; return its log-probability."""
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
        if product < MIN_PRODUCT_RATIO:
            value += math.log(product)
            product = 1.0
    return value + math.log(product)


@kernel(inline=True)
def around_anchors(opens: Ints, anchors: tuple[int, int]) -> Ints:
    """Return side (n,): 0 or 1 for the two anchors and the samples around them, -1 for others."""
    side = np.full(len(opens), -1, np.int64)
    for s in range(2):
        r = anchors[s]
        side[r] = s
        for step in range(1, ANCHOR_SAMPLES + 1):
            if r - step < 0 or opens[r - step + 1] == 1 or side[r - step] == 1 - s:
                break
            side[r - step] = s
        for step in range(1, ANCHOR_SAMPLES + 1):
            if r + step >= len(opens) or opens[r + step] == 1 or side[r + step] == 1 - s:
                break
            side[r + step] = s
    return side


@kernel(inline=True)
def log_sides(
    state: State,
    data: Data,
    joint: Joint,
    stay: float,
    group: Group,
    anchors: tuple[int, int],
    side: Ints,
    given: bool,
) -> float:
    """Draw sides (n,) for a group's samples, or use the given ones; return their log-probability.

    All but the last draw depends only on the samples and the two anchors, so that it is the same
    for a move and its reverse.
    """
    (m, d), n = (len(joint.g0), len(joint.blur)), len(side)
    outer, sums, factor = np.empty((2, m, m)), np.empty((2, 2)), np.empty((m, m))
    emitted = States(np.empty((2, d, m)), np.empty((2, 2)))
    ratio, message, scratch = np.empty(n), np.empty(n), np.empty((3, BLOCK_SAMPLES))
    members, masses = np.empty((m, n)), np.empty(n)
    for r in range(n):
        masses[r] = data.mass[group.members[r]]
        for i in range(m):
            members[i, r] = data.v[group.members[r], i]
    work = around_anchors(group.opens, anchors)
    for turn in range(REFINEMENTS_COUNT + 1):
        if turn > 0:
            fit_sides(data, group, work, outer, sums)
        for s in range(2):
            if turn == 0:
                fit_side(data, group, work, s, outer[s], sums[s])
            posterior_factor(outer[s], sums[s, 1], joint, factor)
            mean_emission(
                factor, joint.weight * sums[s, 0], joint, emitted.coef[s], emitted.shape[s]
            )
        likelihood_ratios(members, masses, emitted, joint.weight, scratch, ratio)
        ratio[anchors[0]], ratio[anchors[1]] = 1.0 / CERTAIN_RATIO, CERTAIN_RATIO
        if turn < REFINEMENTS_COUNT:
            best_sides(ratio, group.opens, stay, message, work)
    return draw_sides(state, ratio, group.opens, stay, message, side, given)


@kernel(inline=True)
def log_share(a: float, first: int, second: int, log_first: float, log_second: float) -> float:
    """Return the log ratio of the Dirichlet prior of two β to the density of their drawn shares.

    The shares are drawn from Beta(a + first, a + second).
    """
    value = (
        math.lgamma(a + first) + math.lgamma(a + second) - math.lgamma(2.0 * a + first + second)
    )
    return value - first * log_first - second * log_second


@kernel(inline=True)
def log_pair(members: int, left: int, right: int, used: int, empty: int) -> float:
    """Return the log ratio of the probabilities to draw a merge, and its reverse split.

    Args:
        members: samples of both.
        left: of the first.
        right: of the second.
        used: states in use when they are one.
        empty: states not in use then.
    """
    return math.log(float(empty) * members * (members - 1.0) / ((used + 1.0) * left * right))


@kernel(inline=True)
def draw_split(state: State, counts: Ints) -> tuple[int, int, int, int]:
    """Draw a state, an empty state (-1: impossible), and the numbers of two anchors."""
    used = count_used(counts)
    i = chosen_state(counts, int(uniform(state) * used), True)
    if used == len(counts) or counts[i] < 2:
        return i, -1, 0, 0
    j = chosen_state(counts, int(uniform(state) * (len(counts) - used)), False)
    first = int(uniform(state) * counts[i])
    second = int(uniform(state) * (counts[i] - 1))
    return i, j, first, second + 1 if second >= first else second


@kernel(inline=True)
def draw_merge(state: State, counts: Ints) -> tuple[int, int, int, int]:
    """Draw two occupied states (the second is -1 if impossible), and an anchor in each."""
    used = count_used(counts)
    i = chosen_state(counts, int(uniform(state) * used), True)
    if used < 2:
        return i, -1, 0, 0
    rest = int(uniform(state) * (used - 1))
    j = chosen_state(counts, rest, True)
    if j >= i:
        j = chosen_state(counts, rest + 1, True)
    first = int(uniform(state) * counts[i])
    return i, j, first, int(uniform(state) * counts[j])


@kernel(inline=True, merged=True)
def propose_split(
    state: State,
    data: Data,
    joint: Joint,
    stay: float,
    labels: Ints,
    stats: Statistics,
    drawn: tuple[int, int, int, int],
) -> Proposal:
    """Divide state i into i and j, which was empty: see `draw_split`."""
    i, j, first, second = drawn
    counts, m = column_sums(stats.n), len(joint.g0)
    used, members = count_used(counts), counts[i]
    group = group_of(labels, data.ends, i, j, stats)
    side, n = np.zeros(members, np.int64), np.empty_like(stats.n)
    gain = -log_sides(state, data, joint, stay, group, (first, second), side, False)
    outer, sums = np.zeros((2, m, m)), np.zeros((2, 2))
    fit_sides(data, group, side, outer, sums)
    after = labels.copy()
    relabel(after, group, side, i, j)
    count_transitions(after, data.ends, n)
    right = side.sum()
    gain += log_pair(members, members - right, right, used, len(counts) - used)
    return Proposal(np.array([i, j]), group, side, n, outer, sums, gain)


@kernel(inline=True)
def propose_merge(joint: Joint, stats: Statistics, drawn: tuple[int, int, int, int]) -> Proposal:
    """Make state j part of state i: see `draw_merge`."""
    i, j = drawn[0], drawn[1]
    counts, m = column_sums(stats.n), len(joint.g0)
    used, members = count_used(counts) - 1, counts[i] + counts[j]
    n, outer, sums = stats.n.copy(), np.zeros((2, m, m)), np.zeros((2, 2))
    for k in (i, j):
        add_state(stats, k, outer[0], sums[0])
    add_to(n[i], n[j])
    n[j] = 0
    add_to(n[:, i], n[:, j])
    n[:, j] = 0
    gain = -log_pair(members, counts[i], counts[j], used, len(counts) - used)
    none = np.empty(0, np.int64)
    return Proposal(
        np.array([i, j]), Group(none, none, outer[0], sums[0]), none, n, outer, sums, gain
    )


@kernel(inline=True, merged=True)
def log_undone(
    state: State,
    data: Data,
    joint: Joint,
    stay: float,
    labels: Ints,
    stats: Statistics,
    drawn: tuple[int, int, int, int],
) -> float:
    """Return the log-probability of the split that undoes a merge, given its anchors' numbers."""
    group, numbers = group_of(labels, data.ends, drawn[0], drawn[1], stats), (drawn[2], drawn[3])
    side = np.empty(len(group.members), np.int64)
    first, second = 0, 0
    seen = np.zeros(2, np.int64)
    for r in range(len(side)):
        s = 1 if labels[group.members[r]] == drawn[1] else 0
        side[r] = s
        if seen[s] == numbers[s]:
            if s == 0:
                first = r
            else:
                second = r
        seen[s] += 1
    return log_sides(state, data, joint, stay, group, (first, second), side, True)


@kernel(inline=True)
def relabel(labels: Ints, group: Group, side: Ints, i: int, j: int) -> None:
    """Change labels (T,) of state j to i, then those of a group's side 1, by side (n,), to j."""
    for t in range(len(labels)):
        if labels[t] == j:
            labels[t] = i
    for r in range(len(side)):
        if side[r] == 1:
            labels[group.members[r]] = j


@kernel(inline=True, merged=True)
def split_or_merge(
    state: State, data: Data, joint: Joint, top: Floats, labels: Ints, stats: Statistics
) -> bool:
    """Propose one move, and accept or reject it (Metropolis-Hastings); return whether accepted.

    Args:
        state: generator.
        data: samples.
        joint: prior.
        top: (3 + L,) γ, α+κ, ρ and β; β is updated.
        labels: (T,) updated.
        stats: updated.
    """
    threshold = np.log(uniform(state))
    splits = uniform(state) < 0.5
    counts = column_sums(stats.n)
    stay = min(max(top[2], MIN_STAY_PROBABILITY), MAX_STAY_PROBABILITY)
    drawn = draw_split(state, counts) if splits else draw_merge(state, counts)
    if drawn[1] < 0:
        return False
    move = (
        propose_split(state, data, joint, stay, labels, stats, drawn)
        if splits
        else propose_merge(joint, stats, drawn)
    )
    i, j = drawn[0], drawn[1]
    beta, gain = top[3:], move.gain
    factors, marginal = np.empty_like(move.outer), np.empty(2)
    for s in range(2):
        posterior_factor(move.outer[s], move.sums[s, 1], joint, factors[s])
        marginal[s] = log_marginal(factors[s], joint.weight * move.sums[s, 0], joint)
    gain += marginal[0] + marginal[1] - stats.marginal[i] - stats.marginal[j]
    after = beta.copy()
    gain += draw_shares(state, top[0] / len(beta), stats.n, move, beta, after)
    log_after = log_transitions(move.n, top[1], top[2], after)
    gain += log_after - log_transitions(stats.n, top[1], top[2], beta)
    if not splits and gain >= threshold:  # the most expensive part comes last
        gain += log_undone(state, data, joint, stay, labels, stats, drawn)
    if not gain >= threshold:
        return False
    relabel(labels, move.group, move.side, i, j)
    copy_rows(stats.n, move.n)
    copy_to(beta, after)
    for s in range(2):
        k = move.pair[s]
        copy_rows(stats.outer[k], move.outer[s])
        copy_to(stats.sums[k], move.sums[s])
        copy_rows(stats.factors[k], factors[s])
        stats.marginal[k] = marginal[s]
    return True


@kernel(inline=True)
def draw_shares(
    state: State, a: float, n: Ints, move: Proposal, beta: Floats, after: Floats
) -> float:
    """Draw the shares of a pair in its β after a move, into after (L,); return the gain.

    `a` is γ / L; n are the counts before the move.
    """
    i, j = move.pair[0], move.pair[1]
    both = beta[i] + beta[j]
    old, new = predecessors(n, j), predecessors(move.n, j)
    share_i, share_j = log_beta_draw(state, a + predecessors(move.n, i), a + new)
    gain: float = log_share(a, predecessors(move.n, i), new, share_i, share_j)
    gain -= log_share(a, predecessors(n, i), old, np.log(beta[i] / both), np.log(beta[j] / both))
    after[i] = max(both * np.exp(share_i), 1e-100)
    after[j] = max(both * np.exp(share_j), 1e-100)
    return gain
