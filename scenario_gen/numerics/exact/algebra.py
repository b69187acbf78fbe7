# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Linear algebra that gives the same bits on every CPU, with any number of threads.

BLAS and LAPACK choose kernels, block sizes and threads by CPU, so their last digits differ. Here every sum runs in one
stated order, in compiled loops without fused operations, and signs are fixed. The matrices of this project are small;
for large ones a BLAS is many times faster.

Source of the factorisations: Golub & Van Loan, Matrix Computations, 4th ed., algorithms 4.2.1, 4.3.5, 5.2.1, 5.4.1.
"""

import math
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from scenario_gen.numerics.arrays import Floats, Ints
from scenario_gen.numerics.exact.splines import CubicSpline
from scenario_gen.numerics.kernels import B, F1, F2, F3, kernel, OUT1, OUT2, OUT3, OUTI1

Numbers = npt.NDArray[Any]  # floats or whole numbers; they become floats

EPSILON = 2.220446049250313e-16
_MANY_ROWS = 16  # for which looking at all of b first is cheap


@kernel(inline=True)
def _dot(a: Floats, b: Floats) -> float:
    """Return the inner product of two rows (n,): four running sums, then ((0 + 1) + (2 + 3)), then what is left over."""
    n = len(a) // 4 * 4
    s0 = s1 = s2 = s3 = 0.0
    for k in range(0, n, 4):
        s0 += a[k] * b[k]
        s1 += a[k + 1] * b[k + 1]
        s2 += a[k + 2] * b[k + 2]
        s3 += a[k + 3] * b[k + 3]
    total = (s0 + s1) + (s2 + s3)
    for k in range(n, len(a)):
        total += a[k] * b[k]
    return total


@kernel(F1, F1)
def dot(a: Floats, b: Floats) -> float:
    """Return the inner product of two rows (n,)."""
    return _dot(a, b)


@kernel(F3, F3, OUT3, B)
def _matmul(a: Floats, b: Floats, out: Floats, symmetric: bool) -> None:
    """The product a b; of a symmetric one only the upper half.

    Of other large ones, zeros of a are skipped where they meet no infinity: a row of a banded matrix costs as much as its band.
    """
    inner = a.shape[2]
    whole = inner // 4 * 4
    for s in range(a.shape[0]):
        skip = not symmetric and a.shape[1] >= _MANY_ROWS and np.isfinite(b[s]).all()
        for i in range(a.shape[1]):
            row, start = out[s, i], i if symmetric else 0
            for k in range(0, whole, 4):  # four terms a pass, added in the order of k
                a0, a1, a2, a3 = a[s, i, k], a[s, i, k + 1], a[s, i, k + 2], a[s, i, k + 3]
                if skip and a0 == 0.0 and a1 == 0.0 and a2 == 0.0 and a3 == 0.0:
                    continue  # 0 b is ±0, which changes no sum that began with +0
                b0, b1, b2, b3 = b[s, k], b[s, k + 1], b[s, k + 2], b[s, k + 3]
                for j in range(start, b.shape[2]):
                    row[j] = (((row[j] + a0 * b0[j]) + a1 * b1[j]) + a2 * b2[j]) + a3 * b3[j]
            for k in range(whole, inner):
                for j in range(start, b.shape[2]):
                    row[j] += a[s, i, k] * b[s, k, j]


@kernel(F3, F3, OUT3)
def _matmul_by_rows(a: Floats, b: Floats, out: Floats) -> None:
    """The product a bᵀ, for few columns: each entry is a `dot`."""
    for s in range(a.shape[0]):
        for i in range(a.shape[1]):
            for j in range(b.shape[1]):
                out[s, i, j] = _dot(a[s, i], b[s, j])


def matmul(a: Numbers, b: Numbers) -> Floats:
    """Return the matrix product, with the shapes of `numpy.matmul`: stacks (..., n, k) and (..., k, m), vectors at either side.

    A row of the result does not depend on how many rows there are: one sample alone has the bits it has among many.

    Raises:
        ValueError: the inner sizes differ.
    """
    left, right = a.ndim == 1, b.ndim == 1
    p = a[None, :] if left else a
    q = b[:, None] if right else b
    stack: tuple[int, ...] = ()
    if p.ndim > 2 or q.ndim > 2:
        stack = np.broadcast_shapes(p.shape[:-2], q.shape[:-2])
        p, q = np.broadcast_to(p, stack + p.shape[-2:]), np.broadcast_to(q, stack + q.shape[-2:])
    count = math.prod(stack)
    p = np.ascontiguousarray(p, dtype=np.float64).reshape(count, *p.shape[-2:])
    q = q.reshape(count, *q.shape[-2:])
    if p.shape[2] != q.shape[1]:
        raise ValueError(f"matrices of shapes {a.shape} and {b.shape} have no product")
    out = np.zeros((len(p), p.shape[1], q.shape[2]))
    if q.shape[2] < 4:
        _matmul_by_rows(p, np.ascontiguousarray(q.transpose(0, 2, 1), dtype=np.float64), out)
    else:
        _matmul(p, np.ascontiguousarray(q, dtype=np.float64), out, False)
    shape = stack + (() if left else (p.shape[1],)) + (() if right else (q.shape[2],))
    return out.reshape(shape)


def gram(rows: Floats) -> Floats:
    """Return rows rowsᵀ (n, n) of rows (n, k), as `matmul` does, in half the time."""
    if len(rows) < 4:
        return matmul(rows, rows.T)
    out = np.zeros((1, len(rows), len(rows)))
    _matmul(np.ascontiguousarray(rows)[None], np.ascontiguousarray(rows.T)[None], out, True)
    return np.asarray(np.triu(out[0]) + np.triu(out[0], 1).T)


_TINY = 1e-290  # square of the length of a column that is nothing but rounding of rounding; 2 over less is infinite


@kernel(OUT2, OUT2, OUT1, OUTI1, B)
def _householder(columns: Floats, reflectors: Floats, scale: Floats, order: Ints, pivot: bool) -> None:
    """Factorise a matrix given by its columns (n, m), in place; with `pivot` the longest column that is left comes next."""
    n, m = columns.shape
    for k in range(min(n, m)):
        if pivot:
            best, longest = k, -1.0
            for j in range(k, n):
                size = _dot(columns[j, k:], columns[j, k:])
                if size > longest * (1.0 + 1e-12):  # of two that are as long as each other to rounding, the first
                    best, longest = j, size
            if best != k:
                for i in range(m):
                    columns[k, i], columns[best, i] = columns[best, i], columns[k, i]
                order[k], order[best] = order[best], order[k]
        v = reflectors[k]
        v[k:] = columns[k, k:]
        length = np.sqrt(_dot(v[k:], v[k:]))
        v[k] += length if v[k] >= 0.0 else -length
        square = _dot(v[k:], v[k:])
        scale[k] = 2.0 / square if square > _TINY else 0.0
        for j in range(k, n):
            factor = scale[k] * _dot(v[k:], columns[j, k:])
            for i in range(k, m):
                columns[j, i] -= factor * v[i]


@kernel(OUT2, OUT1, OUT2)
def _reflect(reflectors: Floats, scale: Floats, columns: Floats) -> None:
    """Multiply the first columns (c, m) of the unit matrix by the product of the reflectors, from the left."""
    for k in range(len(scale) - 1, -1, -1):
        v = reflectors[k]
        for j in range(k, len(columns)):
            factor = scale[k] * _dot(v[k:], columns[j, k:])
            for i in range(k, columns.shape[1]):
                columns[j, i] -= factor * v[i]


def qr(a: Numbers, *, full: bool = False, pivot: bool = False) -> tuple[Floats, Floats, Ints]:
    """Factorise a[:, order] = q r by Householder reflections, the diagonal of r not negative.

    Args:
        a: (m, n).
        full: whether q is (m, m) instead of (m, min(m, n)); its further columns span what a does not.
        pivot: whether the columns are ordered so that the diagonal of r falls.

    Returns:
        q, r (columns of q, n) and the order (n,) of a's columns.
    """
    m, n = a.shape
    count = min(m, n)
    columns = np.array(a.T, dtype=np.float64, order="C")
    reflectors, scale, order = np.zeros((count, m)), np.zeros(count), np.arange(n, dtype=np.int64)
    _householder(columns, reflectors, scale, order, pivot)
    basis = np.eye(m if full else count, m)
    _reflect(reflectors, scale, basis)
    r = np.zeros((len(basis), n))
    r[:count] = np.triu(columns.T[:count])
    flip = np.where(np.diag(r)[:count] < 0.0, -1.0, 1.0)
    basis[:count] *= flip[:, None]
    r[:count] *= flip[:, None]
    return np.ascontiguousarray(basis.T), r, order


@kernel(F2, OUT2, B)
def _substitute(r: Floats, x: Floats, transposed: bool) -> None:
    n, m = r.shape[0], x.shape[1]
    for step in range(n):
        i = step if transposed else n - 1 - step
        for other in range(step):
            k = other if transposed else n - 1 - other
            factor = r[k, i] if transposed else r[i, k]
            for j in range(m):
                x[i, j] -= factor * x[k, j]
        for j in range(m):
            x[i, j] /= r[i, i]


def solve_triangular(r: Numbers, b: Numbers, *, transposed: bool = False) -> Floats:
    """Solve r x = b, or rᵀ x = b, for an upper triangular r (n, n) and b (n,) or (n, m)."""
    x = np.array(b if b.ndim == 2 else b[:, None], dtype=np.float64, order="C")
    _substitute(np.ascontiguousarray(r, dtype=np.float64), x, transposed)
    return x.reshape(b.shape)


def lstsq(a: Numbers, b: Numbers) -> Floats:
    """Return the x (n,) or (n, k) for which |a x - b| is least, a (m, n) and b (m,) or (m, k).

    Of columns that depend on others to rounding, all but one get the coefficient 0.
    """
    q, r, order = qr(a, pivot=True)
    diagonal = np.diag(r)
    rank = int((diagonal > EPSILON * max(a.shape) * diagonal.max(initial=0.0)).sum())
    solution = np.zeros((a.shape[1], *b.shape[1:]))
    if rank:
        solution[order[:rank]] = solve_triangular(r[:rank, :rank], matmul(np.ascontiguousarray(q.T)[:rank], b))
    return solution


@kernel(OUT2)
def _cholesky(a: Floats) -> int:
    """Replace the lower triangle by its factor, and the upper by zeros; return the row where that ends, or the number of rows."""
    n: int = a.shape[0]
    for i in range(n):
        for j in range(i + 1):
            rest = a[i, j] - _dot(a[i, :j], a[j, :j])
            if i != j:
                a[i, j] = rest / a[j, j]
            elif rest > 0.0:
                a[i, i] = np.sqrt(rest)
            else:
                return i
        a[i, i + 1 :] = 0.0
    return n


def cholesky(a: Numbers) -> Floats:
    """Return the lower triangular l (n, n) with l lᵀ = a; only the lower triangle of a is read.

    Raises:
        numpy.linalg.LinAlgError: a is not positive definite.
    """
    factor = np.array(a, dtype=np.float64, order="C")
    row = _cholesky(factor)
    if row < len(factor):
        raise np.linalg.LinAlgError(f"the matrix is not positive definite (row {row})")
    return factor


def solve_positive(a: Numbers, b: Numbers) -> Floats:
    """Solve a x = b for a positive definite a (n, n) and b (n,) or (n, m).

    Raises:
        numpy.linalg.LinAlgError: a is not positive definite.
    """
    upper = np.ascontiguousarray(cholesky(a).T)
    return solve_triangular(upper, solve_triangular(upper, b, transposed=True))


@kernel(F2, OUT2)
def _root(a: Floats, out: Floats) -> int:
    """Rows of out (n, n): the factor's columns, in the order of their pivots; return how many carry the matrix."""
    n: int = a.shape[0]
    left = np.diag(a).copy()
    first = left.max() if n else 0.0
    for k in range(n):
        best = 0
        for i in range(1, n):
            if left[i] > left[best] * (1.0 + 1e-12):
                best = i
        if not left[best] > EPSILON * first:
            return k
        pivot = np.sqrt(left[best])
        for i in range(n):
            rest = a[i, best]
            for m in range(k):
                rest -= out[m, i] * out[m, best]
            out[k, i] = rest / pivot
            left[i] -= out[k, i] * out[k, i]
        left[best] = 0.0
    return n


