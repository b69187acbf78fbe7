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

"""A small generator for the kernels: SplitMix64 (Steele et al. 2014) and the draws that Gibbs sampling needs.

The state is one uint64 in an array of length 1, seeded from a numpy SeedSequence; no draw depends on anything else, so
the same seed gives the same bytes on every thread and with every version of numpy.
"""

import math
from typing import Any

import numpy as np

from scenario_gen import exact
from scenario_gen.arrays import Floats
from scenario_gen.kernels import kernel

State = np.ndarray[Any, np.dtype[np.uint64]]

_STEP = np.uint64(0x9E3779B97F4A7C15)
_MIX1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX2 = np.uint64(0x94D049BB133111EB)
_S30, _S27, _S31, _S11 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(11)


@kernel(inline=True)
def uniform(state: State) -> float:
    """Uniform on (0, 1), never 0 and never 1."""
    state[0] += _STEP
    x = state[0]
    x = (x ^ (x >> _S30)) * _MIX1
    x = (x ^ (x >> _S27)) * _MIX2
    x = x ^ (x >> _S31)
    return (float(x >> _S11) + 0.5) * 1.1102230246251565e-16


@kernel(inline=True)
def normal(state: State) -> float:
    """Return a standard normal number (Box-Muller)."""
    return math.sqrt(-2.0 * exact.log(uniform(state))) * exact.cos(6.283185307179586 * uniform(state))


@kernel(inline=True)
def log_gamma_draw(state: State, shape: float) -> float:
    """Logarithm of a Gamma(shape, 1) draw (Marsaglia & Tsang 2000, with their squeeze); the logarithm survives shapes near 0."""
    boost = 0.0
    a = shape
    if a < 1.0:
        boost = exact.log(uniform(state)) / a
        a += 1.0
    d = a - 1.0 / 3.0
    c = 1.0 / math.sqrt(9.0 * d)
    while True:
        x = normal(state)
        v = 1.0 + c * x
        if v > 0.0:
            v = v * v * v
            u = uniform(state)
            if u < 1.0 - 0.0331 * x**4 or exact.log(u) < 0.5 * x * x + d - d * v + d * exact.log(v):
                return exact.log(d * v) + boost


@kernel(inline=True)
def log_beta_draw(state: State, a: float, b: float) -> tuple[float, float]:
    """Logarithms of a Beta(a, b) draw and of what it leaves of 1."""
    x = log_gamma_draw(state, a)
    y = log_gamma_draw(state, b)
    top = max(x, y)
    total = top + exact.log(exact.exp(x - top) + exact.exp(y - top))
    return x - total, y - total


@kernel(inline=True)
def pick(share: Floats, u: float, without: int) -> int:
    """Return the entry at which the running sum of `share` (n,), entry `without` left out (-1: none), reaches u."""
    last = 0
    for k in range(len(share)):
        if k != without:
            last = k
            u -= share[k]
            if u <= 0.0:
                break
    return last


@kernel(inline=True)
def dirichlet_draw(state: State, weights: Floats, out: Floats) -> None:
    """Dirichlet(weights) into `out`, both (L,); no entry is below 1e-100, so that backward messages never vanish."""
    n = len(weights)
    top = -np.inf
    for k in range(n):
        out[k] = log_gamma_draw(state, weights[k])
        top = max(top, out[k])
    total = 0.0
    for k in range(n):
        out[k] = max(exact.exp(out[k] - top), 1e-100)
        total += out[k]
    for k in range(n):
        out[k] /= total


@kernel(inline=True)
def tables_draw(state: State, customers: int, concentration: float) -> int:
    """Number of tables that `customers` open in a Chinese restaurant of the given concentration."""
    tables = 0
    for n in range(customers):
        if uniform(state) * (n + concentration) < concentration:
            tables += 1
    return tables
