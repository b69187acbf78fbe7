# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The sampling problem: the series with its regressors, outliers, and priors."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from scenario_gen.base.cancelling import stop_if_cancelled
from scenario_gen.base.errors import InputError
from scenario_gen.method.segmentation.hdp_hmm.chain import run_chain, TRACE
from scenario_gen.method.segmentation.hdp_hmm.config import GAUSSIAN_DOF_COUNT, SamplerConfig
from scenario_gen.method.segmentation.hdp_hmm.emission import (
    accumulate,
    joint_prior,
    mean_emission,
    posterior_factor,
    square,
)
from scenario_gen.method.segmentation.hdp_hmm.merge import merge_states
from scenario_gen.method.segmentation.hdp_hmm.model import Data, Grid, Hyper, Joint, Out, Start
from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.kernels import F1, F2, I, I1, kernel, OUT1, OUT2


def moving_mean(x: Floats, width: int) -> Floats:
    """Return the mean over `width` samples around each sample of x (T, ...).

    The first and the last sample are repeated beyond the ends.
    """
    before = width // 2
    edges = [(before, width - 1 - before)] + [(0, 0)] * (x.ndim - 1)
    return np.asarray(
        sliding_window_view(np.pad(x, edges, mode="edge"), width, axis=0).mean(axis=-1)
    )


@kernel(inline=True)
def regression_of(factor: Floats, p: int, out: Floats) -> None:
    """Fill out (D, P) with the regression A = Lyz Lz⁻¹ from a state's factor (P + D, P + D)."""
    for i in range(len(out)):
        for j in range(p - 1, -1, -1):
            c = factor[p + i, j]
            for q in range(j + 1, p):
                c -= out[i, q] * factor[q, j]
            out[i, j] = c / factor[j, j]


@kernel(inline=True)
def add_residual(v: Floats, mass: float, regression: Floats, row: Floats, scatter: Floats) -> None:
    """Fill row (D,) with y - A z of a sample v, and add its square to scatter (D, D)."""
    d, p = regression.shape
    for i in range(d):
        rest = v[p + i]
        for j in range(p):
            rest -= regression[i, j] * v[j]
        row[i] = rest
        for j in range(i + 1):
            scatter[i, j] += mass * rest * row[j]


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
    """Fit y = A z in each state, regularised by the prior; no BLAS, whose idle threads are slow.

    Args:
        v: (T, P + D) rows (z, y).
        mass: (T,) see `accumulate`.
        labels: (T,).
        g0: (P + D, P + D) prior of the emissions, see `emission`; S0 has one degree of freedom.
        regressors: P.
        residual: (T, D) output, y - A z.
        scatter: (D, D) output, Σ mass residual residualᵀ.
        squares: (T,) output, squared length of each residual, whitened by its state's covariance.
    """
    m, p, states = v.shape[1], regressors, labels.max() + 1
    d = m - p
    outer, sums, factor = np.empty((states, m, m)), np.empty((states, 2)), np.empty((m, m))
    coef, shape, prior = np.empty((states, d, m)), np.empty(2), Joint(g0, 1.0, 1.0, np.zeros(d))
    accumulate(v, labels, mass, outer, sums)
    regression = np.empty((states, d, p))
    for k in range(states):
        posterior_factor(outer[k], sums[k, 1], prior, factor)
        mean_emission(factor, sums[k, 0], prior, coef[k], shape)
        regression_of(factor, p, regression[k])
    scatter[:] = 0.0
    for t in range(len(labels)):
        k = labels[t]
        squares[t] = square(coef[k], v[t])
        add_residual(v[t], mass[t], regression[k], residual[t], scatter)
    for i in range(d):
        for j in range(i):
            scatter[j, i] = scatter[i, j]


