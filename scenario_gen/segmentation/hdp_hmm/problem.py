# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""What is sampled: the series, its lagged design, windows and the samples within them."""

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from scenario_gen.arrays import Floats, Ints
from scenario_gen.cancelling import stop_if_cancelled
from scenario_gen.kernels import F2, I, I1, kernel, OUT2
from scenario_gen.segmentation.hdp_hmm.chain import run_chain, TRACE
from scenario_gen.segmentation.hdp_hmm.config import SamplerConfig
from scenario_gen.segmentation.hdp_hmm.emission import accumulate, cholesky, joint_prior
from scenario_gen.segmentation.hdp_hmm.merge import merge_states


def moving_mean(x: Floats, width: int) -> Floats:
    """Mean over `width` samples around each sample of x (T, ...); before the first and after the last one those repeat."""
    before = width // 2
    edges = [(before, width - 1 - before)] + [(0, 0)] * (x.ndim - 1)
    return np.asarray(sliding_window_view(np.pad(x, edges, mode="edge"), width, axis=0).mean(axis=-1))


@kernel(F2, I1, F2, I, OUT2, OUT2)
def unexplained(v: Floats, labels: Ints, g0: Floats, regressors: int, residual: Floats, scatter: Floats) -> None:
    """Fit y = A z in each state, ridged by the prior; no BLAS, whose idle threads cost more than they save here.

    Args:
        v: (T, P + D) rows (z, y).
        labels: (T,).
        g0: (P + D, P + D) joint prior of the emissions, see `_emission`.
        regressors: P.
        residual: (T, D) output, y - A z.
        scatter: (D, D) output, Σ residual residualᵀ.
    """
    m, p = v.shape[1], regressors
    states = 0
    for t in range(len(labels)):
        states = max(states, labels[t] + 1)
    g = np.empty((states, m, m))
    counts = np.empty(states, np.int64)
    accumulate(v, labels, g0, 1.0, np.zeros(m - p), g, counts)
    maps = np.empty((states, m - p, p))
    for k in range(states):
        cholesky(g[k])
        for i in range(m - p):
            for j in range(p - 1, -1, -1):
                c = g[k, p + i, j]
                for q in range(j + 1, p):
                    c -= maps[k, i, q] * g[k, q, j]
                maps[k, i, j] = c / g[k, j, j]
    scatter[:] = 0.0
    for t in range(len(labels)):
        coefficients, row = maps[labels[t]], residual[t]
        for i in range(m - p):
            rest = v[t, p + i]
            for j in range(p):
                rest -= coefficients[i, j] * v[t, j]
            row[i] = rest
            for j in range(i + 1):
                scatter[i, j] += rest * row[j]
    for i in range(m - p):
        for j in range(i):
            scatter[j, i] = scatter[i, j]


START = (1.0, 50.0, 0.9)
MERGE_ROWS = (40.0, 0.1)


@dataclass(frozen=True, eq=False)
class Prior:
    """Scale S0 (D, D) and degrees of freedom ν0 of the states' covariances, precision K (P, P) of their regressions."""

    scale: Floats
    nu: float
    precision: Floats


