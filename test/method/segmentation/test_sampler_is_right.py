# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The sampler is correct: Geweke's joint-distribution test, and calibration under the prior."""

import numpy as np
import pytest
from support.lengths import LONG

from scenario_gen.method.segmentation.hdp_hmm.chain import run_chain
from scenario_gen.method.segmentation.hdp_hmm.model import Data, Grid, Hyper, Out, Start

HYPER = np.array([3.0, 1.0, 6.0, 0.5, 4.0, 2.0])
STATES = 4
EXTRAS, WORTHS = np.array([6.0, 9.0, 20.0]), np.array([0.5, 1.0, 3.0])
ODDS = np.array([0.2, 0.5, 0.3])


def draw_prior(rng, samples, d, order):
    """Draw labels, series, concentrations, means and scales from the model."""
    gamma = rng.gamma(HYPER[0]) / HYPER[1]
    total = rng.gamma(HYPER[2]) / HYPER[3]
    rho = rng.beta(HYPER[4], HYPER[5])
    beta = np.maximum(rng.dirichlet(np.full(STATES, gamma / STATES)), 1e-12)
    own = rho * total * np.eye(STATES)
    pi = np.array(
        [rng.dirichlet(np.maximum((1 - rho) * total * beta + own[j], 1e-9)) for j in range(STATES)]
    )
    first = rng.dirichlet(np.maximum((1 - rho) * total * beta, 1e-9))
    labels = np.empty(samples, np.int64)
    labels[0] = rng.choice(STATES, p=first)
    for t in range(1, samples):
        labels[t] = rng.choice(STATES, p=pi[labels[t - 1]])
    p = 1 + order * d
    chosen = np.array([rng.integers(len(EXTRAS)), rng.choice(len(WORTHS), p=ODDS)])
    extra, worth = EXTRAS[chosen[0]], WORTHS[chosen[1]]
    mean, precision, within = prior(d, order)
    bartlett = np.zeros((STATES, d, d))
    for k in range(STATES):
        for i in range(d):
            bartlett[k, i, i] = np.sqrt(rng.chisquare(d + extra - i))
            bartlett[k, i, :i] = rng.normal(size=i)
    scale_root = np.linalg.cholesky(within * (extra - 1.0))
    roots = np.array([scale_root @ np.linalg.inv(b).T for b in bartlett])
    column_root = np.linalg.inv(np.linalg.cholesky(worth * precision))
    regressions = np.array([mean + root @ rng.normal(size=(d, p)) @ column_root for root in roots])
    return labels, regressions, roots, np.concatenate([[gamma, total, rho], beta]), chosen


def prior(d, order):
    """Mean M, unit of the precision K, and mean covariance of the emissions."""
    p = 1 + order * d
    mean = np.zeros((d, p))
    if order:
        mean[:, 1:] = 0.5 * np.eye(d)
    return mean, np.diag([0.5] + [40.0] * (p - 1)), np.eye(d) * 0.6 + 0.1


def draw_masses(rng, samples, dof, gap):
    """Masses of a series: Gamma(dof / 2, dof / 2), or 1; 0 where nothing was observed."""
    mass = rng.gamma(0.5 * dof, 2.0 / dof, samples) if dof else np.ones(samples)
    mass[gap] = 0.0
    return mass


def draw_series(rng, labels, regressions, roots, mass, order):
    """Rows v = (regressors, sample) of a series given labels and emissions; the past is zero."""
    d = roots.shape[1]
    past = np.zeros(d)
    rows = []
    for k, m in zip(labels, np.where(mass > 0.0, mass, 1.0), strict=True):
        z = np.concatenate([[1.0], past]) if order else np.ones(1)
        x = regressions[k] @ z + roots[k] @ rng.normal(size=d) / np.sqrt(m)
        rows.append(np.concatenate([z, x]))
        past = x
    return np.array(rows)


def gibbs(v, labels, top, mass, chosen, d, order, dof, moves, seed):
    """Labels, concentrations, regressions after a sweep; `mass`, `chosen` are updated."""
    samples = np.empty((1, len(v)), np.int64)
    trace = np.empty((1, 5))
    emissions = np.empty((STATES, d, v.shape[1]))
    top = top.copy()
    run_chain(
        Data(v, np.ascontiguousarray(v.T), mass, np.array([len(v)])),
        Grid(*prior(d, order), EXTRAS, WORTHS, np.log(ODDS)),
        Hyper(HYPER, 1.0, dof, np.zeros(d), moves),
        Start(labels, top, chosen),
        Out(samples, trace, emissions),
        seed,
    )
    whitening = emissions[:, :, 1 + order * d :]
    regressions = np.linalg.solve(whitening, -emissions[:, :, : 1 + order * d])
    return samples[0], top, regressions, np.linalg.inv(whitening)


def statistics(labels, v, top, chosen, d):
    """What both ways of drawing must agree on."""
    y = v[:, -d:]
    return [
        np.log(top[0]),
        np.log(top[1]),
        top[2],
        len(np.unique(labels)),
        (np.diff(labels) != 0).mean(),
        np.tanh(y[:, 0].mean()),
        np.log((y**2).mean()),
        np.tanh((y[1:, 0] * y[:-1, 0]).mean()),
        chosen[0],
        chosen[1],
    ]


NO_GAP, GAP = slice(0), slice(5, 7)  # samples that were not observed
CASES = {
    "gaussian": (0, 0.0, 0, NO_GAP),
    "gaussian, moves": (0, 0.0, 5, NO_GAP),
    "student": (0, 4.0, 2, NO_GAP),
    "gap": (0, 0.0, 2, GAP),
    "student, gap": (0, 4.0, 2, GAP),
    "autoregressive": (1, 0.0, 2, NO_GAP),
    "autoregressive, student": (1, 6.0, 2, NO_GAP),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", list(CASES))
def test_geweke(case):
    """Prior draws and the chain labels, parameters | series | ... have the same moments."""
    order, dof, moves, gap = CASES[case]
    d, samples, draws = 2, 12, 2500 if LONG else 400
    rng = np.random.default_rng([11, list(CASES).index(case)])
    forward = []
    for _ in range(draws):
        labels, regressions, roots, top, chosen = draw_prior(rng, samples, d, order)
        mass = draw_masses(rng, samples, dof, gap)
        forward.append(
            statistics(
                labels, draw_series(rng, labels, regressions, roots, mass, order), top, chosen, d
            )
        )
    labels, regressions, roots, top, chosen = draw_prior(rng, samples, d, order)
    mass = draw_masses(rng, samples, dof, gap)
    chain = []
    for sweep in range(4 * draws):
        v = draw_series(rng, labels, regressions, roots, mass, order)
        chain.append(statistics(labels, v, top, chosen, d))
        labels, top, regressions, roots = gibbs(
            v, labels, top, mass, chosen, d, order, dof, moves, 1000 + sweep
        )
    forward, chain = np.array(forward), np.array(chain)
    batches = chain[: len(chain) // 40 * 40].reshape(40, -1, chain.shape[1]).mean(axis=1)
    error = np.sqrt(forward.var(axis=0) / len(forward) + batches.var(axis=0) / len(batches))
    z = (forward.mean(axis=0) - chain.mean(axis=0)) / error
    assert np.abs(z).max() < 4.5, z