INITIAL_TOP_RATIO = (1.0, 50.0, 0.9)  # γ, α+κ, ρ
MERGE_WEIGHT = (40.0, 0.1)  # of a row's prior for the state itself and for every other one
# Candidates for κ0 and their log prior probabilities: log-normal about 0.1, with a factor of 4.5.
MEAN_WORTHS = np.array([0.01, 0.03, 0.1, 0.3, 1.0, 3.0])
MEAN_ODDS = np.array([-1.2, -0.3, 0.0, -0.3, -1.2, -2.6])
EXTRA_DEGREES = np.array([3.0, 6.0, 12.0, 25.0, 50.0, 100.0, 300.0, 1000.0])  # ν0 - D
FIT_WEIGHT = 0.05  # K, in its units, where states are only described
INITIAL_DOF_COUNT = 5.0  # of the noise, until it is estimated


@dataclass(frozen=True, eq=False)
class Prior:
    """Prior of the emissions.

    Attributes:
        within: (D, D) mean of the states' covariances.
        extra: ν0 - D.
        worth: K, in units of the problem's precision.
    """

    within: Floats
    extra: float
    worth: float


@dataclass(frozen=True, eq=False)
class Place:
    """The state of a chain: labels (T',) and masses (T',), see `accumulate`."""

    labels: Ints
    mass: Floats


