# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Gaussian-process regression against scikit-learn and against a dense float64 reference.

All with BLAS on one thread: a second thread that waits for work spins, and its CPU time would count as work.
"""

from time import process_time
import warnings

import numpy as np
import scipy.linalg

from benchmarks._size import sized
from benchmarks.row import higher, lower, Row
from scenario_gen.method.sampling.gp import Features, Observations, Regression, squared_exponential
from scenario_gen.numerics.arrays import Floats

SIZES = ((200, 500, 40.0), (1000, 2000, 1000.0))  # points seen, points asked, target ratio
SAMPLES = 50
EXTENT, SIGMA, LENGTH, NOISE, DEGREE = 1000.0, 10.0, 100.0, 10.0, 3


def rows() -> list[Row]:
    """Accuracy and speed at each size."""
    found = []
    for n, m, target in SIZES:
        x, y, noise, at = _data(n, m)
        ours, mean, cov, seconds = _against_dense(x, y, noise, at)
        name = f"GP {n} seen, {m} asked"
        found.append(
            lower(f"{name}: mean, largest error", float(np.abs(ours.mean - mean).max()), "", 1e-10)
        )
        found.append(
            lower(
                f"{name}: covariance, largest error",
                float(np.abs(ours.covariance - cov).max()),
                "",
                1e-10,
            )
        )
        try:
            peer = min(_seconds(lambda: _sklearn(x, y, at)) for _ in range(3 if n < 500 else 1))  # noqa: B023
        except ImportError:
            found.append(
                lower(
                    f"{name}: fit and {SAMPLES} samples",
                    1e3 * seconds,
                    "ms",
                    None,
                    "scikit-learn not installed",
                )
            )
            continue
        plain = min(_seconds(lambda: _cholesky(x, y, noise, at)) for _ in range(3))  # noqa: B023
        found.append(
            higher(
                f"{name}: times faster than NumPy's Cholesky",
                plain / seconds,
                "×",
                None,
                f"{1e3 * plain:.1f} ms",
            )
        )
        label = f"{name}: fit and {SAMPLES} samples, times faster"
        found.append(
            higher(
                label,
                peer / seconds,
                "×",
                target,
                f"scikit-learn {1e3 * peer:.1f} ms, ours {1e3 * seconds:.2f} ms",
            )
        )
    return found


def _against_dense(x: Floats, y: Floats, noise: Floats, at: Floats):  # type: ignore[no-untyped-def]  # noqa: ANN202
    """Our prediction, the dense mean and covariance, and the least CPU seconds of a fit with its samples."""
    mean, cov = _dense(x, y, noise, at)
    ours = _ours(x, y, noise, at)
    z = np.random.default_rng(0).standard_normal((SAMPLES, ours.factor.shape[1]))
    return (
        ours,
        mean,
        cov,
        min(_seconds(lambda: _ours(x, y, noise, at).sample(z)) for _ in range(sized(25, quick=1))),
    )


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


def _ours(x: Floats, y: Floats, noise: Floats, at: Floats):  # type: ignore[no-untyped-def]  # noqa: ANN202
    return Regression(
        Features(0.0, EXTENT, SIGMA, LENGTH, DEGREE), Observations(x, y, noise)
    ).predict(at)


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


def _cholesky(x: Floats, y: Floats, noise: Floats, at: Floats) -> None:
    """The textbook's way (Rasmussen & Williams, algorithm 2.1) with samples, in NumPy and SciPy."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1):
        mean, cov = _dense(x, y, noise, at)
        factor = np.linalg.cholesky(cov + 1e-6 * np.eye(len(at)))
        mean[:, None] + factor @ np.random.default_rng(0).standard_normal((len(at), SAMPLES))


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


def _seconds(call) -> float:  # type: ignore[no-untyped-def]  # noqa: ANN001
    started = process_time()
    call()
    return process_time() - started
