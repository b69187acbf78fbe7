# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Emissions y = A z + noise, (A, Σ) ~ MNIW(M, K, ν0, S0): one form for Gaussian and AR states.

With the regressor z = 1 this is the Gaussian emission with a NIW prior (A is the mean, K its κ0);
with z = (1, past samples) it is the autoregressive one. A sample is v = (z, y), P + D numbers. The
sufficient statistic of a state is G = G0 + Σ v vᵀ with G0 = [[K, K Mᵀ], [M K, S0 + M K Mᵀ]]. Its
Cholesky factor [[Lz, 0], [Lyz, Ly]] contains the posterior: K' = Lz Lzᵀ, A' = Lyz Lz⁻¹,
S' = Ly Lyᵀ. Plain loops compile fast and vectorise over the last axis.
"""

import math

import numpy as np

from scenario_gen.method.segmentation.hdp_hmm.model import Joint, States
from scenario_gen.method.segmentation.hdp_hmm.random import gamma_draw, normal, State
from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.kernels import kernel

BLOCK_SAMPLES = 64
MIN_LOG_RATIO = -300.0  # of a likelihood to the best one; a smaller one is 0
LOG2_E_RATIO = 1.4426950408889634
LN2_HIGH_RATIO, LN2_LOW_RATIO = 6.93147180369123816490e-01, 1.90821492927058770002e-10
ROUNDING_RATIO = 6755399441055744.0  # 1.5 * 2**52: adding it rounds to an integer in its low bits
ONE_BITS = 1023 << 52  # the bits of 1.0
ROOT_BITS = 0x3FE6A09E667F3BCD  # the bits of √½: mantissas lie in √½ .. √2
LN2_RATIO, LOG_PI_RATIO = 6.93147180559945309417e-01, 1.14472988584940017414
MAX_PRODUCT_RATIO = 1e100  # above which a product of numbers is replaced by its logarithm


@kernel(inline=True)
def cholesky(matrix: Floats) -> bool:
    """Replace the lower triangle of `matrix` (n, n) by its Cholesky factor.

    Returns False if the matrix is not positive definite.
    """
    n = matrix.shape[0]
    for j in range(n):
        for k in range(j):
            c = matrix[j, k]
            for i in range(j, n):
                matrix[i, j] -= matrix[i, k] * c
        if not matrix[j, j] > 0.0:
            return False
        pivot = math.sqrt(matrix[j, j])
        for i in range(j, n):
            matrix[i, j] /= pivot
    return True


@kernel(inline=True)
def accumulate(v: Floats, labels: Ints, mass: Floats, outer: Floats, sums: Floats) -> None:
    """Fill the statistics of all states from samples v (T, M), labels (T,) and masses (T,).

    Args:
        v: rows (z, y).
        labels: 0 .. L - 1.
        mass: weight of a sample's square: 1, the precision scale of heavy-tailed noise, or 0 if
            the sample was not observed.
        outer: (L, M, M) output, Σ mass v vᵀ; lower triangles.
        sums: (L, 2) output, observed samples and Σ mass.
    """
    outer[:] = 0.0
    sums[:] = 0.0
    for t in range(v.shape[0]):
        if mass[t] > 0.0:
            add_sample(v[t], mass[t], outer[labels[t]])
            sums[labels[t], 0] += 1.0
            sums[labels[t], 1] += mass[t]


@kernel(inline=True)
def add_sample(v: Floats, mass: float, outer: Floats) -> None:
    """Add mass × v vᵀ to `outer` (M, M; lower triangle)."""
    for i in range(len(v)):
        c = mass * v[i]
        for j in range(i + 1):
            outer[i, j] += c * v[j]


@kernel(inline=True)
def posterior_factor(outer: Floats, total: float, joint: Joint, out: Floats) -> None:
    """Fill `out` (M, M) with the Cholesky factor of a state's G.

    `outer` is its Σ mass v vᵀ (M, M; lower triangle), `total` its Σ mass.
    """
    m, d = len(joint.g0), len(joint.blur)
    for i in range(m):
        for j in range(i + 1):
            out[i, j] = joint.g0[i, j] + joint.weight * outer[i, j]
        if i >= m - d:
            out[i, i] += joint.weight * total * joint.blur[i - (m - d)]
    cholesky(out)


@kernel(inline=True)
def log_marginal(factor: Floats, n: float, joint: Joint) -> float:
    """Part of log p(samples) that depends on them, from the Cholesky factor (M, M) of G.

    log p = c(factor, n) - c(prior factor, 0) with
    c = -nD/2 log π + log Γ_D(ν'/2) - ν'/2 log|S'| - D/2 log|K'|.
    """
    d, nu = len(joint.blur), joint.nu
    p = len(factor) - d
    value: float = log_gammas(0.5 * (nu + n), d) - 0.5 * n * d * LOG_PI_RATIO
    value -= d * log_diagonal(factor[:p, :p]) + (nu + n) * log_diagonal(factor[p:, p:])
    return value


@kernel(inline=True)
def log_diagonal(matrix: Floats) -> float:
    """Return Σ log of the diagonal of `matrix` (n, n), by logarithms of products."""
    value, product = 0.0, 1.0
    for i in range(len(matrix)):
        product *= matrix[i, i]
        if not 1.0 / MAX_PRODUCT_RATIO < product < MAX_PRODUCT_RATIO:
            value += np.log(product)
            product = 1.0
    return value + math.log(product)


@kernel(inline=True)
def log_gammas(a: float, d: int) -> float:
    """Return log Γ(a) + log Γ(a - 1/2) + ... + log Γ(a - (d - 1) / 2).

    Every second term follows from the smallest by Γ(x + 1) = x Γ(x).
    """
    value = 0.0
    for least in range(max(d - 2, 0), d):
        x = a - 0.5 * least
        base, ratio, product = math.lgamma(x), 1.0, 1.0
        value += base
        for step in range(least // 2):
            ratio *= x + step
            product *= ratio
            value += base
            if product > MAX_PRODUCT_RATIO:
                base, value = base + np.log(ratio), value + np.log(product)
                ratio, product = 1.0, 1.0
        value += np.log(product)
    return value


@kernel(inline=True)
def draw_emission(state: State, factor: Floats, n: float, joint: Joint, coef: Floats) -> float:
    """Draw (A, Σ) from the posterior with this factor (M, M) and n samples; return log|Σ|^(-1/2).

    `coef` (D, M) becomes the map of v to its whitened residual: W y - B z with WᵀW = Σ⁻¹ (W lower)
    and B = W A. Σ⁻¹ = Ly⁻ᵀ U Uᵀ Ly⁻¹ with U upper triangular (Bartlett), so W = Uᵀ Ly⁻¹ and
    A = (Lyz + W⁻¹ E) Lz⁻¹, E standard normal.
    """
    d, nu = len(joint.blur), joint.nu
    p = len(factor) - d
    for i in range(d):
        for j in range(i):
            coef[i, p + j] = normal(state)
        coef[i, p + i] = math.sqrt(2.0 * gamma_draw(state, 0.5 * (nu + n - (d - 1 - i))))
        for j in range(i + 1, d):
            coef[i, p + j] = 0.0
        for q in range(p):
            coef[i, q] = -normal(state)
        solve_row(factor, p, coef, i)
    return log_diagonal(coef[:, p:])


@kernel(inline=True, forced=True)
def block_residual(c: Floats, vt: Floats, start: int, stop: int, used: int, row: Floats) -> None:
    """Fill row (BLOCK,) with c (M,) times the first `used` numbers of each sample."""
    n = stop - start
    x = vt[0, start:stop]
    for t in range(n):
        row[t] = c[0] * x[t]
    j = 1
    while j + 3 < used:  # four at a time: a partial sum is loaded and stored a quarter as often
        c0, c1, c2, c3 = c[j], c[j + 1], c[j + 2], c[j + 3]
        x0, x1 = vt[j, start:stop], vt[j + 1, start:stop]
        x2, x3 = vt[j + 2, start:stop], vt[j + 3, start:stop]
        for t in range(n):
            row[t] += (c0 * x0[t] + c1 * x1[t]) + (c2 * x2[t] + c3 * x3[t])
        j += 4
    for rest in range(j, used):
        c0 = c[rest]
        x = vt[rest, start:stop]
        for t in range(n):
            row[t] += c0 * x[t]


@kernel(inline=True)
def block_log_likelihood(
    vt: Floats,
    start: int,
    stop: int,
    emitted: States,
    weight: float,
    dof: float,
    out: Floats,
    row: Floats,
) -> None:
    """Fill out (L, BLOCK) with log p(y_t | z_t, state) up to a constant.

    Args:
        vt: (M, T) samples.
        start: first sample.
        stop: one past the last, at most BLOCK further.
        emitted: emissions of the states.
        weight: of a sample.
        dof: degrees of freedom of Student-t noise; 0: Gaussian.
        out: output.
        row: (BLOCK,) work space.
    """
    coef, shape = emitted
    states, d, m = coef.shape
    n = stop - start
    for k in range(states):
        total = out[k]
        for t in range(n):
            total[t] = shape[k, 1]
        for i in range(d):
            block_residual(coef[k, i], vt, start, stop, m - d + i + 1, row)
            for t in range(n):
                total[t] += row[t] * row[t]
        if dof > 0.0:
            student(total, n, weight * shape[k, 0], weight / dof, 0.5 * (dof + weight * d), row)
        else:
            for t in range(n):
                total[t] = weight * (shape[k, 0] - 0.5 * total[t])


@kernel(inline=True)
def student(
    total: Floats, n: int, logdet: float, share: float, power: float, work: Floats
) -> None:
    """Replace the first n squares of `total` (B,) by logdet - power log(1 + share × square).

    The logarithm is the series 2 artanh((m - 1) / (m + 1)) of the mantissa m, which vectorises;
    its error is below 1e-13. `work` (B,) is work space.
    """
    bits = work.view(np.int64)
    for t in range(n):
        work[t] = 1.0 + share * total[t]
    for t in range(n):
        total[t] = float((bits[t] - ROOT_BITS) >> 52)
        bits[t] -= ((bits[t] - ROOT_BITS) >> 52) << 52
    for t in range(n):
        f = (work[t] - 1.0) / (work[t] + 1.0)
        s = f * f
        p = 2.0 / 17.0
        p = p * s + 2.0 / 15.0
        p = p * s + 2.0 / 13.0
        p = p * s + 2.0 / 11.0
        p = p * s + 2.0 / 9.0
        p = p * s + 2.0 / 7.0
        p = p * s + 2.0 / 5.0
        p = p * s + 2.0 / 3.0
        p = p * s + 2.0
        total[t] = logdet - power * (total[t] * LN2_RATIO + p * f)


@kernel(inline=True)
def square(coef: Floats, v: Floats) -> float:
    """Squared whitened residual of one sample v (M,) under one state's coef (D, M)."""
    d, m = coef.shape
    total = 0.0
    for i in range(d):
        rest = 0.0
        for j in range(m - d + i + 1):
            rest += coef[i, j] * v[j]
        total += rest * rest
    return total


@kernel(inline=True)
def mean_emission(factor: Floats, n: float, joint: Joint, coef: Floats, shape: Floats) -> None:
    """Fill coef (D, M) and shape (2,), see `States`, with the posterior means."""
    d, nu = len(joint.blur), joint.nu
    p = len(factor) - d
    root = math.sqrt(nu + n)
    for i in range(d):
        for j in range(d):
            coef[i, p + j] = root if i == j else 0.0
        for q in range(p):
            coef[i, q] = 0.0
        solve_row(factor, p, coef, i)
    shape[0] = log_diagonal(coef[:, p:])
    shape[1] = blurred(coef, joint.blur)


@kernel(inline=True)
def solve_row(factor: Floats, p: int, coef: Floats, i: int) -> None:
    """Turn row i of coef (D, M), (e, u), into (e - u Ly⁻¹ Lyz) Lz⁻¹ and u Ly⁻¹.

    `factor` (M, M) is that of a state's G.
    """
    for j in range(i, -1, -1):
        c = coef[i, p + j] / factor[p + j, p + j]
        coef[i, p + j] = c
        for q in range(j):
            coef[i, p + q] -= c * factor[p + j, p + q]
    for j in range(i + 1):
        c = coef[i, p + j]
        for q in range(p):
            coef[i, q] -= c * factor[p + j, q]
    for j in range(p - 1, -1, -1):
        c = coef[i, j] / factor[j, j]
        coef[i, j] = c
        for q in range(j):
            coef[i, q] -= c * factor[j, q]


@kernel(inline=True)
def blurred(coef: Floats, blur: Floats) -> float:
    """tr(Σ⁻¹ blur) of a state's coef (D, M)."""
    d, m = coef.shape
    total = 0.0
    for i in range(d):
        for j in range(i + 1):
            total += coef[i, m - d + j] ** 2 * blur[j]
    return total


@kernel(inline=True, forced=True)
def exponentials(x: Floats, best: Floats, n: int, power: Floats, value: Floats) -> None:
    """Fill value (BLOCK,) and power (BLOCK,), whose product is exp(x - best), for n numbers.

    The exponential is a polynomial (Cody & Waite), which vectorises, unlike a call per number; its
    error is below 3e-13, like that of a log-likelihood of a thousand.
    """
    bits = power.view(np.int64)
    for t in range(n):
        y = x[t] - best[t]
        y = y if y > MIN_LOG_RATIO else MIN_LOG_RATIO
        shifted = y * LOG2_E_RATIO + ROUNDING_RATIO
        power[t] = shifted
        turns = shifted - ROUNDING_RATIO
        r = (y - turns * LN2_HIGH_RATIO) - turns * LN2_LOW_RATIO
        p = 1.0 / 3628800.0
        p = p * r + 1.0 / 362880.0
        p = p * r + 1.0 / 40320.0
        p = p * r + 1.0 / 5040.0
        p = p * r + 1.0 / 720.0
        p = p * r + 1.0 / 120.0
        p = p * r + 1.0 / 24.0
        p = p * r + 1.0 / 6.0
        p = p * r + 0.5
        p = p * r + 1.0
        value[t] = (p * r + 1.0) if y > MIN_LOG_RATIO else 0.0
    for t in range(n):
        bits[t] = (bits[t] << 52) + ONE_BITS


@kernel(inline=True)
def block_likelihood(logs: Floats, n: int, best: Floats, work: Floats, out: Floats) -> None:
    """Fill out (n, L) with exp(logs - best of all states), logs (L, BLOCK); below e^-300 it is 0.

    best (BLOCK,) and work (2, BLOCK) are work space.
    """
    states = logs.shape[0]
    for t in range(n):
        best[t] = logs[0, t]
    for k in range(1, states):
        x = logs[k]
        for t in range(n):
            best[t] = x[t] if x[t] > best[t] else best[t]
    power, value = work[0], work[1]
    for k in range(states):
        exponentials(logs[k], best, n, power, value)
        for t in range(n):
            out[t, k] = value[t] * power[t]


def joint_prior(mean: Floats, precision: Floats, scale: Floats) -> Floats:
    """Return G0 (P + D, P + D) of an MNIW prior with mean M (D, P), K (P, P) and S0 (D, D)."""
    return np.block(
        [
            [precision, precision @ mean.T],
            [mean @ precision, scale + mean @ precision @ mean.T],
        ]
    )