def root(a: Numbers) -> Floats:
    """Return an f (n, r) with f fᵀ = a to rounding for a positive semidefinite a (n, n), by Cholesky with pivoting.

    r is the numerical rank: what is left of the diagonal is rounding.
    """
    rows = np.zeros(a.shape)
    rank = _root(np.ascontiguousarray(a, dtype=np.float64), rows)
    return np.ascontiguousarray(rows[:rank].T)


def compact(factor: Numbers, tolerance: float = 0.0) -> Floats:
    """Return a factor (n, c) with the same product factor factorᵀ as (n, r), and no more columns than it needs.

    What is left out is below `tolerance` in every row.
    """
    _, r, order = qr(factor.T, pivot=True)
    keep = np.diag(r) > tolerance
    out = np.zeros((factor.shape[0], int(keep.sum())))
    out[order] = r[: len(keep)][keep].T
    return out


@kernel(OUT2, OUT2)
def _solve_banded(band: Floats, x: Floats) -> int:
    """Cholesky in place in a lower band (w + 1, n), then substitution in x (n, m); return the row where it ends, or n."""
    width: int = band.shape[0] - 1
    n: int = band.shape[1]
    for j in range(n):
        for d in range(min(width, n - 1 - j) + 1):
            rest = band[d, j]
            for k in range(max(j + d - width, 0), j):
                rest -= band[j + d - k, k] * band[j - k, k]
            if d > 0:
                band[d, j] = rest / band[0, j]
            elif rest > 0.0:
                band[0, j] = np.sqrt(rest)
            else:
                return j
    for m in range(x.shape[1]):
        for i in range(n):
            for k in range(max(i - width, 0), i):
                x[i, m] -= band[i - k, k] * x[k, m]
            x[i, m] /= band[0, i]
        for i in range(n - 1, -1, -1):
            for k in range(i + 1, min(i + width, n - 1) + 1):
                x[i, m] -= band[k - i, i] * x[k, m]
            x[i, m] /= band[0, i]
    return n


