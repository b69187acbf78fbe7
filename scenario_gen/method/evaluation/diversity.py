# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Differences within a set, and the distance of its nearest scenario to the replay."""

import numpy as np

from scenario_gen.numerics import Bools, Floats


def displacements(position: Floats, counted: Bools | None = None) -> Floats:
    """Return (S, S): mean distance in metres between samples r and s, over vehicles and instants.

    Args:
        position: (S, N, T, 2) metres, at the same share of each sample's duration.
        counted: (N, T) vehicles and instants that count; None: all.
    """
    samples = position.shape[0]
    table = np.zeros((samples, samples))
    x, y = np.ascontiguousarray(np.moveaxis(position, -1, 0))
    for s in range(samples - 1):
        squared = np.square(x[s + 1 :] - x[s]) + np.square(y[s + 1 :] - y[s])
        table[s, s + 1 :] = _mean(np.sqrt(squared), counted)
    return table + table.T


def diversity(table: Floats, weights: Floats) -> Floats:
    """Return the mean displacement (B,) of two samples under weights (B, S); NaN for one.

    A sample drawn twice makes no pair with itself, or resampling would shrink the diversity.
    """
    total = ((weights @ table) * weights).sum(axis=1)
    pairs = np.square(weights.sum(axis=1)) - np.square(weights).sum(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(total / pairs)


def _mean(distance: Floats, counted: Bools | None) -> Floats:
    """Mean (S,) of distances (S, N, T) over the vehicles and instants that count."""
    return np.asarray(
        distance.mean(axis=(1, 2))
        if counted is None or counted.all()
        else distance[:, counted].mean(axis=1)
    )


def displacement_to(position: Floats, target: Floats, counted: Bools | None = None) -> Floats:
    """Return the mean distance (S,) [m] of samples (S, N, T, 2) to a target (N, T, 2) (ADE).

    Only vehicles and instants in `counted` (N, T) enter; None: all.

    Source: the average displacement error (Pellegrini et al. 2009).
    """
    step = position - target
    return _mean(np.hypot(step[..., 0], step[..., 1]), counted)


def weighted_min(values: Floats, weights: Floats) -> Floats:
    """Return the least value (B,) among the samples (S,) that weights (B, S) contain.

    Source: the best of several samples, as minADE takes it (Gupta et al. 2018).
    """
    return np.asarray(np.where(weights > 0.0, values, np.inf).min(axis=1))
