# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The posterior over segmentations: a point estimate, changepoint probabilities, intervals, and whether to believe them."""

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from scenario_gen.numerics import Bools, Floats, frozen, frozen_ints, Ints

MOST_SAMPLES = 400  # labels of more sweeps than these are thinned evenly; traces are not


@dataclass(frozen=True, eq=False)
class Posterior:
    """Sampled segmentations of T samples.

    Attributes:
        labels: (T,) the point estimate, 0 .. K - 1 in order of first appearance: the most probable label of every sample, which
            minimises the expected Hamming distance to the samples once their labels are matched.
        samples: (S, T) sampled labels, of sweeps evenly apart, of the chains that agree where the mass is; matched to `labels`.
        probability: (T,) posterior probability of a changepoint at each sample.
        ends: index one past the last sample of each sequence.
        chain: (S,) chain of each sample.
        trace: per chain (S', 5), see `hdp_hmm.chain.TRACE`.
        kept: (chains,) which chains the samples are from; the others are stuck in a far less probable place.
        states: weak-limit truncation L that was used.
        full: whether all of them were in use more than now and then, so that more might be.
        dof: degrees of freedom of the noise; 0: Gaussian.
        weight: what a sample counted for.
        channels: (D',) channels that were used; the others do not vary or follow from these.
        extra: ν0 - D of the emissions' prior, as last drawn (geometric mean of the chains).
        worth: κ0, or what the prior precision K is in units of the configured one, likewise.
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
        """(5,) split R̂ of each trace over all chains."""
        return r_hat(list(self.trace))

    @classmethod
    def constant(cls, ends: Ints) -> "Posterior":
        """The posterior of sequences that do not vary: one primitive, with certainty; they end before the samples `ends` (Q,)."""
        zeros = np.zeros(int(ends[-1]), np.int64)
        return cls(
            zeros,
            zeros[None],
            np.zeros(len(zeros)),
            ends,
            np.zeros(1, np.int64),
            (),
            np.zeros(0, np.bool_),
        )

    def part(self, start: int, stop: int) -> "Posterior":
        """Return the posterior of the samples start..stop alone."""
        ends = np.array([stop - start])
        labels, samples = in_order(self.labels[start:stop]), self.samples[:, start:stop]
        return replace(
            self,
            labels=labels,
            samples=samples,
            probability=self.probability[start:stop],
            ends=ends,
        )

    @property
    def changepoints(self) -> Ints:
        """(K,) changepoints of the point estimate; the start of a further sequence is none."""
        return changepoints_of(self.labels, self.ends)

    def probability_within(self, radius: int) -> Floats:
        """(T,) posterior probability of at least one changepoint within `radius` samples of each sample."""
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
        """(K, 2) credible interval of each changepoint's sample index, from the sampled changepoints nearest to it."""
        centres = self.changepoints
        samples: list[list[int]] = [[] for _ in centres]
        for row in self.samples if len(centres) else []:
            sampled = changepoints_of(row, self.ends)
            for k, centre in enumerate(centres):
                if len(sampled):
                    samples[k].append(int(sampled[np.argmin(np.abs(sampled - centre))]))
        return np.array(
            [
                np.quantile(f, [low, high], method="inverted_cdf") if f else [c, c]
                for f, c in zip(samples, centres, strict=True)
            ]
        ).reshape(-1, 2)

    def primitives(self) -> Floats:
        """(n,) posterior probability of 0, 1, 2, ... primitives in use."""
        used = np.array([len(np.unique(row)) for row in self.samples])
        return np.bincount(used) / len(used)


def r_hat(traces: list[Floats]) -> Floats:
    """Split R̂ (Gelman et al. 2013, 11.4) of traces, each (S, n): (n,); 1 where nothing varies."""
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
    """Return the samples (K,) whose label, of (T,), differs from the one before, within each sequence."""
    changepoints = np.flatnonzero(np.diff(labels)) + 1
    return changepoints[~np.isin(changepoints, ends)].astype(np.int64)


def in_order(labels: Ints) -> Ints:
    """Renumber labels (T,) in order of first appearance."""
    _, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[inverse].astype(np.int64).reshape(-1)


def matched_labels(samples: Ints, reference: Ints, size: int) -> Ints:
    """Rename each row's labels (S, T), below `size`, to agree with `reference` (T,) in as many samples as possible."""
    overlaps = [
        np.bincount(row * size + reference, minlength=size * size).reshape(size, size)
        for row in samples
    ]
    partners = [linear_sum_assignment(overlap, maximize=True)[1] for overlap in overlaps]
    return np.stack([partner[row] for partner, row in zip(partners, samples, strict=True)]).astype(
        np.int64
    )


def pool(samples: list[Ints], traces: list[Floats], ends: Ints, lead: int) -> Posterior:
    """Put the chains together.

    The score of a sample is log p(x, labels) with emissions and transitions integrated out: unlike p(x | parameters), it does
    not grow with unneeded states. Chains whose mean score lies far below the best chain's are stuck and left out. All
    others' samples are matched to the best-scored sample, then to the estimate itself, until that stands still.

    Args:
        samples: per chain (S', T') labels.
        traces: per chain (S', 5).
        ends: index one past the last sample of each sequence, in samples.
        lead: samples missing at the head of each sequence; they get the label of the first row.
    """
    means = np.array([trace[:, 0].mean() for trace in traces])
    best = int(np.argmax(means))
    kept = means >= means[best] - max(10.0, 3.0 * float(traces[best][:, 0].std()))
    every = max(
        1, -(-sum(len(s) for s, keep in zip(samples, kept, strict=True) if keep) // MOST_SAMPLES)
    )
    stack = np.vstack([s[::every] for s, keep in zip(samples, kept, strict=True) if keep])
    chain = np.concatenate(
        [
            np.full(len(s[::every]), k)
            for k, (s, keep) in enumerate(zip(samples, kept, strict=True))
            if keep
        ]
    )
    scores = np.concatenate([t[::every, 0] for t, keep in zip(traces, kept, strict=True) if keep])
    estimate = stack[int(np.argmax(scores))]
    size = int(stack.max()) + 1
    for _ in range(3):
        matched = matched_labels(stack, estimate, size)
        votes = np.stack([(matched == k).sum(axis=0) for k in range(size)])
        update = votes.argmax(axis=0).astype(np.int64)
        if np.array_equal(update, estimate):
            break
        estimate = update
    stack = matched
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
