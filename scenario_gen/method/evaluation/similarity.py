# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How like its template, and how diverse, a set of scenarios is (method §7).

For a pair of vehicles let M_s be the feature matrix of sample s and T the template's. E is the
Frobenius norm of the mean of M_s - T over the norm of T. With D_s = M_s - T flattened and weights
w summing to 1, its square is w'Gw / |T|² with the Gram matrix G = D D'; so a bootstrap of E needs
the matrices once and then only G. Samples that are always drawn together (units) enter by their
sums, which makes G a quarter as large where they come in pairs.
"""

from dataclasses import dataclass

import numpy as np

from scenario_gen.method.evaluation.dtw import blocks, Distance, feature_extents, feature_rows
from scenario_gen.numerics import Bools, Floats, Ints


@dataclass(frozen=True, eq=False)
class PairSimilarity:
    """Sums over the feature matrices of one pair, for E and correlation under any weights.

    Attributes:
        gram: (U, U) inner products of D_r and D_s, where D_s is the sum over the samples of unit
            s.
        cross: (U,) inner products of D_s and T.
        total: (U,) sums of the entries of D_s.
        template: number of entries, their sum, and their sum of squares in T.
        count: (U,) samples of each unit.
    """

    gram: Floats
    cross: Floats
    total: Floats
    template: tuple[int, float, float]
    count: Floats

    def _shares(self, weights: Floats) -> Floats:
        """Return weights (B, U) divided by the weight of all samples."""
        return np.asarray(weights / (weights @ self.count)[:, None])

    def error(self, weights: Floats) -> Floats:
        """Return E (B,) under weights (B, U); NaN if T is zero (both vehicles always stand)."""
        shares = self._shares(weights)
        square = ((shares @ self.gram) * shares).sum(axis=1)
        norm = self.template[2]
        return (
            np.sqrt(np.maximum(square, 0.0) / norm)
            if norm > 0.0
            else np.full(len(weights), np.nan)
        )

    def correlation(self, weights: Floats) -> Floats:
        """Return Pearson's r (B,) of the mean matrix and T; NaN if one of them is constant."""
        shares = self._shares(weights)
        count, first, second = self.template
        variance = second - first * first / count
        total = shares @ self.total
        covariance = shares @ self.cross - total * first / count
        spread = ((shares @ self.gram) * shares).sum(axis=1) - np.square(total) / count
        generated = variance + 2.0 * covariance + spread
        with np.errstate(invalid="ignore", divide="ignore"):
            result = (variance + covariance) / np.sqrt(variance * generated)
        return np.where((variance > 1e-12 * count) & (generated > 1e-12 * count), result, np.nan)


def pair_similarity(
    template: tuple[Floats, Floats],
    generated: tuple[Floats, Floats],
    distance: Distance,
    unit: Ints,
    least: float = 0.0,
) -> PairSimilarity:
    """Compare the feature matrices of one pair of vehicles.

    Args:
        template: series of the two vehicles, (D, T) each.
        generated: series of the two vehicles in S samples, (S, D, T) each.
        distance: of the feature; the paper takes Euclidean for position, Manhattan for speed.
        unit: (S,) the number, from 0, of the unit of each sample.
        least: a template whose distances spread by less counts as constant: scaled to [0, 1] it
            would show its noise.
    """
    samples, _, steps = generated[0].shape
    order = np.argsort(unit, kind="stable")
    begins = np.flatnonzero(np.diff(unit[order], prepend=-1))
    a, b = (np.ascontiguousarray(series[order]) for series in generated)
    left, right = (np.ascontiguousarray(series)[None] for series in template)
    extents = feature_extents(a, b, distance)
    template_extents = feature_extents(left, right, distance)
    units = int(unit.max()) + 1
    gram, cross, total = np.zeros((units, units)), np.zeros(units), np.zeros(units)
    count = np.bincount(unit).astype(np.float64)
    first = second = 0.0
    if template_extents[0, 1] - template_extents[0, 0] < least:
        return PairSimilarity(gram, cross, total, (steps * steps, first, second), count)
    for rows in blocks(steps, samples * steps):
        target = feature_rows(left, right, template_extents, rows, distance)[0]
        difference = feature_rows(a, b, extents, rows, distance)
        difference -= target
        if units < samples:
            parts = np.split(difference, begins[1:])  # reduceat takes three times as long
            difference = np.stack([part.sum(axis=0) for part in parts])
        gram += difference @ difference.T
        cross += difference @ target
        total += difference @ np.ones(len(target))
        first += float(target.sum())
        second += float(np.square(target).sum())
    return PairSimilarity(gram, cross, total, (steps * steps, first, second), count)


def mean_error(pairs: list[PairSimilarity], weights: Floats) -> Floats:
    """Return E (B,) averaged over the pairs for which it is defined; NaN without one."""
    return _mean_over_pairs([pair.error(weights) for pair in pairs])


def mean_correlation(pairs: list[PairSimilarity], weights: Floats) -> Floats:
    """Return the correlation (B,) averaged over the pairs for which it is defined, or NaN."""
    return _mean_over_pairs([pair.correlation(weights) for pair in pairs])


def _mean_over_pairs(values: list[Floats]) -> Floats:
    if not values:
        return np.full(1, np.nan)
    table = np.stack(values)
    known = np.isfinite(table)
    count = known.sum(axis=0)
    return np.where(
        count > 0, np.where(known, table, 0.0).sum(axis=0) / np.maximum(count, 1), np.nan
    )


def displacements(position: Floats, counted: Bools) -> Floats:
    """Return (S, S): mean distance in metres between samples r and s, over vehicles and instants.

    Args:
        position: (S, N, T, 2) metres, at the same share of each sample's duration.
        counted: (N, T) vehicles and instants that count.
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


def _mean(distance: Floats, counted: Bools) -> Floats:
    """Mean (S,) of distances (S, N, T) over the vehicles and instants that count."""
    return np.asarray(
        distance.mean(axis=(1, 2)) if counted.all() else distance[:, counted].mean(axis=1)
    )


def displacement_to(position: Floats, target: Floats, counted: Bools) -> Floats:
    """Return the mean distance (S,) [m] of samples (S, N, T, 2) to a target (N, T, 2) (ADE).

    Only vehicles and instants in `counted` (N, T) enter.

    Source: the average displacement error (Pellegrini et al. 2009).
    """
    step = position - target
    return _mean(np.hypot(step[..., 0], step[..., 1]), counted)


def weighted_min(values: Floats, weights: Floats) -> Floats:
    """Return the least value (B,) among the samples (S,) that weights (B, S) contain.

    Source: the best of several samples, as minADE takes it (Gupta et al. 2018).
    """
    return np.asarray(np.where(weights > 0.0, values, np.inf).min(axis=1))
