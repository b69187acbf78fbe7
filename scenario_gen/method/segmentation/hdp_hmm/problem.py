# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What is sampled: the series, its lagged design, windows and the samples within them."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from scenario_gen.base.cancelling import stop_if_cancelled
from scenario_gen.base.errors import InputError
from scenario_gen.method.segmentation.hdp_hmm.chain import run_chain, TRACE
from scenario_gen.method.segmentation.hdp_hmm.config import GAUSSIAN_DOF, SamplerConfig
from scenario_gen.method.segmentation.hdp_hmm.emission import (
    accumulate,
    joint_prior,
    mean_emission,
    posterior_factor,
    square,
)
from scenario_gen.method.segmentation.hdp_hmm.merge import merge_states
from scenario_gen.method.segmentation.hdp_hmm.model import Data, Grid, Hyper, Joint, Out, Start
from scenario_gen.numerics import Bools, Floats, Ints
from scenario_gen.numerics.kernels import F1, F2, I, I1, kernel, OUT1, OUT2


def moving_mean(x: Floats, width: int) -> Floats:
    """Mean over `width` samples around each sample of x (T, ...); before the first and after the last one those repeat."""
    before = width // 2
    edges = [(before, width - 1 - before)] + [(0, 0)] * (x.ndim - 1)
    return np.asarray(
        sliding_window_view(np.pad(x, edges, mode="edge"), width, axis=0).mean(axis=-1)
    )


@kernel(F2, F1, I1, F2, I, OUT2, OUT2, OUT1)
def unexplained(
    v: Floats,
    mass: Floats,
    labels: Ints,
    g0: Floats,
    regressors: int,
    residual: Floats,
    scatter: Floats,
    squares: Floats,
) -> None:
    """Fit y = A z in each state, ridged by the prior; no BLAS, whose idle threads cost more than they save here.

    Args:
        v: (T, P + D) rows (z, y).
        mass: (T,) see `accumulate`.
        labels: (T,).
        g0: (P + D, P + D) joint prior of the emissions, see `emission`; its S0 has one degree of freedom.
        regressors: P.
        residual: (T, D) output, y - A z.
        scatter: (D, D) output, Σ mass residual residualᵀ.
        squares: (T,) output, squared length of each residual, whitened by its own state's covariance.
    """
    m, p = v.shape[1], regressors
    d = m - p
    states = 0
    for t in range(len(labels)):
        states = max(states, labels[t] + 1)
    outer, sums, factor = np.empty((states, m, m)), np.empty((states, 2)), np.empty((m, m))
    coef, shape, prior = np.empty((states, d, m)), np.empty(2), Joint(g0, 1.0, 1.0, np.zeros(d))
    accumulate(v, labels, mass, outer, sums)
    maps = np.empty((states, d, p))
    for k in range(states):
        posterior_factor(outer[k], sums[k, 1], prior, factor)
        mean_emission(factor, sums[k, 0], prior, coef[k], shape)
        for i in range(d):
            for j in range(p - 1, -1, -1):
                c = factor[p + i, j]
                for q in range(j + 1, p):
                    c -= maps[k, i, q] * factor[q, j]
                maps[k, i, j] = c / factor[j, j]
    scatter[:] = 0.0
    for t in range(len(labels)):
        coefficients, row = maps[labels[t]], residual[t]
        squares[t] = square(coef[labels[t]], v[t])
        for i in range(d):
            rest = v[t, p + i]
            for j in range(p):
                rest -= coefficients[i, j] * v[t, j]
            row[i] = rest
            for j in range(i + 1):
                scatter[i, j] += mass[t] * rest * row[j]
    for i in range(d):
        for j in range(i):
            scatter[j, i] = scatter[i, j]


START = (1.0, 50.0, 0.9)
MERGE_ROWS = (40.0, 0.1)
MEAN_WORTHS = (
    0.01,
    0.03,
    0.1,
    0.3,
    1.0,
    3.0,
)  # log-normal beforehand, about 0.1, with a factor of 4.5
MEAN_ODDS = (-1.2, -0.3, 0.0, -0.3, -1.2, -2.6)
EXTRA_DEGREES = (3.0, 6.0, 12.0, 25.0, 50.0, 100.0, 300.0, 1000.0)
FIT_RIDGE = 0.05  # K, in its units, where states are only described
GUESSED_DOF = 5.0  # until the data have said how heavy the noise's tails are


