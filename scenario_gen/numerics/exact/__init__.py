# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Arithmetic that gives the same bits on every CPU: whatever enters a result is computed with it.

numpy's additions, multiplications, divisions, square roots, sums, sorts and comparisons are safe as they are; its
elementary functions, `@`, `numpy.linalg`, scipy's solvers and `math`'s functions are not, and are used from here.
`test/numerics/exact/test_used_everywhere.py` holds every file to that; docs/exactness.md says why.
"""

from scenario_gen.numerics.exact.algebra import (
    cholesky,
    compact,
    cubic_spline,
    dot,
    gram,
    lstsq,
    matmul,
    qr,
    root,
    solve_banded,
    solve_positive,
    solve_triangular,
)
from scenario_gen.numerics.exact.functions import (
    arctan,
    arctan2,
    cos,
    exp,
    hypot,
    lgamma,
    log,
    ndtr,
    ndtri,
    power,
    sin,
    tan,
    tanh,
)
from scenario_gen.numerics.exact.random import standard_normal
from scenario_gen.numerics.exact.sparse import Columns
from scenario_gen.numerics.exact.splines import BSpline, bspline_basis, CubicSpline, moving_max, moving_mean, moving_min

__all__ = [
    "BSpline", "Columns", "CubicSpline", "arctan", "arctan2", "bspline_basis", "cholesky", "compact", "cos", "cubic_spline",
    "dot", "exp", "gram", "hypot", "lgamma", "log", "lstsq", "matmul", "moving_max", "moving_mean", "moving_min", "ndtr",
    "ndtri", "power", "qr", "root", "sin", "solve_banded", "solve_positive", "solve_triangular", "standard_normal", "tan",
    "tanh",
]  # fmt: skip
