# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A cheap prediction of how near to failure a drive will come: ridge regression on a scenario's numbers and features."""

from dataclasses import dataclass

import numpy as np

from scenario_gen.numerics import Bools, Floats

LEARNED = 500  # drives that it is fitted to, at most
RIDGES = (1.0, 10.0, 100.0)  # of which the one with the least error of prediction is taken
ENOUGH = 60  # natural drives that tell the error
NEAR_SHARE = 0.3  # share of the drives, those nearest to failure, by which the error is told
TELLING = 10.0  # a feature may matter so many times as much as a number
CUT_QUANTILE = 0.95  # responses are cut at this quantile: what is farther is all the same
BEYOND = 0.02  # and at so much of it below failure


@dataclass(frozen=True, eq=False)
class Surrogate:
    """Predicts one figure.

    Attributes:
        mean, scale: (q,) of the columns.
        slope: (q,) of the standardised columns.
        level: the figure's mean.
        error: standard deviation of a prediction near failure, by leaving one out.
    """

    mean: Floats
    scale: Floats
    slope: Floats
    level: float
    error: float

    @classmethod
    def fit(cls, columns: Floats, figure: Floats, features: int, natural: Bools) -> "Surrogate":
        """Fit to columns (n, q), in any unit, of which the last are features, and a figure (n,), 0 or less at failure.

        `natural` (n,) says which drives are of natural scenarios: by these, if there are enough,
        the error is told.
        """
        high = max(float(np.quantile(np.maximum(figure, 0.0), CUT_QUANTILE)), 1e-9)
        y = np.clip(figure, -BEYOND * high, high)
        order = np.argsort(y, kind="stable")
        chosen = order[np.linspace(0, len(order) - 1, min(len(order), LEARNED)).astype(np.int64)]
        x, y = columns[chosen], y[chosen]
        counted = np.flatnonzero(natural[chosen])
        counted = counted if len(counted) >= ENOUGH else np.arange(len(chosen))
        mean, scale = x.mean(axis=0), np.maximum(x.std(axis=0), 1e-9)
        scale[len(scale) - features :] /= TELLING
        x = (x - mean) / scale
        level = float(y.mean())
        kernel = x @ x.T
        near = counted[: max(int(NEAR_SHARE * len(counted)), 1)]  # the rows are in ascending order
        fits: list[tuple[float, Floats]] = []
        for ridge in RIDGES:
            inverse = np.linalg.inv(kernel + ridge * np.eye(len(x)))
            dual = inverse @ (y - level)
            left_out = (dual / np.diag(inverse))[near]  # error of the prediction from all others
            fits.append((float(np.sqrt(np.square(left_out).mean())), dual))
        error, dual = min(fits, key=lambda fit: fit[0])
        return cls(mean, scale, x.T @ dual, level, max(error, 1e-9))

    def predict(self, columns: Floats) -> Floats:
        """Return the figure (S,), in its own unit, for columns (S, q) in any unit."""
        return np.asarray(self.level + ((columns - self.mean) / self.scale) @ self.slope)

    def direction(self, size: int) -> Floats:
        """Return the direction (d,), a unit vector in any unit, along which the figure changes most with the first columns."""
        slope = np.asarray(self.slope[:size] / self.scale[:size])
        return slope / max(float(np.sqrt(slope @ slope)), 1e-300)
