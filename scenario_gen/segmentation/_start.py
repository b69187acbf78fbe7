"""Where a chain starts, and the prior it runs under: k-means, a few sweeps, greedy merges; scales from the data."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.cluster.vq import kmeans2
from scipy.ndimage import uniform_filter1d

from scenario_gen.arrays import Floats, Ints
from scenario_gen.segmentation._chain import run_chain
from scenario_gen.segmentation._emission import joint_prior
from scenario_gen.segmentation._merge import merge_states

if TYPE_CHECKING:
    from scenario_gen.segmentation.series import SamplerConfig

WINDOWS = (9, 15, 5, 25)
EXTRA_DEGREES = (3, 10, 20, 50, 100)
STAGES = (20, 15)


@dataclass(frozen=True, eq=False)
class Problem:
    """The samples as the kernels want them.

    Attributes:
        v: (T', P + D) rows (z, y): regressors, then the sample itself.
        vt: its transpose.
        ends: index one past the last row of each sequence.
        regressors: P.
        mean: (D, P) prior mean M of the regression.
        precision: (P, P) prior K.
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

    def hyper(self, config: "SamplerConfig", nu: float) -> Floats:
        """(8 + D,) hyperparameters in the kernels' order."""
        return np.concatenate([config.hyper, [nu, self.weight], self.blur])

    @property
    def dimensions(self) -> int:
        """D."""
        return int(self.v.shape[1]) - self.regressors

    @property
    def y(self) -> Floats:
        """(T', D) samples."""
        return self.v[:, self.regressors :]

    @classmethod
    def build(cls, x: Floats, ends: Ints, config: "SamplerConfig", weight: float, blur: Floats) -> "Problem":
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
            v, np.ascontiguousarray(v.T), ends - order * np.arange(1, len(ends) + 1), p, mean, precision, order, weight, blur
        )

    def within(self, labels: Ints) -> Floats:
        """(D, D) covariance of what the states given by `labels` leave unexplained, a little regularised."""
        z, y = self.v[:, : self.regressors], self.y
        scatter = np.zeros((self.dimensions, self.dimensions))
        for k in range(int(labels.max()) + 1):
            chosen = labels == k
            gram = z[chosen].T @ z[chosen] + self.precision
            coefficients = np.linalg.solve(gram, z[chosen].T @ y[chosen] + self.precision @ self.mean.T)
            residual = y[chosen] - z[chosen] @ coefficients
            scatter += residual.T @ residual
        freedom = max(len(y) - self.regressors * (labels.max() + 1), len(y) // 2)
        scatter = scatter / freedom + np.diag(self.blur)
        result: Floats = scatter + np.eye(self.dimensions) * (1e-3 * np.trace(scatter) / self.dimensions + 1e-6)
        return result


@dataclass(frozen=True, eq=False)
class Start:
    """Labels (T',) to start from, the prior's S0 and ν0, and the sweeps spent to find them."""

    labels: Ints
    scale: Floats
    nu: float
    sweeps: int


def compact(labels: Ints) -> Ints:
    """Renumber labels to 0 .. K - 1 without gaps."""
    return np.unique(labels, return_inverse=True)[1].astype(np.int64).reshape(-1)


def find_start(problem: Problem, config: "SamplerConfig", index: int, rng: np.random.Generator) -> Start:
    """Find where chain number `index` starts.

    k-means on the samples averaged over a window (another one in each chain) gives L labels; a few Gibbs sweeps clean
    them; states are merged while the marginal likelihood grows; twice. S0 is (ν0 - D - 1) times the covariance within
    the states found, so that the prior's mean is what is seen; ν0, which says how alike the states' covariances are,
    is the value of a grid that gives the merged labels the highest marginal likelihood.
    """
    d = problem.dimensions
    window = min(WINDOWS[index % len(WINDOWS)], max(len(problem.v) // 8, 1))
    smooth = (
        uniform_filter1d(problem.y, window, axis=0, mode="nearest") if problem.regressors == 1 else _local_fit(problem, window)
    )
    states = min(config.states, max(2, len(smooth) // 4))
    labels = compact(kmeans2(smooth, states, minit="++", rng=rng)[1].astype(np.int64))
    nu = float(d + EXTRA_DEGREES[-2])
    scale = problem.within(labels) * (nu - d - 1.0)
    spent = 0
    for stage in STAGES:
        sweeps = min(stage, config.sweeps // 4)
        samples = np.empty((1, len(labels)), np.int64)
        emissions = np.empty((config.states, d, problem.v.shape[1]))
        hyper = problem.hyper(config, nu)
        g0 = joint_prior(problem.mean, problem.precision, scale)
        top = np.array([1.0, 50.0, 0.9])
        seed = int(rng.integers(2**62))
        run_chain(
            problem.v,
            problem.vt,
            problem.ends,
            g0,
            hyper,
            labels,
            top,
            problem.regressors,
            seed,
            sweeps - 1,
            samples,
            np.empty((sweeps, 5)),
            emissions,
        )
        spent += sweeps
        labels, scale, nu = _merge(problem, config, compact(samples[0]))
    return Start(labels, scale, nu, spent)


def _merge(problem: Problem, config: "SamplerConfig", labels: Ints) -> tuple[Ints, Floats, float]:
    """Merge states; returns the labels, S0 and ν0 of the highest marginal likelihood."""
    d = problem.dimensions
    within = problem.within(labels)
    best: tuple[float, Ints, Floats, float] | None = None
    for extra in EXTRA_DEGREES:
        nu = float(d + extra)
        scale = within * (nu - d - 1.0)
        merged = labels.copy()
        score = np.zeros(1)
        g0 = joint_prior(problem.mean, problem.precision, scale)
        merge_states(problem.v, problem.ends, g0, problem.hyper(config, nu), problem.regressors, 40.0, 0.1, score, merged)
        if best is None or score[0] > best[0]:
            best = (float(score[0]), compact(merged), scale, nu)
    assert best is not None
    return best[1], best[2], best[3]


def _local_fit(problem: Problem, window: int) -> Floats:
    """What distinguishes autoregressive states, per row: level, step and local spread of the samples, averaged over a window."""
    y, before = problem.y, problem.v[:, 1 : 1 + problem.dimensions]
    step = y - before
    parts = [y, step / (step.std(axis=0) + 1e-12), np.abs(step) / (np.abs(step).std(axis=0) + 1e-12)]
    return np.hstack([uniform_filter1d(part, window, axis=0, mode="nearest") for part in parts])
