# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Where on their ways the vehicles of a template begin, from what is known of these places: weighted least squares."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np


class Equation(NamedTuple):
    """Σ factor · start of a vehicle = value [m], with a weight; the terms are (vehicle, factor)."""

    terms: tuple[tuple[int, float], ...]
    value: float
    weight: float


def solve_starts(vehicles: Sequence[int], equations: Iterable[Equation]) -> dict[int, float]:
    """Return the arc lengths [m] at which the vehicles of these equations begin; the shortest solution, if there are several."""
    rows = list(equations)
    factors = np.zeros((len(rows), len(vehicles)))
    for row, equation in enumerate(rows):
        for vehicle, factor in equation.terms:
            factors[row, vehicles.index(vehicle)] += factor
    values, weights = (np.array([equation[k] for equation in rows]) for k in (1, 2))
    solution, *_ = np.linalg.lstsq(weights[:, None] * factors, weights * values, rcond=None)
    return dict(zip(vehicles, solution.tolist(), strict=True))
