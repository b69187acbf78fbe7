# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Gaussian-process regression against scikit-learn and against a dense float64 reference.

All with BLAS on one thread: a second thread that waits for work spins, and its CPU time would count as work.
"""

from collections.abc import Callable
from functools import partial
from time import process_time
import warnings

import numpy as np
import scipy.linalg

from benchmarks._size import sized
from benchmarks.row import higher, lower, Row
from scenario_gen.method.sampling.gp import (
    Features,
    Observations,
    Posterior,
    Regression,
    squared_exponential,
)
from scenario_gen.numerics.arrays import Floats

SIZES = ((200, 500, 40.0), (1000, 2000, 1000.0))  # points seen, points asked, target ratio
SAMPLES = 50
EXTENT, SIGMA, LENGTH, NOISE, DEGREE = 1000.0, 10.0, 100.0, 10.0, 3


def rows() -> list[Row]:
    """Return accuracy and speed at each size."""
    found = []
    for n, m, target in SIZES:
        x, y, noise, at = _data(n, m)
        mean, covariance = _dense(x, y, noise, at)
        ours = _ours(x, y, noise, at)
        z = np.random.default_rng(0).standard_normal((SAMPLES, ours.factor.shape[1]))
        mean_error = float(np.abs(ours.mean - mean).max())
        covariance_error = float(np.abs(ours.covariance - covariance).max())
        name = f"GP {n} seen, {m} asked"
        found += [
            lower(f"{name}: mean, largest error", mean_error, "", 1e-10),
            lower(f"{name}: covariance, largest error", covariance_error, "", 1e-10),
        ]
        seconds = _least_seconds(partial(_sample_ours, x, y, noise, at, z), sized(25, quick=1))
        try:
            peer = _least_seconds(partial(_sklearn, x, y, at), 3 if n < 500 else 1)
        except ImportError:
            continue
        times = f"scikit-learn {1e3 * peer:.1f} ms, ours {1e3 * seconds:.2f} ms"
        label = f"{name}: fit and {SAMPLES} samples, times faster"
        found.append(higher(label, peer / seconds, "×", target, times))
    return found


def _data(n: int, m: int) -> tuple[Floats, Floats, Floats, Floats]:
    rng = np.random.default_rng(1)
    x = np.linspace(0.0, EXTENT, n)
    noise = np.full(n, NOISE)
    noise[[0, -1]] = 0.0
    return (
        x,
        50.0 * np.sin(x / 100.0) + 0.1 * x + rng.normal(0.0, NOISE, n),
        noise,
        np.linspace(0.0, EXTENT, m),
    )


def _ours(x: Floats, y: Floats, noise: Floats, at: Floats) -> Posterior:
    features = Features(0.0, EXTENT, SIGMA, LENGTH, DEGREE)
    return Regression(features, Observations(x, y, noise)).predict(at)


def _sample_ours(x: Floats, y: Floats, noise: Floats, at: Floats, z: Floats) -> None:
    _ours(x, y, noise, at).sample(z)


def _sklearn(x: Floats, y: Floats, at: Floats) -> None:
    """The same kernel with fixed hyperparameters, zero mean (it offers no other), the same noise everywhere."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import ConstantKernel, RBF
    from threadpoolctl import threadpool_limits

    kernel = ConstantKernel(SIGMA**2, "fixed") * RBF(LENGTH, "fixed")
    with warnings.catch_warnings(), threadpool_limits(1):
        warnings.simplefilter(
            "ignore"
        )  # its sampler complains of a covariance that is not quite positive
        GaussianProcessRegressor(kernel, alpha=NOISE**2, optimizer=None).fit(
            x[:, None], y
        ).sample_y(at[:, None], SAMPLES)


def _dense(x: Floats, y: Floats, noise: Floats, at: Floats) -> tuple[Floats, Floats]:
    """Rasmussen & Williams eqs 2.41 and 2.42 by Cholesky factors."""
    cross, prior = (
        squared_exponential(x, at, SIGMA, LENGTH),
        squared_exponential(at, at, SIGMA, LENGTH),
    )
    factor = scipy.linalg.cho_factor(squared_exponential(x, x, SIGMA, LENGTH) + np.diag(noise**2))
    h, h_at = (np.vander(2.0 * v / EXTENT - 1.0, DEGREE + 1).T for v in (x, at))
    a = h @ scipy.linalg.cho_solve(factor, h.T)
    beta = np.linalg.solve(a, h @ scipy.linalg.cho_solve(factor, y))
    weights = scipy.linalg.cho_solve(factor, cross)
    r = h_at - h @ weights
    mean = h_at.T @ beta + weights.T @ (y - h.T @ beta)
    return mean, prior - cross.T @ weights + r.T @ np.linalg.solve(a, r)


def _least_seconds(call: Callable[[], None], repeats: int) -> float:
    """Return the least CPU time of some calls."""
    times = []
    for _ in range(repeats):
        started = process_time()
        call()
        times.append(process_time() - started)
    return min(times)
