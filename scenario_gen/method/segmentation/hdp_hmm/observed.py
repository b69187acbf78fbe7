# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Heavy-tailed noise and hidden channels.

Student-t noise is Gaussian noise whose precision is scaled by a mass per sample, Gamma(ν/2, ν/2)
(Andrews & Mallows 1974). Labels are drawn with the masses integrated out, then masses given
labels. Hidden channels are integrated out of the likelihood, then drawn given the others, so that
the statistics have one form. A sample of which nothing was observed has mass 0.
"""

import math

import numpy as np

from scenario_gen.method.segmentation.hdp_hmm.emission import cholesky, square
from scenario_gen.method.segmentation.hdp_hmm.model import Data, Hyper, States
from scenario_gen.method.segmentation.hdp_hmm.random import log_gamma_draw, normal, State
from scenario_gen.numerics import Bools, Floats, Ints
from scenario_gen.numerics.kernels import kernel


@kernel(inline=True)
def hidden_precision(
    hidden: Bools, coef: Floats, rest: Floats, factor: Floats, shift: Floats
) -> int:
    """Fill Λ, the precision of the hidden channels, and C' r; return their number.

    Args:
        hidden: (D,).
        coef: (D, M) emission of the state.
        rest: (D,) r, the whitened residual of the observed channels.
        factor: (D, D) output, Λ (lower triangle) in its first rows and columns.
        shift: (D,) output, C' r.
    """
    d, m = coef.shape
    p = m - d
    a = 0
    for i in range(d):
        if not hidden[i]:
            continue
        b = 0
        for j in range(i + 1):
            if hidden[j]:
                factor[a, b] = product_of_columns(coef, p + i, p + j)
                b += 1
        shift[a] = 0.0
        for q in range(d):
            shift[a] += coef[q, p + i] * rest[q]
        a += 1
    return a


@kernel(inline=True)
def product_of_columns(coef: Floats, i: int, j: int) -> float:
    """Return the inner product of two columns of coef (D, M)."""
    total = 0.0
    for q in range(coef.shape[0]):
        total += coef[q, i] * coef[q, j]
    return total


@kernel(inline=True)
def without_hidden(
    v: Floats, hidden: Bools, coef: Floats, factor: Floats, shift: Floats
) -> tuple[float, float]:
    """Return the squared whitened residual of a sample's observed channels, and log|Λ|^(1/2).

    Λ is the precision of the hidden channels given the observed ones.

    Args:
        v: (M,) sample; the values of hidden channels do not matter.
        hidden: (D,).
        coef: (D, M) emission of the state.
        factor: (D, D) output, Cholesky factor R of Λ in its first rows and columns.
        shift: (D,) output, R⁻¹ C' r: the mean of the hidden channels is -R⁻ᵀ shift.
    """
    d, m = coef.shape
    p = m - d
    rest = np.zeros(d)
    for i in range(d):
        for j in range(p + i + 1):
            if j < p or not hidden[j - p]:
                rest[i] += coef[i, j] * v[j]
    total = 0.0
    for i in range(d):
        total += rest[i] * rest[i]
    a = hidden_precision(hidden, coef, rest, factor, shift)
    cholesky(factor[:a, :a])
    half = 0.0
    for i in range(a):
        for j in range(i):
            shift[i] -= factor[i, j] * shift[j]
        shift[i] /= factor[i, i]
        total -= shift[i] * shift[i]
        half += np.log(factor[i, i])
    return max(total, 0.0), half


@kernel(inline=True)
def log_radial(square: float, n: float, weight: float, dof: float) -> float:
    """Return log p(y) as far as it depends on the squared whitened residual.

    Args:
        square: squared whitened residual.
        n: observed channels times `weight`.
        weight: of a sample.
        dof: degrees of freedom of Student-t noise; 0: Gaussian.
    """
    if dof > 0.0:
        return -0.5 * (dof + n) * math.log(1.0 + weight * square / dof)
    return -0.5 * weight * square


@kernel(inline=True)
def observed_log_likelihood(
    v: Floats, hidden: Bools, coef: Floats, shape: Floats, weight: float, dof: float, out: Floats
) -> None:
    """Fill out (L,) with the log-likelihood of a sample's observed channels, up to a constant."""
    states, d = coef.shape[0], coef.shape[1]
    seen = d - hidden.sum()
    if seen == 0:
        for k in range(states):
            out[k] = 0.0
        return
    factor, shift = np.empty((d, d)), np.empty(d)
    for k in range(states):
        total, half = without_hidden(v, hidden, coef[k], factor, shift)
        total += shape[k, 1] * seen / d
        out[k] = weight * (shape[k, 0] - half) + log_radial(total, weight * seen, weight, dof)


@kernel(inline=True)
def draw_masses(state: State, data: Data, labels: Ints, emitted: States, hyper: Hyper) -> None:
    """Draw the samples' masses given labels (T,) and emissions; those of 0 do not change."""
    v, gaps, hidden, mass, (coef, shape) = data.v, data.gaps, data.hidden, data.mass, emitted
    weight, dof, d = hyper.weight, hyper.dof, len(hyper.blur)
    factor, shift = np.empty((d, d)), np.empty(d)
    gap = 0
    for t in range(len(mass)):
        while gap < len(gaps) and gaps[gap] < t:
            gap += 1
        k = labels[t]
        if not mass[t] > 0.0:
            continue
        if gap < len(gaps) and gaps[gap] == t:
            seen = d - hidden[gap].sum()
            total = without_hidden(v[t], hidden[gap], coef[k], factor, shift)[0]
        else:
            seen = d
            total = square(coef[k], v[t])
        total += shape[k, 1] * seen / d
        mass[t] = np.exp(log_gamma_draw(state, 0.5 * (dof + weight * seen))) / (
            0.5 * (dof + weight * total)
        )


@kernel(inline=True)
def draw_hidden(state: State, data: Data, labels: Ints, coef: Floats) -> None:
    """Draw the hidden channels given the observed ones, labels (T,), emissions coef (L, D, M)."""
    v, vt, mass, gaps, hidden = data.v, data.vt, data.mass, data.gaps, data.hidden
    d, m = coef.shape[1], coef.shape[2]
    p = m - d
    factor, shift = np.empty((d, d)), np.empty(d)
    for r in range(len(gaps)):
        t = gaps[r]
        if not mass[t] > 0.0:
            continue
        without_hidden(v[t], hidden[r], coef[labels[t]], factor, shift)
        a = hidden[r].sum()
        for i in range(a):
            shift[i] = normal(state) / math.sqrt(mass[t]) - shift[i]
        solve_transposed(factor, a, shift)
        a = 0
        for i in range(d):
            if hidden[r, i]:
                v[t, p + i] = shift[a]
                vt[p + i, t] = shift[a]
                a += 1


@kernel(inline=True)
def solve_transposed(factor: Floats, n: int, x: Floats) -> None:
    """Replace the first n numbers of x by R⁻ᵀ x, R the leading (n, n) part of factor."""
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            x[i] -= factor[j, i] * x[j]
        x[i] /= factor[i, i]


@kernel(inline=True)
def log_masses(mass: Floats, power: float, dof: float) -> float:
    """Return the log density of mass (T,) plus Σ ½ power log mass, up to a constant."""
    value = 0.0
    for t in range(len(mass)):
        if mass[t] > 0.0:
            value += (0.5 * (power + dof) - 1.0) * np.log(mass[t]) - 0.5 * dof * mass[t]
    return value
