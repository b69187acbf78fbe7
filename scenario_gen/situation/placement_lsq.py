# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Where vehicles start on their paths: weighted least squares."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np


class Equation(NamedTuple):
    """Σ factor · start of a vehicle = value [m], with a weight.

    Attributes:
        terms: (vehicle, factor).
        value: metres.
        weight: weight of the equation.
    """

    terms: tuple[tuple[int, float], ...]
    value: float
    weight: float


def solve_placement(vehicles: Sequence[int], equations: Iterable[Equation]) -> dict[int, float]:
    """Return the arc lengths [m] at which vehicles start; of several solutions the shortest."""
    rows = list(equations)
    factors = np.zeros((len(rows), len(vehicles)))
    for row, equation in enumerate(rows):
        for vehicle, factor in equation.terms:
            factors[row, vehicles.index(vehicle)] += factor
    values = np.array([equation.value for equation in rows])
    weights = np.array([equation.weight for equation in rows])
    solution, *_ = np.linalg.lstsq(weights[:, None] * factors, weights * values, rcond=None)
    return dict(zip(vehicles, solution.tolist(), strict=True))