@dataclass(frozen=True, eq=False)
class Problem:
    """The samples as the kernels want them.

    Attributes:
        v: (T', P + D) rows (z, y): regressors, then the sample itself.
        vt: its transpose.
        ends: index one past the last row of each sequence.
        regressors: P.
        mean: (D, P) prior mean M of the regression.
        precision: (P, P) first guess of the prior K.
        lead: samples at the head of each sequence that have no full past and hence no row.
        weight: what a sample counts for.
        blur: (D,) variance to which each channel is known at all.
    """

    v: Floats
    vt: Floats
    ends: Ints
    regressors: int
    mean: Floats
    precision: Floats
    lead: int
    weight: float
    blur: Floats

    @property
    def dimensions(self) -> int:
        """D."""
        return int(self.v.shape[1]) - self.regressors

    @property
    def y(self) -> Floats:
        """(T', D) samples."""
        return self.v[:, self.regressors :]

    @classmethod
    def build(cls, x: Floats, ends: Ints, config: SamplerConfig, blur: Floats) -> "Problem":
        """Stack regressors and samples of the standardised x (T, D)."""
        d = x.shape[1]
        order = config.order if config.emission == "autoregressive" else 0
        starts = np.concatenate([[0], ends[:-1]])
        order = min(order, int((ends - starts).min()) - 2)
        rows = [
            np.hstack(
                [np.ones((b - a - order, 1)), *[x[a + order - lag : b - lag] for lag in range(1, order + 1)], x[a + order : b]]
            )
            for a, b in zip(starts, ends, strict=True)
        ]
        v = np.ascontiguousarray(np.vstack(rows))
        p = 1 + order * d
        mean = np.zeros((d, p))
        if order:
            mean[:, 1 : 1 + d] = np.eye(d)
        precision = np.eye(p) * config.mean_weight
        return cls(
            v,
            np.ascontiguousarray(v.T),
            ends - order * np.arange(1, len(ends) + 1),
            p,
            mean,
            precision,
            order,
            config.weight,
            blur,
        )

    def unexplained(self, labels: Ints) -> tuple[Floats, Floats]:
        """(T', D) what the regressions of the states given by `labels` leave unexplained, and its (D, D) scatter."""
        d = self.dimensions
        residual, scatter = np.empty((len(self.v), d)), np.empty((d, d))
        g0 = joint_prior(self.mean, self.precision, np.eye(d))
        unexplained(self.v, labels, g0, self.regressors, residual, scatter)
        return residual, scatter

    def within(self, labels: Ints) -> Floats:
        """(D, D) covariance of what the states given by `labels` leave unexplained, a little regularised."""
        scatter = self.unexplained(labels)[1]
        samples = len(self.v)
        freedom = max(samples - self.regressors * (labels.max() + 1), samples // 2)
        scatter = scatter / freedom + np.diag(self.blur)
        result: Floats = scatter + np.eye(self.dimensions) * (1e-3 * np.trace(scatter) / self.dimensions + 1e-6)
        return result

    def run(self, config: SamplerConfig, prior: Prior, labels: Ints, burn: int, keep: int, seed: int) -> tuple[Ints, Floats]:
        """Run a chain from `labels` for `burn` + `keep` sweeps; returns kept labels (keep, T') and their trace (keep, 5)."""
        stop_if_cancelled()
        samples = np.empty((keep, len(self.v)), np.int64)
        trace = np.empty((burn + keep, len(TRACE)))
        emissions = np.empty((config.states, self.dimensions, self.v.shape[1]))
        hyper = np.concatenate([config.hyper, [prior.nu, self.weight], self.blur])
        g0 = joint_prior(self.mean, prior.precision, prior.scale)
        top = np.concatenate([START, np.full(config.states, 1.0 / config.states)])
        run_chain(self.v, self.vt, self.ends, g0, hyper, labels, top, self.regressors, seed, burn, samples, trace, emissions)
        return samples, trace[burn:]

    def merge(self, config: SamplerConfig, prior: Prior, labels: Ints) -> tuple[float, Ints]:
        """Merge states greedily under `prior`; returns log p(samples | labels) and the labels (T',)."""
        merged = labels.copy()
        score = np.zeros(1)
        hyper = np.concatenate([config.hyper, [prior.nu, self.weight], self.blur])
        g0 = joint_prior(self.mean, prior.precision, prior.scale)
        merge_states(self.v, self.ends, g0, hyper, self.regressors, *MERGE_ROWS, score, merged)
        return float(score[0]), compact(merged)


def compact(labels: Ints) -> Ints:
    """Renumber labels (T,) to 0 .. K - 1 without gaps."""
    return np.unique(labels, return_inverse=True)[1].astype(np.int64).reshape(-1)
