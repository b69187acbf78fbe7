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

"""What states leave unexplained: the residuals of each state's regression, and their scatter."""

import numpy as np

from scenario_gen.arrays import Floats, Ints
from scenario_gen.kernels import F2, I, I1, kernel, OUT2
from scenario_gen.segmentation._emission import accumulate, cholesky


@kernel(F2, I1, F2, I, OUT2, OUT2)
def unexplained(v: Floats, labels: Ints, g0: Floats, regressors: int, residual: Floats, scatter: Floats) -> None:
    """Fit y = A z in each state, ridged by the prior; no BLAS, whose idle threads cost more than they save here.

    Args:
        v: (T, P + D) rows (z, y).
        labels: (T,).
        g0: (P + D, P + D) joint prior of the emissions, see `_emission`.
        regressors: P.
        residual: (T, D) output, y - A z.
        scatter: (D, D) output, Σ residual residualᵀ.
    """
    m, p = v.shape[1], regressors
    states = 0
    for t in range(len(labels)):
        states = max(states, labels[t] + 1)
    g = np.empty((states, m, m))
    counts = np.empty(states, np.int64)
    accumulate(v, labels, g0, 1.0, np.zeros(m - p), g, counts)
    maps = np.empty((states, m - p, p))
    for k in range(states):
        cholesky(g[k])
        for i in range(m - p):
            for j in range(p - 1, -1, -1):
                c = g[k, p + i, j]
                for q in range(j + 1, p):
                    c -= maps[k, i, q] * g[k, q, j]
                maps[k, i, j] = c / g[k, j, j]
    scatter[:] = 0.0
    for t in range(len(labels)):
        coefficients, row = maps[labels[t]], residual[t]
        for i in range(m - p):
            rest = v[t, p + i]
            for j in range(p):
                rest -= coefficients[i, j] * v[t, j]
            row[i] = rest
            for j in range(i + 1):
                scatter[i, j] += rest * row[j]
    for i in range(m - p):
        for j in range(i):
            scatter[j, i] = scatter[i, j]
