# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A cheap prediction of the distance to failure: ridge regression on numbers and features."""

from dataclasses import dataclass

import numpy as np

from scenario_gen.numerics import Bools, Floats, Ints


@dataclass(frozen=True)
class RegressionSettings:
    """Constants of the regression.

    Attributes:
        max_drives: number of drives that it is fitted to; it bounds the cost.
        ridges: penalties, of which the one with the least prediction error is used.
        min_natural: natural drives that are necessary to estimate the error from them alone.
        near_share: share of the drives, the nearest to failure, that the error is estimated from.
        feature_factor: influence of a feature relative to that of a number.
        cut_quantile: larger responses are cut off, because far is far.
        failure_ratio: responses are also cut off at this share of that quantile below failure.
    """

    max_drives: int = 500
    ridges: tuple[float, ...] = (1.0, 10.0, 100.0)
    min_natural: int = 60
    near_share: float = 0.3
    feature_factor: float = 10.0
    cut_quantile: float = 0.95
    failure_ratio: float = 0.02


SETTINGS = RegressionSettings()


@dataclass(frozen=True, eq=False)
class Surrogate:
    """A linear prediction of one figure.

    Attributes:
        mean: (q,) of the columns.
        scale: (q,) of the columns.
        slope: (q,) for the standardised columns.
        level: mean of the figure.
        error: standard deviation of a prediction near failure, from leave-one-out residuals.
    """

    mean: Floats
    scale: Floats
    slope: Floats
    level: float
    error: float

    @classmethod
    def fit(cls, columns: Floats, figure: Floats, features: int, natural: Bools) -> "Surrogate":
        """Fit a regression.

        Args:
            columns: (n, q) numbers, then features, in any unit.
            figure: (n,) 0 or less at failure.
            features: number of the last columns that are features.
            natural: (n,) drives of natural scenarios; the error is estimated from these if there
                are enough.
        """
        quantile = np.quantile(np.maximum(figure, 0.0), SETTINGS.cut_quantile)
        high = max(float(quantile), 1e-9)
        y = np.clip(figure, -SETTINGS.failure_ratio * high, high)
        order = np.argsort(y, kind="stable")
        count = min(len(order), SETTINGS.max_drives)
        chosen = order[np.linspace(0, len(order) - 1, count).astype(np.int64)]
        x = columns[chosen]
        y = y[chosen]
        mean = x.mean(axis=0)
        scale = np.maximum(x.std(axis=0), 1e-9)
        scale[len(scale) - features :] /= SETTINGS.feature_factor
        x = (x - mean) / scale
        level = float(y.mean())
        error, dual = _fit_dual(x @ x.T, y - level, _nearest(natural[chosen]))
        return cls(mean, scale, x.T @ dual, level, max(error, 1e-9))

    def predict(self, columns: Floats) -> Floats:
        """Return the figure (S,), in its unit, for columns (S, q)."""
        return np.asarray(self.level + ((columns - self.mean) / self.scale) @ self.slope)

    def direction(self, size: int) -> Floats:
        """Return the unit vector (size,) along which the first columns change the figure most."""
        slope = np.asarray(self.slope[:size] / self.scale[:size])
        return slope / max(float(np.sqrt(slope @ slope)), 1e-300)


def _nearest(natural: Bools) -> Ints:
    """Return the rows that the error is estimated from; the rows (n,) ascend from failure."""
    rows = np.flatnonzero(natural)
    if len(rows) < SETTINGS.min_natural:
        rows = np.arange(len(natural))
    return rows[: max(int(SETTINGS.near_share * len(rows)), 1)]


def _fit_dual(kernel: Floats, residual: Floats, near: Ints) -> tuple[float, Floats]:
    """Return the error and the dual coefficients (n,) of the best ridge regression.

    The error is the RMS of the leave-one-out residuals of the rows `near`.
    """
    fits: list[tuple[float, Floats]] = []
    for ridge in SETTINGS.ridges:
        inverse = np.linalg.inv(kernel + ridge * np.eye(len(kernel)))
        dual = inverse @ residual
        left_out = (dual / np.diag(inverse))[near]
        fits.append((float(np.sqrt(np.square(left_out).mean())), dual))
    return min(fits, key=lambda fit: fit[0])