def solve_banded(band: Numbers, b: Numbers) -> Floats:
    """Solve a x = b for a positive definite a of few bands, b (n, m).

    Args:
        band: (w + 1, n), the lower diagonals: band[d, j] = a[j + d, j].
        b: right sides.

    Raises:
        numpy.linalg.LinAlgError: a is not positive definite.
    """
    x = np.array(b, dtype=np.float64, order="C")
    row = _solve_banded(np.array(band, dtype=np.float64, order="C"), x)
    if row < len(x):
        raise np.linalg.LinAlgError(f"the banded matrix is not positive definite (row {row})")
    return x


@kernel(OUT1, OUT1, OUT1, OUT2)
def _solve_tridiagonal(below: Floats, diagonal: Floats, above: Floats, x: Floats) -> None:
    """Thomas's algorithm in place: row i is below[i] x[i-1] + diagonal[i] x[i] + above[i] x[i+1]."""
    n = len(diagonal)
    for i in range(1, n):
        factor = below[i] / diagonal[i - 1]
        diagonal[i] -= factor * above[i - 1]
        for m in range(x.shape[1]):
            x[i, m] -= factor * x[i - 1, m]
    for m in range(x.shape[1]):
        x[n - 1, m] /= diagonal[n - 1]
        for i in range(n - 2, -1, -1):
            x[i, m] = (x[i, m] - above[i] * x[i + 1, m]) / diagonal[i]