@dataclass(frozen=True, eq=False)
class Problem:
    """The samples and priors, as input of the kernels.

    Attributes:
        v: (T', P + D) rows (z, y): regressors, then the sample.
        ends: one past the index of the last row of each sequence.
        regressors: P.
        mean: (D, P) prior mean M of the regression.
        precision: (P, P) unit of the prior K.
        worths: (B,) candidates for K in units of it.
        odds: (B,) logarithms of their prior probabilities.
        lead: samples at the head of each sequence without a full past, hence without a row.
        weight: of a sample.
        dof: degrees of freedom of Student-t noise; 0: Gaussian.
        blur: (D,) variance of each channel's measurement error.
        observed: (T',) initial masses: 1, or 0 where nothing was observed.
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
    observed: Floats

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
        """Stack regressors and samples of the standardised x (T, D), NaN for outliers.

        Outliers are interpolated. A sample has mass 0 if all its channels are outliers, an
        autoregressive one if it or its regressors have any.

        Raises:
            InputError: a sequence is shorter than the order requires.
        """
        d = x.shape[1]
        order = config.order if config.emission == "autoregressive" else 0
        bounds = list(pairwise([0, *ends.tolist()]))
        _refuse_short(bounds, order)
        filled = filled_in(x, ends)
        lags = range(1, order + 1)
        rows = []
        for a, b in bounds:
            past = [filled[a + order - lag : b - lag] for lag in lags]
            rows.append(np.hstack([np.ones((b - a - order, 1)), *past, filled[a + order : b]]))
        v = np.ascontiguousarray(np.vstack(rows))
        is_outlier = np.isnan(x)
        is_lost = np.asarray(is_outlier.any(axis=1) if order else is_outlier.all(axis=1))
        windows = [sliding_window_view(is_lost[a:b], order + 1) for a, b in bounds]
        observed = np.ones(len(v))
        observed[np.concatenate([window.any(axis=1) for window in windows])] = 0.0
        p = 1 + order * d
        mean = np.zeros((d, p))
        if order:
            mean[:, 1 : 1 + d] = np.eye(d)
        dof = INITIAL_DOF_COUNT if config.dof == 0.0 else config.dof
        return cls(
            v=v,
            ends=ends - order * np.arange(1, len(ends) + 1),
            regressors=p,
            mean=mean,
            precision=np.eye(p) * (config.mean_weight if order else 1.0),
            worths=np.array([1.0]) if order else MEAN_WORTHS,
            odds=np.zeros(1) if order else MEAN_ODDS,
            lead=order,
            weight=config.weight or 1.0,
            dof=0.0 if dof >= GAUSSIAN_DOF_COUNT else dof,
            blur=blur,
            observed=observed,
        )

    def unexplained(self, place: Place) -> tuple[Floats, Floats, Floats]:
        """Return residuals (T', D) of the states, their scatter (D, D), whitened squares (T',)."""
        d, rows = self.dimensions, len(self.v)
        residual, scatter, squares = np.empty((rows, d)), np.empty((d, d)), np.empty(rows)
        g0 = joint_prior(self.mean, FIT_WEIGHT * self.precision, np.eye(d))
        unexplained(
            self.v, place.mass, place.labels, g0, self.regressors, residual, scatter, squares
        )
        return residual, scatter, squares

    def within(self, place: Place) -> Floats:
        """Return the regularised covariance (D, D) of the states' residuals."""
        scatter = self.unexplained(place)[1]
        samples = float((place.mass > 0.0).sum())
        freedom = max(samples - self.regressors * (place.labels.max() + 1), 0.5 * samples, 1.0)
        scatter = scatter / freedom + np.diag(self.blur)
        ridge = 1e-3 * np.trace(scatter) / self.dimensions + 1e-6
        return np.asarray(scatter + np.eye(self.dimensions) * ridge)

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
            place: its initial state.
            top: (3 + L,) γ, α+κ, ρ and β; updated.
            burn: sweeps whose labels are not kept.
            keep: further sweeps.
            seed: any integer.

        Returns:
            Its last state and prior, labels (keep, T'), and the trace of all sweeps
            (burn + keep, 5).
        """
        stop_if_cancelled()
        samples = np.empty((keep, len(self.v)), np.int64)
        trace = np.empty((burn + keep, len(TRACE)))
        emissions = np.empty((len(top) - 3, self.dimensions, self.v.shape[1]))
        chosen = np.array(
            [
                np.abs(EXTRA_DEGREES - prior.extra).argmin(),
                np.abs(self.worths - prior.worth).argmin(),
            ]
        )
        mass = place.mass.copy()
        run_chain(
            Data(self.v, np.ascontiguousarray(self.v.T), mass, self.ends),
            Grid(self.mean, self.precision, prior.within, EXTRA_DEGREES, self.worths, self.odds),
            Hyper(config.hyper, self.weight, self.dof, self.blur, config.moves),
            Start(place.labels, top, chosen),
            Out(samples, trace, emissions),
            seed,
        )
        held = Prior(prior.within, float(EXTRA_DEGREES[chosen[0]]), float(self.worths[chosen[1]]))
        return Place(samples[-1], mass), held, samples, trace

    def merge(self, prior: Prior, place: Place) -> Place:
        """Merge states greedily under `prior`; the labels become 0 .. K - 1 without gaps."""
        labels = compact(place.labels)
        g0 = joint_prior(
            self.mean, prior.worth * self.precision, prior.within * (prior.extra - 1.0)
        )
        joint = Joint(g0, self.dimensions + prior.extra, self.weight, self.blur)
        merge_states(self.v, place.mass, self.ends, joint, *MERGE_WEIGHT, labels)
        return Place(compact(labels), place.mass)


def _refuse_short(bounds: list[tuple[int, int]], order: int) -> None:
    """Raise InputError if a sequence is too short for an autoregressive emission."""
    lengths = [b - a for a, b in bounds]
    short = int(np.argmin(lengths))
    if order and lengths[short] < order + 2:
        raise InputError(
            f"sequence {short} has {lengths[short]} samples; an autoregressive emission of order "
            f"{order} needs {order + 2} or more: lower `order` or leave the sequence out"
        )


def new_top(states: int) -> Floats:
    """Return initial values of γ, α+κ, ρ and β (L,)."""
    return np.concatenate([INITIAL_TOP_RATIO, np.full(states, 1.0 / states)])


def filled_in(x: Floats, ends: Ints) -> Floats:
    """Return x (T, D) with NaN interpolated within each sequence (0 without any value)."""
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
