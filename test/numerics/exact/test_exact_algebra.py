# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The linear algebra against numpy, scipy and hand-made cases."""

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.linalg import solveh_banded

from scenario_gen.numerics import exact

RANDOM = np.random.default_rng(1)


@pytest.mark.parametrize(
    ("left", "right"),
    [
        ((5, 7), (7, 9)),
        ((5, 7), (7, 2)),
        ((7,), (7, 9)),
        ((5, 7), (7,)),
        ((7,), (7,)),
        ((3, 5, 7), (7, 9)),
        ((3, 5, 7), (3, 7, 2)),
        ((2, 1, 5, 7), (3, 7, 4)),
        ((0, 7), (7, 3)),
        ((3, 0), (0, 4)),
    ],
)
def test_products_have_the_shapes_and_values_of_numpy(left, right):
    a, b = RANDOM.normal(size=left), RANDOM.normal(size=right)
    assert exact.matmul(a, b).shape == (a @ b).shape
    assert exact.matmul(a, b) == pytest.approx(a @ b, abs=1e-13)


def test_matrices_that_do_not_match_are_refused():
    with pytest.raises(ValueError, match="no product"):
        exact.matmul(np.zeros((2, 3)), np.zeros((2, 3)))


def test_a_row_of_a_product_does_not_depend_on_the_others():
    a, b = RANDOM.normal(size=(50, 33)), RANDOM.normal(size=(33, 21))
    whole = exact.matmul(a, b)
    assert all((exact.matmul(a[k : k + 1], b)[0] == whole[k]).all() for k in range(50))


@pytest.mark.parametrize("odd", [0.0, np.inf, np.nan])
def test_zeros_of_a_large_matrix_change_no_bit(odd):
    rng = np.random.default_rng(5)
    a, b = np.triu(np.tril(rng.normal(size=(40, 43)), 3), -2), rng.normal(size=(43, 7))
    b[20, 3] = odd
    whole = exact.matmul(a, b)
    for row, alone in zip(whole, a, strict=True):  # of a single row none is skipped
        assert row.tobytes() == exact.matmul(alone, b).tobytes()


@given(st.integers(1, 12), st.integers(1, 12), st.booleans(), st.booleans(), st.integers(0, 2**32 - 1))
@settings(max_examples=60)
def test_qr_is_a_factorisation(m, n, full, pivot, seed):
    a = np.random.default_rng(seed).normal(size=(m, n))
    q, r, order = exact.qr(a, full=full, pivot=pivot)
    assert q.shape == ((m, m) if full else (m, min(m, n)))
    assert q @ r == pytest.approx(a[:, order], abs=1e-12)
    assert q.T @ q == pytest.approx(np.eye(q.shape[1]), abs=1e-12)
    assert (np.diag(r) >= 0.0).all()
    assert not np.tril(r, -1).any()


@pytest.mark.parametrize("tiny", [1e-156, 3e-162, 5e-320])
def test_columns_whose_square_is_hardly_a_number_count_as_none(tiny):
    a = np.concatenate([np.eye(6, 2), np.full((6, 3), tiny)], axis=1)
    q, r, _ = exact.qr(a)
    assert q @ r == pytest.approx(a, abs=1e-150)
    assert q.T @ q == pytest.approx(np.eye(5), abs=1e-12)


def test_least_squares():
    a, b = RANDOM.normal(size=(20, 6)), RANDOM.normal(size=(20, 2))
    assert exact.lstsq(a, b) == pytest.approx(np.linalg.lstsq(a, b, rcond=None)[0], abs=1e-12)
    a[:, 3] = 2.0 * a[:, 1]
    found = exact.lstsq(a, b)
    assert a @ found == pytest.approx(a @ np.linalg.lstsq(a, b, rcond=None)[0], abs=1e-12)
    assert (found[1] == 0.0).all() or (found[3] == 0.0).all()
    assert exact.lstsq(np.zeros((4, 2)), np.ones(4)).tolist() == [0.0, 0.0]


def test_roots_of_covariances():
    x = np.linspace(0.0, 3.0, 50)
    kernel = np.exp(-0.5 * (x[:, None] - x) ** 2)
    root = exact.root(kernel)
    assert root.shape[1] < 25
    assert root @ root.T == pytest.approx(kernel, abs=1e-14)
    wide = RANDOM.normal(size=(4, 30))
    assert exact.compact(wide).shape == (4, 4)
    assert exact.compact(wide) @ exact.compact(wide).T == pytest.approx(wide @ wide.T, abs=1e-12)
    low = RANDOM.normal(size=(40, 3)) @ RANDOM.normal(size=(3, 30))
    assert exact.compact(low, 1e-9).shape == (40, 3)
    assert exact.compact(low, 1e-9) @ exact.compact(low, 1e-9).T == pytest.approx(low @ low.T, abs=1e-11)


def test_positive_definite_systems():
    a = RANDOM.normal(size=(12, 30))
    a, b = a @ a.T, RANDOM.normal(size=(12, 3))
    assert exact.cholesky(a) == pytest.approx(np.linalg.cholesky(a), abs=1e-12)
    assert exact.solve_positive(a, b) == pytest.approx(np.linalg.solve(a, b), abs=1e-10)
    with pytest.raises(np.linalg.LinAlgError, match="row 1"):
        exact.cholesky(np.array([[1.0, 2.0], [2.0, 1.0]]))


def test_banded_systems():
    band = np.zeros((4, 50))
    band[0], band[1, :-1], band[2, :-2], band[3, :-3] = 10.0, -3.0, 1.0, 0.5
    b = RANDOM.normal(size=(50, 2))
    assert exact.solve_banded(band, b) == pytest.approx(solveh_banded(band, b, lower=True), abs=1e-13)
    with pytest.raises(np.linalg.LinAlgError):
        exact.solve_banded(-band, b)


@pytest.mark.parametrize("points", [2, 3, 4, 5, 40])
def test_splines_are_those_of_scipy(points):
    x = np.cumsum(RANDOM.random(points) + 0.1)
    y = RANDOM.normal(size=(points, 2))
    at = np.linspace(x[0], x[-1], 200)
    for derivative in range(3):
        assert exact.cubic_spline(x, y)(at, derivative) == pytest.approx(CubicSpline(x, y)(at, derivative), abs=1e-8)
    clamped = CubicSpline(x, y, bc_type=((1, y[0]), (1, y[1])))
    assert exact.cubic_spline(x, y, (y[0], y[1]))(at) == pytest.approx(clamped(at), abs=1e-10)
    assert exact.cubic_spline(x, y[:, 0])(at).shape == (200,)