def cubic_spline(x: Floats, y: Floats, ends: tuple[Floats, Floats] | Literal["not-a-knot"] = "not-a-knot") -> CubicSpline:
    """Return the C2 cubic spline through y (n, d) or (n,) at x (n,), as scipy's CubicSpline, whose solver is LAPACK's.

    Args:
        x: strictly increasing.
        y: values.
        ends: the slopes (d,) at both ends, or "not-a-knot" (with three points the parabola, with two the line).
    """
    values = np.asarray(y, dtype=np.float64).reshape(len(x), -1)
    step = np.diff(x)
    chord = np.diff(values, axis=0) / step[:, None]
    n = len(x)
    below, diagonal, above = np.zeros(n), np.ones(n), np.zeros(n)
    slope = np.zeros(values.shape)
    below[1:-1], above[1:-1] = step[1:], step[:-1]
    diagonal[1:-1] = 2.0 * (step[:-1] + step[1:])
    slope[1:-1] = 3.0 * (step[1:, None] * chord[:-1] + step[:-1, None] * chord[1:])
    if ends != "not-a-knot":
        slope[0], slope[-1] = ends
    elif n == 2:
        slope[:] = chord
    elif n == 3:
        bend = (chord[1] - chord[0]) / (x[2] - x[0])
        slope = np.stack([chord[0] - bend * step[0], chord[0] + bend * step[0], chord[1] + bend * step[1]])
        below[:], diagonal[:], above[:] = 0.0, 1.0, 0.0
    else:
        first, last = x[2] - x[0], x[-1] - x[-3]
        diagonal[0], above[0] = step[1], first
        slope[0] = ((step[0] + 2.0 * first) * step[1] * chord[0] + step[0] ** 2 * chord[1]) / first
        diagonal[-1], below[-1] = step[-2], last
        slope[-1] = (step[-1] ** 2 * chord[-2] + (2.0 * last + step[-1]) * step[-2] * chord[-1]) / last
    _solve_tridiagonal(below, diagonal, above, slope)
    return CubicSpline.through(x, values.reshape(y.shape), slope.reshape(y.shape))
