# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The posterior over segmentations: estimate, changepoint probabilities, intervals, R-hat."""

from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import linear_sum_assignment

from scenario_gen.numerics import Bools, Floats, frozen, frozen_ints, Ints

MAX_SAMPLES = 400  # sampled label sequences; more are thinned evenly, traces are not
MIN_SCORE_GAP_LOG_RATIO = 10.0  # of a chain's mean score to the best one's, to leave it out


@dataclass(frozen=True, eq=False)
class Posterior:
    """Sampled segmentations of T samples.

    Attributes:
        labels: (T,) point estimate, 0 .. K - 1 in order of first appearance: the most probable
            label of every sample. It minimises the expected Hamming distance to the samples once
            their labels are matched.
        samples: (S, T) sampled labels of evenly spaced sweeps of the kept chains, matched to
            `labels`.
        probability: (T,) posterior probability of a changepoint at each sample.
        ends: index one past the last sample of each sequence.
        chain: (S,) chain of each sample.
        trace: per chain (S', 5), see `hdp_hmm.chain.TRACE`.
        kept: (chains,) which chains the samples come from; the others are stuck in a far less
            probable mode.
        states: weak-limit truncation L that was used.
        full: whether all of them were often in use, so that more may be needed.
        dof: degrees of freedom of the noise; 0: Gaussian.
        weight: of a sample.
        channels: (D',) channels that were used; the others do not vary or follow from these.
        extra: ν0 - D of the emissions' prior, as last drawn (geometric mean of the chains).
        worth: κ0, or the factor of the configured prior precision K, as last drawn.
    """

    labels: Ints
    samples: Ints
    probability: Floats
    ends: Ints
    chain: Ints
    trace: tuple[Floats, ...]
    kept: Bools
    states: int = 1
    full: bool = False
    dof: float = 0.0
    weight: float = 1.0
    channels: Ints = field(default_factory=lambda: np.zeros(0, np.int64))
    extra: float = 25.0
    worth: float = 0.1

    @property
    def r_hat(self) -> Floats:
        """(5,) split R-hat of each trace over all chains."""
        return r_hat(list(self.trace))

    @classmethod
    def constant(cls, ends: Ints) -> "Posterior":
        """Return the posterior of sequences that do not vary: one primitive, with certainty."""
        labels, no_chain = np.zeros(int(ends[-1]), np.int64), np.zeros(0, np.bool_)
        probability, chain = np.zeros(len(labels)), np.zeros(1, np.int64)
        return cls(labels, labels[None], probability, ends, chain, (), no_chain)

    @property
    def changepoints(self) -> Ints:
        """(K,) changepoints of the point estimate; the start of a sequence is none."""
        return changepoints_of(self.labels, self.ends)

    def probability_within(self, radius: int) -> Floats:
        """Return the posterior probability (T,) of a changepoint within `radius` samples."""
        rows, samples = self.samples.shape
        changed = np.zeros((rows, samples), np.int32)
        changed[:, 1:] = np.diff(self.samples, axis=1) != 0
        changed[:, self.ends[:-1]] = 0
        before = np.zeros((rows, samples + 1), np.int32)
        np.cumsum(changed, axis=1, out=before[:, 1:])
        t = np.arange(samples)
        low, high = np.maximum(t - radius, 0), np.minimum(t + radius + 1, samples)
        return np.asarray((before[:, high] > before[:, low]).mean(axis=0))

    def intervals(self, low: float = 0.05, high: float = 0.95) -> Floats:
        """Return the credible interval (K, 2) of each changepoint's sample index.

        It is that of the nearest changepoint in each sampled segmentation.
        """
        sampled = [changepoints_of(row, self.ends) for row in self.samples]
        sampled = [changepoints for changepoints in sampled if len(changepoints)]
        intervals = np.repeat(self.changepoints[:, None].astype(np.float64), 2, axis=1)
        for k, centre in enumerate(self.changepoints if sampled else ()):
            nearest = [row[np.argmin(np.abs(row - centre))] for row in sampled]
            intervals[k] = np.quantile(nearest, [low, high], method="inverted_cdf")
        return intervals

    def primitives(self) -> Floats:
        """Return the posterior probability (n,) of 0, 1, 2, ... primitives in use."""
        used = np.array([len(np.unique(row)) for row in self.samples])
        return np.bincount(used) / len(used)


