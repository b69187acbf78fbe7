# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Arithmetic that gives the same bits on every CPU: whatever enters a result is computed with it.

numpy's additions, multiplications, divisions, square roots, sums, sorts and comparisons are safe as they are; its
elementary functions, `@`, `numpy.linalg`, scipy's solvers and `math`'s functions are not, and are used from here.
`test/exact/test_used_everywhere.py` holds every file to that; docs/reliability.md says what is promised.
"""

from scenario_gen.exact.algebra import (
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
from scenario_gen.exact.functions import arctan, arctan2, cos, exp, hypot, lgamma, log, ndtr, ndtri, power, sin, tan, tanh
from scenario_gen.exact.random import standard_normal
from scenario_gen.exact.splines import BSpline, bspline_basis, CubicSpline, moving_max, moving_mean, moving_min

__all__ = [
    "BSpline", "CubicSpline", "arctan", "arctan2", "bspline_basis", "cholesky", "compact", "cos", "cubic_spline", "dot", "exp",
    "gram", "hypot", "lgamma", "log", "lstsq", "matmul", "moving_max", "moving_mean", "moving_min", "ndtr", "ndtri", "power",
    "qr", "root", "sin", "solve_banded", "solve_positive", "solve_triangular", "standard_normal", "tan", "tanh",
]  # fmt: skip
