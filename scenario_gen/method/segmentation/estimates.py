# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A posterior over labels -> the parameters of each state, in the units of the series."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy import linalg, special

from scenario_gen.method.segmentation.hdp_hmm.config import SamplerConfig
from scenario_gen.method.segmentation.hdp_hmm.problem import filled_in, Problem
from scenario_gen.method.segmentation.posterior import Posterior
from scenario_gen.numerics import Floats, Ints

MAX_ROUNDS_COUNT, TOLERANCE_RATIO = 50, 1e-7  # of EM, in standardised units
RIDGE_RATIO = 1e-12  # to a variance: collinear channels make covariances singular


def regressed(x: Floats, ends: Ints, config: SamplerConfig) -> tuple[Problem, Ints]:
    """Stack regressors and samples of x (T, D); return also the sample (T',) of each row.

    Raises:
        InputError: a sequence is too short for the order.
    """
    problem = Problem.build(x, ends, config, np.zeros(x.shape[1]))
    rows = [np.arange(a + problem.lead, b) for a, b in pairwise([0, *ends.tolist()])]
    return problem, np.concatenate(rows)


@dataclass(frozen=True, eq=False)
class Emissions:
    """A (K, D, P) and Σ (K, D, D) of all states."""

    regression: Floats
    covariance: Floats


def whitened_squares(
    problem: Problem, emissions: Emissions, k: int, channels: Ints
) -> tuple[Floats, float]:
    """Return the squared whitened residuals (T',) of state k, and its log|Σ|^(-1/2).

    Only `channels` (D',) count.
    """
    covariance = emissions.covariance[k][np.ix_(channels, channels)]
    spread = np.diag(covariance)
    ridge = RIDGE_RATIO * np.diag(np.where(spread > 0.0, spread, 1.0))
    factor = np.linalg.cholesky(covariance + ridge)
    expected = problem.v[:, : problem.regressors] @ emissions.regression[k][channels].T
    residual = problem.y[:, channels] - expected
    white = linalg.solve_triangular(factor, residual.T, lower=True)
    return np.square(white).sum(axis=0), -float(np.log(np.diag(factor)).sum())


def log_densities(
    problem: Problem, emissions: Emissions, posterior: Posterior, weight: float
) -> Floats:
    """Return log p(y_t | z_t, state): (T', K); 0 for rows that were not observed.

    A weight of a sample below 1 tempers the density as in the sampler; the density is then known
    up to a constant per row. Channels that the sampler left out do not count.
    """
    n, dof = weight * len(posterior.channels), posterior.dof
    columns = []
    for k in range(len(emissions.regression)):
        squares, log_root = whitened_squares(problem, emissions, k, posterior.channels)
        column = weight * log_root - 0.5 * (weight * squares + n * np.log(2.0 * np.pi))
        if dof > 0.0:
            column = weight * log_root - 0.5 * (dof + n) * np.log1p(weight * squares / dof)
            column += special.gammaln(0.5 * (dof + n)) - special.gammaln(0.5 * dof)
            column -= 0.5 * n * np.log(np.pi * dof)
        columns.append(np.where(problem.observed > 0.0, column, 0.0))
    return np.column_stack(columns)


def estimate(
    x: Floats, ends: Ints, posterior: Posterior, config: SamplerConfig
) -> tuple[Floats, Floats, Floats]:
    """Return posterior means of each state's parameters, given how often each sample was in it.

    With r_t the share of the posterior's draws in which sample t is in the state, w the weight of
    a sample, u_t the mass of heavy-tailed noise (1 for Gaussian noise) and the prior
    (A, Σ) ~ MNIW(M, K, ν0, S0):

        K'  = K + w Σ r u z zᵀ              A = (M K + w Σ r u y zᵀ) K'⁻¹
        S'  = S0 + w Σ r u (y - A z)(y - A z)ᵀ + (A - M) K (A - M)ᵀ
        E Σ = S' / (ν0 + w Σ r - D - 1)

    With z = 1, A is the mean and K is κ0. κ0 and ν0 are the drawn ones, and S0 = (ν0 - D - 1) ×
    the covariance within states. Masses have their means given A and Σ, which EM iterates.
    Channels that the sampler left out are included, but masses ignore them.

    Source: Fox et al. 2011.

    Args:
        x: (T, D), NaN for outliers.
        ends: one past the index of the last sample of each sequence.
        posterior: of these samples.
        config: model.

    Returns:
        Means (K, D), covariances (K, D, D) and regressions (K, D, P) in x's units.
    """
    centre, spread = np.nanmean(x, axis=0), np.nanstd(x, axis=0)
    varies = spread > 1e-9 * np.maximum(np.nanmax(np.abs(x), axis=0), 1e-300)
    unit = np.where(varies, spread, 1.0)
    problem, rows = regressed((x - centre) / unit, ends, config)
    states = int(posterior.labels.max()) + 1
    share = np.stack([(posterior.samples == k).mean(axis=0) for k in range(states)])
    standardised = fit_emissions(problem, share[:, rows], posterior)
    regression = standardised.regression * unit[:, None]
    p = problem.regressors
    if p > 1:
        regression[:, :, 1:] /= np.tile(unit, problem.lead)
    slopes = regression[:, :, 1:] * np.tile(centre, problem.lead)
    regression[:, :, 0] += centre - slopes.sum(axis=2)
    covariance = standardised.covariance * unit[:, None] * unit
    means = regression[:, :, 0].copy()
    if p > 1:
        means = share @ filled_in(x, ends) / share.sum(axis=1, keepdims=True)
    return means, covariance, regression