def r_hat(traces: list[Floats]) -> Floats:
    """Return split R-hat (n,) of traces (S, n); 1 where nothing varies.

    Source: Gelman et al. 2013, 11.4.
    """
    if not traces or len(traces[0]) < 4:
        return np.ones(5)
    half = min(len(trace) for trace in traces) // 2
    parts = np.array([part for trace in traces for part in (trace[:half], trace[half : 2 * half])])
    within = parts.var(axis=1, ddof=1).mean(axis=0)
    between = parts.mean(axis=1).var(axis=0, ddof=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.sqrt((half - 1) / half + between / within)
    return np.where(within > 0.0, ratio, np.where(between > 0.0, np.inf, 1.0))


def changepoints_of(labels: Ints, ends: Ints) -> Ints:
    """Return the samples (K,) whose label differs from the one before, within each sequence."""
    changepoints = np.flatnonzero(np.diff(labels)) + 1
    return changepoints[~np.isin(changepoints, ends)].astype(np.int64)


def in_order(labels: Ints) -> Ints:
    """Renumber labels (T,) in order of first appearance."""
    _, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[inverse].astype(np.int64).reshape(-1)


def matched_labels(samples: Ints, reference: Ints, size: int) -> Ints:
    """Permute each row's labels (S, T), below `size`, for the best match with `reference` (T,)."""
    overlaps = [
        np.bincount(row * size + reference, minlength=size * size).reshape(size, size)
        for row in samples
    ]
    partners = [linear_sum_assignment(overlap, maximize=True)[1] for overlap in overlaps]
    return np.stack([partner[row] for partner, row in zip(partners, samples, strict=True)]).astype(
        np.int64
    )


def pool(samples: list[Ints], traces: list[Floats], ends: Ints, lead: int) -> Posterior:
    """Combine the chains.

    The score of a sample is log p(x, labels) with emissions and transitions integrated out. Unlike
    p(x | parameters), it does not grow with unneeded states. Chains whose mean score lies far
    below the best chain's are stuck and left out. The samples of the others are matched to the
    best-scored sample, then to the estimate itself, until it no longer changes.

    Args:
        samples: labels (S', T') of each chain.
        traces: (S', 5) of each chain.
        ends: one past the index of the last sample of each sequence.
        lead: samples without a row at the head of each sequence; they get the first row's label.
    """
    means = np.array([trace[:, 0].mean() for trace in traces])
    best = int(np.argmax(means))
    margin = max(MIN_SCORE_GAP_LOG_RATIO, 3.0 * float(traces[best][:, 0].std()))
    kept = means >= means[best] - margin
    chains = np.flatnonzero(kept)
    every = max(1, -(-sum(len(samples[k]) for k in chains) // MAX_SAMPLES))
    stack = np.vstack([samples[k][::every] for k in chains])
    chain = np.concatenate([np.full(len(samples[k][::every]), k) for k in chains])
    scores = np.concatenate([traces[k][::every, 0] for k in chains])
    estimate, stack = _consensus(stack, stack[int(np.argmax(scores))])
    order = in_order(np.concatenate([estimate, np.arange(stack.max() + 1)]))[len(estimate) :]
    if lead:
        starts = np.concatenate([[0], ends[:-1] - lead * np.arange(1, len(ends))])
        repeats = np.ones(len(estimate), np.int64)
        repeats[starts] += lead
        estimate, stack = np.repeat(estimate, repeats), np.repeat(stack, repeats, axis=1)
    changed = np.zeros(stack.shape[1])
    changed[1:] = (np.diff(stack, axis=1) != 0).mean(axis=0)
    changed[ends[:-1]] = 0.0
    return Posterior(
        frozen_ints(order[estimate]),
        frozen_ints(order[stack]),
        frozen(changed),
        frozen_ints(ends),
        frozen_ints(chain),
        tuple(traces),
        kept,
    )


def _consensus(samples: Ints, estimate: Ints) -> tuple[Ints, Ints]:
    """Return the most frequent label (T,) of every sample, and the matched samples (S, T)."""
    size = int(samples.max()) + 1
    for _ in range(3):
        matched = matched_labels(samples, estimate, size)
        votes = np.stack([(matched == k).sum(axis=0) for k in range(size)])
        update = votes.argmax(axis=0).astype(np.int64)
        if np.array_equal(update, estimate):
            break
        estimate = update
    return estimate, matched
