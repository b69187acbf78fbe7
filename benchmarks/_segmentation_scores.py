# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How a segmentation is scored, and the best that can be had: the smoother that knows the true parameters."""

import numpy as np
from scipy.optimize import linear_sum_assignment

from benchmarks._segmentation_data import Labelled
from scenario_gen.numerics.arrays import Floats, Ints


def hamming(truth: Ints, estimate: Ints) -> float:
    """Share of samples with the wrong label after the best one-to-one renaming."""
    size = int(max(truth.max(), estimate.max())) + 1
    overlap = np.zeros((size, size))
    np.add.at(overlap, (truth, estimate), 1.0)
    rows, columns = linear_sum_assignment(-overlap)
    return float(1.0 - overlap[rows, columns].sum() / len(truth))


def f1(truth: Ints, estimate: Ints, tolerance: int) -> float:
    """F1 of changepoints, each matched to at most one other within `tolerance` samples."""
    hits = i = j = 0
    while i < len(truth) and j < len(estimate):
        if abs(int(truth[i]) - int(estimate[j])) <= tolerance:
            hits, i, j = hits + 1, i + 1, j + 1
        elif truth[i] < estimate[j]:
            i += 1
        else:
            j += 1
    return 2.0 * hits / (len(truth) + len(estimate)) if len(truth) + len(estimate) else 1.0


def changes(labels: Ints) -> Ints:
    """Samples whose label differs from the one before."""
    return np.flatnonzero(np.diff(labels)) + 1


def smoother(sequence: Labelled, dof: float = 0.0) -> Ints:
    """(T,) the most probable label of each sample under the true parameters; `dof` > 0: of Student's t."""
    assert (
        sequence.means is not None
        and sequence.covariances is not None
        and sequence.transition is not None
    )
    log_likelihood = np.empty((len(sequence.x), len(sequence.means)))
    for k, (mean, covariance) in enumerate(zip(sequence.means, sequence.covariances, strict=True)):
        factor = np.linalg.cholesky(covariance)
        rest = np.linalg.solve(factor, (sequence.x - mean).T)
        squares = (rest**2).sum(axis=0)
        squares = (dof + len(mean)) * np.log1p(squares / dof) if dof else squares
        log_likelihood[:, k] = -0.5 * squares - np.log(np.diag(factor)).sum()
    likelihood: Floats = np.exp(log_likelihood - log_likelihood.max(axis=1, keepdims=True))
    forward, backward = np.empty_like(likelihood), np.ones_like(likelihood)
    forward[0] = likelihood[0] / likelihood[0].sum()
    for t in range(1, len(likelihood)):
        forward[t] = forward[t - 1] @ sequence.transition * likelihood[t]
        forward[t] /= forward[t].sum()
    for t in range(len(likelihood) - 2, -1, -1):
        backward[t] = sequence.transition @ (likelihood[t + 1] * backward[t + 1])
        backward[t] /= backward[t].sum()
    best: Ints = (forward * backward).argmax(axis=1).astype(np.int64)
    return best
