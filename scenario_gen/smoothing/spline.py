# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Penalised splines: least squares in band matrices (Eilers & Marx 1996)."""

import numpy as np
from scipy import linalg

from scenario_gen.numerics import Floats, Ints

GRID_STEP_M = 0.5  # of points on a smooth path


def observe(
    band: Floats,
    right: Floats,
    start: Ints,
    entries: Floats,
    weight: Floats,
    target: Floats | None = None,
) -> None:
    """Add Σ weight · (entries · c - target)² to a lower band matrix and its right side.

    Args:
        band: the matrix (B, n).
        right: the right side (n,) or (n, D).
        start: (F,) first coefficient of each row.
        entries: (F, E) of each row.
        weight: (F,).
        target: (F,) or (F, D); None: zero.
    """
    for i in range(entries.shape[1]):
        if target is not None:
            np.add.at(right, start + i, (weight * entries[:, i] * target.T).T)
        for j in range(i + 1):
            products = weight * entries[:, i] * entries[:, j]
            np.add.at(band[i - j], start + j, products)


def differences(count: int, order: int) -> Floats:
    """Return differences (1st to 3rd) of `count` values as rows (count - order, order + 1)."""
    stencil = ((-1.0, 1.0), (1.0, -2.0, 1.0), (-1.0, 3.0, -3.0, 1.0))[order - 1]
    return np.tile(stencil, (count - order, 1))


def smoothing_spline(u: Floats, values: Floats, wavelength: float) -> tuple[Floats, Floats]:
    """Return a penalised spline f at equal steps of u: ∫ |f - p|² du + λ ∫ |f″|² du is least.

    Args:
        u: (T,) metres, non-decreasing from 0.
        values: (T, D).
        wavelength: metres; an oscillation of this length is halved.

    Returns:
        The grid (G,) and f on it (G, D).
    """
    count = max(int(np.ceil(u[-1] / GRID_STEP_M)), 6) + 1
    grid = np.linspace(0.0, u[-1], count)
    step = grid[1]
    cell = np.minimum((u / step).astype(np.int64), count - 2)
    share = u / step - cell
    band = np.zeros((3, count))
    right = np.zeros((count, values.shape[1]))
    weight = np.gradient(u) + 1e-3 * step
    observe(band, right, cell, np.column_stack((1.0 - share, share)), weight, values)
    penalty = np.full(count - 2, (wavelength / (2.0 * np.pi)) ** 4 / step**3)
    observe(band, right, np.arange(count - 2), differences(count, 2), penalty)
    return grid, linalg.solveh_banded(band, right, lower=True)
