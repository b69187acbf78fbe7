# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A random generator for kernels: SplitMix64 (Steele et al. 2014), and draws for Gibbs sampling.

The state is one uint64 in an array of length 1, seeded from a numpy SeedSequence. No draw depends
on anything else, so a seed gives the same bytes on every thread and with every version of numpy.
"""

from decimal import Decimal, localcontext
import math
from typing import Any

import numpy as np

from scenario_gen.numerics import Floats
from scenario_gen.numerics.kernels import kernel

State = np.ndarray[Any, np.dtype[np.uint64]]

_STEP = np.uint64(0x9E3779B97F4A7C15)
_MIX1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX2 = np.uint64(0x94D049BB133111EB)
_S30, _S27, _S31, _S11 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(11)
_LAYER, _SIGN = np.uint64(255), np.uint64(256)


def _layers() -> tuple[Floats, Floats]:
    """Return edges and heights (257,) of 256 layers of equal area under exp(-x²/2), widest first.

    Decimal numbers, whose functions are rounded correctly, give every machine the same table.

    Source: Doornik 2005, ZIGNOR.
    """
    with localcontext(prec=30):
        last = Decimal("3.6541528853610087963519472518")
        area = Decimal("0.0049286732339746549315909")
        density = (-last * last / 2).exp()
        edges, heights = [area / density, last], [Decimal(0), density]
        for _ in range(LAYERS_COUNT - 2):
            heights.append(heights[-1] + area / edges[-1])
            edges.append((-2 * heights[-1].ln()).sqrt())
        return np.array([*map(float, edges), 0.0]), np.array([*map(float, heights), 1.0])


LAYERS_COUNT = 256
EDGES, HEIGHTS = _layers()
TAIL = float(EDGES[1])


@kernel(inline=True)
def next_bits(state: State) -> np.uint64:
    """64 random bits."""
    state[0] += _STEP
    x = state[0]
    x = (x ^ (x >> _S30)) * _MIX1
    x = (x ^ (x >> _S27)) * _MIX2
    mixed: np.uint64 = x ^ (x >> _S31)
    return mixed


@kernel(inline=True)
def uniform(state: State) -> float:
    """Uniform on (0, 1), never 0 and never 1."""
    return (float(next_bits(state) >> _S11) + 0.5) * 1.1102230246251565e-16


@kernel(inline=True)
def normal(state: State) -> float:
    """Return a standard normal number by the ziggurat method (Marsaglia & Tsang 2000)."""
    while True:
        bits = next_bits(state)
        layer = np.int64(bits & _LAYER)
        x: float = (float(bits >> _S11) + 0.5) * 1.1102230246251565e-16 * EDGES[layer]
        if x >= EDGES[layer + 1]:
            if layer == 0:
                x = beyond(state)
            elif HEIGHTS[layer] + uniform(state) * (HEIGHTS[layer + 1] - HEIGHTS[layer]) >= np.exp(
                -0.5 * x * x
            ):
                continue
        return x if bits & _SIGN else -x


@kernel(inline=True)
def beyond(state: State) -> float:
    """Return a standard normal number above `TAIL` (Marsaglia 1964)."""
    while True:
        x = -math.log(uniform(state)) / TAIL
        if -2.0 * math.log(uniform(state)) > x * x:
            return TAIL + x


@kernel(inline=True)
def gamma_draw(state: State, shape: float) -> float:
    """Gamma(shape, 1) for a shape of 1 or more (Marsaglia & Tsang 2000, with their squeeze)."""
    d = shape - 1.0 / 3.0
    c = 1.0 / math.sqrt(9.0 * d)
    while True:
        x = normal(state)
        v = 1.0 + c * x
        if v > 0.0:
            v = v * v * v
            u = uniform(state)
            if u < 1.0 - 0.0331 * x**4 or np.log(u) < 0.5 * x * x + d - d * v + d * np.log(v):
                return d * v


@kernel(inline=True)
def log_gamma_draw(state: State, shape: float) -> float:
    """Logarithm of a Gamma(shape, 1) draw, which survives shapes near 0."""
    if shape < 1.0:
        return math.log(gamma_draw(state, shape + 1.0)) + math.log(uniform(state)) / shape
    return math.log(gamma_draw(state, shape))


@kernel(inline=True)
def log_beta_draw(state: State, a: float, b: float) -> tuple[float, float]:
    """Logarithms of a Beta(a, b) draw and of what it leaves of 1."""
    x = log_gamma_draw(state, a)
    y = log_gamma_draw(state, b)
    top = max(x, y)
    total = top + np.log(np.exp(x - top) + np.exp(y - top))
    return x - total, y - total


@kernel(inline=True)
def pick(share: Floats, u: float, without: int) -> int:
    """Return the entry at which the running sum of `share` (n,) reaches u.

    Entry `without` is left out; -1: none.
    """
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
    """Draw `out` from Dirichlet(weights), both (L,); `weights` are overwritten.

    No entry is below 1e-100, so that backward messages never vanish. A Gamma(a, 1) draw with a < 1
    is one of a + 1 times u^(1/a). Its logarithm is stored until the largest one is known, since
    all may underflow.
    """
    n = len(weights)
    top = -np.inf
    for k in range(n):
        a = weights[k]
        out[k] = 0.0
        if a < 1.0:
            out[k] = np.log(uniform(state)) / a
            a += 1.0
        weights[k] = gamma_draw(state, a)
        top = max(top, out[k])
    total = 0.0
    for k in range(n):
        out[k] = weights[k] if out[k] == top else weights[k] * np.exp(max(out[k] - top, -700.0))
        total += out[k]
    for k in range(n):
        out[k] = max(out[k] / total, 1e-100)


@kernel(inline=True)
def tables_draw(state: State, customers: int, concentration: float) -> int:
    """Draw the number of tables that `customers` open in a Chinese restaurant."""
    tables = 0
    for n in range(customers):
        if uniform(state) * (n + concentration) < concentration:
            tables += 1
    return tables