@dataclass(frozen=True, eq=False)
class Prior:
    """Prior of the emissions: mean (D, D) of the states' covariances, ν0 - D, and the precision K in units of the problem's."""

    within: Floats
    extra: float
    worth: float


@dataclass(frozen=True, eq=False)
class Place:
    """Where a chain stands: labels (T',) and masses (T',), see `accumulate`."""

    labels: Ints
    mass: Floats


@dataclass(frozen=True, eq=False)
class Problem:
    """The samples as the kernels want them.

    Attributes:
        v: (T', P + D) rows (z, y): regressors, then the sample itself; what is hidden is filled in.
        ends: index one past the last row of each sequence.
        regressors: P.
        mean: (D, P) prior mean M of the regression.
        precision: (P, P) unit of the prior K.
        worths: (B,) what K may be in units of it.
        odds: (B,) logarithms of how probable each is beforehand.
        lead: samples at the head of each sequence that have no full past and hence no row.
        weight: what a sample counts for.
        dof: degrees of freedom of Student-t noise; 0: Gaussian.
        blur: (D,) variance to which each channel is known at all.
        gaps: (R,) rows with hidden channels, rising.
        hidden: (R, D) which channels were not observed.
    """

    v: Floats
    ends: Ints
    regressors: int
    mean: Floats
    precision: Floats
    worths: Floats
    odds: Floats
    lead: int
    weight: float
    dof: float
    blur: Floats
    gaps: Ints
    hidden: Bools

    @property
    def dimensions(self) -> int:
        """D."""
        return int(self.v.shape[1]) - self.regressors

    @property
    def y(self) -> Floats:
        """(T', D) samples."""
        return self.v[:, self.regressors :]

    @property
    def observed(self) -> Floats:
        """(T',) masses to start from: 1, or 0 where nothing was observed."""
        mass = np.ones(len(self.v))
        mass[self.gaps[self.hidden.all(axis=1)]] = 0.0
        return mass

    @classmethod
    def build(cls, x: Floats, ends: Ints, config: SamplerConfig, blur: Floats) -> "Problem":
        """Stack regressors and samples of the standardised x (T, D), NaN where nothing was observed.

        An autoregressive sample counts for nothing unless it and the past it is regressed on were observed whole.

        Raises:
            InputError: a sequence is shorter than the order asks for.
        """
        d = x.shape[1]
        order = config.order if config.emission == "autoregressive" else 0
        starts = np.concatenate([[0], ends[:-1]])
        short = int((ends - starts).argmin())
        if order and ends[short] - starts[short] < order + 2:
            raise InputError(
                f"sequence {short} has {ends[short] - starts[short]} samples; an autoregressive emission of order {order} needs "
                f"{order + 2} or more: lower `order` or leave the sequence out"
            )
        filled = filled_in(x, ends)
        rows = [
            np.hstack(
                [
                    np.ones((b - a - order, 1)),
                    *[filled[a + order - lag : b - lag] for lag in range(1, order + 1)],
                    filled[a + order : b],
                ]
            )
            for a, b in zip(starts, ends, strict=True)
        ]
        lost = np.isnan(x)
        if order:
            broken = np.array(
                [
                    lost[t - order : t + 1].any()
                    for a, b in zip(starts, ends, strict=True)
                    for t in range(a + order, b)
                ]
            )
            lost = np.repeat(broken[:, None], d, axis=1)
        gaps = np.flatnonzero(lost.any(axis=1)).astype(np.int64)
        p = 1 + order * d
        mean = np.zeros((d, p))
        if order:
            mean[:, 1 : 1 + d] = np.eye(d)
        return cls(
            v=np.ascontiguousarray(np.vstack(rows)),
            ends=ends - order * np.arange(1, len(ends) + 1),
            regressors=p,
            mean=mean,
            precision=np.eye(p) * (config.mean_weight if order else 1.0),
            worths=np.array([1.0]) if order else np.array(MEAN_WORTHS),
            odds=np.zeros(1) if order else np.array(MEAN_ODDS),
            lead=order,
            weight=config.weight or 1.0,
            dof=GUESSED_DOF
            if config.dof == 0.0
            else (0.0 if config.dof >= GAUSSIAN_DOF else config.dof),
            blur=blur,
            gaps=gaps,
            hidden=lost[gaps],
        )

    def unexplained(self, place: Place) -> tuple[Floats, Floats, Floats]:
        """What the states' regressions leave: (T', D), its (D, D) scatter by mass, and its whitened squares (T',)."""
        d = self.dimensions
        residual, scatter, squares = (
            np.empty((len(self.v), d)),
            np.empty((d, d)),
            np.empty(len(self.v)),
        )
        g0 = joint_prior(self.mean, FIT_RIDGE * self.precision, np.eye(d))
        unexplained(
            self.v, place.mass, place.labels, g0, self.regressors, residual, scatter, squares
        )
        return residual, scatter, squares

    def within(self, place: Place) -> Floats:
        """(D, D) covariance of what the states leave unexplained, a little regularised."""
        scatter = self.unexplained(place)[1]
        samples = float((place.mass > 0.0).sum())
        freedom = max(samples - self.regressors * (place.labels.max() + 1), 0.5 * samples, 1.0)
        scatter = scatter / freedom + np.diag(self.blur)
        result: Floats = scatter + np.eye(self.dimensions) * (
            1e-3 * np.trace(scatter) / self.dimensions + 1e-6
        )
        return result

    def run(
        self,
        config: SamplerConfig,
        prior: Prior,
        place: Place,
        top: Floats,
        burn: int,
        keep: int,
        seed: int,
    ) -> tuple[Place, Prior, Ints, Floats]:
        """Run a chain from `place` for `burn` + `keep` sweeps.

        Args:
            config: hyperpriors and moves.
            prior: of the emissions.
            place: where it starts.
            top: (3 + L,) γ, α+κ, ρ and β; updated.
            burn: sweeps whose labels are not kept.
            keep: further sweeps.
            seed: any integer.

        Returns:
            Where it ends, the prior it holds there, kept labels (keep, T'), and the trace of all sweeps (burn + keep, 5).
        """
        stop_if_cancelled()
        samples = np.empty((keep, len(self.v)), np.int64)
        trace = np.empty((burn + keep, len(TRACE)))
        emissions = np.empty((len(top) - 3, self.dimensions, self.v.shape[1]))
        extras = np.array(EXTRA_DEGREES)
        chosen = np.array(
            [np.abs(extras - prior.extra).argmin(), np.abs(self.worths - prior.worth).argmin()]
        )
        v, mass = self.v.copy(), place.mass.copy()
        run_chain(
            Data(v, np.ascontiguousarray(v.T), self.gaps, self.hidden, mass, self.ends),
            Grid(self.mean, self.precision, prior.within, extras, self.worths, self.odds),
            Hyper(config.hyper, self.weight, self.dof, self.blur, config.moves),
            Start(place.labels, top, chosen),
            Out(samples, trace, emissions),
            seed,
        )
        held = Prior(prior.within, float(extras[chosen[0]]), float(self.worths[chosen[1]]))
        return Place(samples[-1], mass), held, samples, trace

    def merge(self, prior: Prior, place: Place) -> Place:
        """Merge states greedily under `prior`; returns where that leads, labels 0 .. K - 1 without gaps."""
        labels = compact(place.labels)
        g0 = joint_prior(
            self.mean, prior.worth * self.precision, prior.within * (prior.extra - 1.0)
        )
        joint = Joint(g0, self.dimensions + prior.extra, self.weight, self.blur)
        merge_states(self.v, place.mass, self.ends, joint, *MERGE_ROWS, labels)
        return Place(compact(labels), place.mass)


def new_top(states: int) -> Floats:
    """γ, α+κ, ρ and β (L,) to start from."""
    return np.concatenate([START, np.full(states, 1.0 / states)])


def filled_in(x: Floats, ends: Ints) -> Floats:
    """Return x (T, D) with NaN replaced by lines between neighbours within each sequence (0 where a channel has none)."""
    if not np.isnan(x).any():
        return x
    result = np.nan_to_num(x)
    for a, b in pairwise([0, *ends.tolist()]):
        for i in range(x.shape[1]):
            seen = np.flatnonzero(~np.isnan(x[a:b, i]))
            if len(seen):
                result[a:b, i] = np.interp(np.arange(b - a), seen, x[a:b, i][seen])
    return result


def compact(labels: Ints) -> Ints:
    """Renumber labels (T,) to 0 .. K - 1 without gaps."""
    return np.unique(labels, return_inverse=True)[1].astype(np.int64).reshape(-1)