def fit_emissions(problem: Problem, share: Floats, posterior: Posterior) -> Emissions:
    """Iterate the equations of `estimate` by EM; `share` (K, T') is that of each row's draws."""
    d, p, states = problem.dimensions, problem.regressors, len(share)
    share = share * problem.observed
    weight, dof, freedom = posterior.weight, posterior.dof, posterior.extra - 1.0
    degrees = dof + weight * len(posterior.channels)
    mean, precision = problem.mean, problem.precision * posterior.worth
    total = share.sum(axis=1)
    covariance = np.repeat(np.eye(d)[None], states, axis=0)
    fitted = Emissions(np.repeat(mean[None], states, axis=0), covariance)
    if p == 1:
        fitted.regression[:, :, 0] = (share @ problem.y) / np.maximum(total, 1e-300)[:, None]
    for _ in range(MAX_ROUNDS_COUNT):
        regression, scatter = np.empty_like(fitted.regression), np.empty_like(covariance)
        for k in range(states):
            mass = share[k]
            if dof > 0.0:
                squares, _ = whitened_squares(problem, fitted, k, posterior.channels)
                mass = mass * degrees / (dof + weight * squares)
            outer = (problem.v * mass[:, None]).T @ problem.v
            pull = mean @ precision + weight * outer[p:, :p]
            a = linalg.solve(precision + weight * outer[:p, :p], pull.T, assume_a="pos").T
            residual = problem.y - problem.v[:, :p] @ a.T
            scatter[k] = (residual * mass[:, None]).T @ residual
            regression[k] = a
        samples = float(total.sum())
        within = scatter.sum(axis=0) / max(samples - p * states, 0.5 * samples, 1.0)
        shift = regression - mean
        from_prior = shift @ precision @ shift.transpose(0, 2, 1)
        covariance = freedom * within + weight * scatter + from_prior
        covariance = covariance / (freedom + weight * total)[:, None, None]
        moved = max(
            np.abs(regression - fitted.regression).max(),
            np.abs(covariance - fitted.covariance).max(),
        )
        fitted = Emissions(regression, covariance)
        if dof == 0.0 or moved < TOLERANCE_RATIO:
            break
    return fitted


def mean_transitions(posterior: Posterior, states: int) -> tuple[Floats, Floats]:
    """Return the posterior mean of the transitions (K, K), and of the first state (K,).

    E π_j = (α β + κ δ_j + n_j) / (α + κ + n_j.), with the counts n averaged over the posterior's
    samples, and α, κ, γ over its trace; for the first state κ is 0. β, which is not stored, has
    its mean given that each segment opened one table of its state.

    Source: Fox et al. 2011, algorithm 3, step 4.
    """
    if not posterior.trace:
        return np.ones((1, 1)), np.ones(1)
    samples, size = posterior.samples, max(int(posterior.samples.max()) + 1, states)
    starts = np.concatenate([[0], posterior.ends[:-1]])
    inside = np.setdiff1d(np.arange(1, samples.shape[1]), starts)
    codes = samples[:, inside - 1] * size + samples[:, inside]
    pairs = np.bincount(codes.ravel(), minlength=size * size).reshape(size, size)
    first = np.bincount(samples[:, starts].ravel(), minlength=size)
    counts, first_counts = pairs / len(samples), first / len(samples)
    kept = [trace for trace, keep in zip(posterior.trace, posterior.kept, strict=True) if keep]
    _, _, gamma, total, rho = np.concatenate(kept).mean(axis=0)
    dwells = counts.sum(axis=0) - np.diag(counts) + first_counts
    beta = (gamma / posterior.states + dwells) / (gamma + dwells.sum())
    alpha = (1.0 - rho) * total
    transitions = (alpha * beta + rho * total * np.eye(size) + counts)[:states, :states]
    initial = (alpha * beta + first_counts)[:states]
    return transitions / transitions.sum(axis=1, keepdims=True), initial / initial.sum()
