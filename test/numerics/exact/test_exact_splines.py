# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Splines, moving windows and sparse columns: the very bits of scipy's."""

from clarabel import DefaultSettings, DefaultSolver, NonnegativeConeT, ZeroConeT
import numpy as np
import pytest
from scipy import interpolate, ndimage, sparse

from scenario_gen.numerics import exact
from scenario_gen.numerics.exact.sparse import Columns

RANDOM = np.random.default_rng(28)


@pytest.mark.parametrize("derivative", [0, 1, 2])
@pytest.mark.parametrize("spans", [4, 5, 33])
def test_a_cubic_spline_of_even_knots_is_that_of_scipy(spans, derivative):
    knots = -3.7 + 0.83 * np.arange(-3, spans + 4)
    coefficients = RANDOM.normal(size=(spans + 3, 2))
    at = np.concatenate([RANDOM.uniform(knots[0] - 2.0, knots[-1] + 2.0, 300), knots])
    expected = interpolate.BSpline(knots, coefficients, 3)(at, derivative)
    np.testing.assert_array_equal(exact.BSpline(knots, coefficients, 3)(at, derivative), expected)


def test_a_line_between_two_knots_goes_on_outside():
    knots, ends = np.array([1.0, 1.0, 4.0, 4.0]), np.array([[0.0, 2.0], [3.0, -1.0]])
    at = np.array([-2.0, 1.0, 2.5, 4.0, 7.0])
    np.testing.assert_array_equal(exact.BSpline(knots, ends, 1)(at), interpolate.BSpline(knots, ends, 1)(at))
    np.testing.assert_array_equal(exact.BSpline(knots, ends, 1)(at, 1), np.tile([1.0, -1.0], (5, 1)))


@pytest.mark.parametrize("degree", [2, 3])
def test_the_basis_is_a_row_of_the_design_matrix(degree):
    knots = 2.0 + 0.31 * np.arange(40)
    at = np.concatenate([RANDOM.uniform(knots[degree], knots[-degree - 1], 200), knots[degree : -degree - 1]])
    first, values = exact.bspline_basis(knots, degree, at)
    rows = interpolate.BSpline.design_matrix(at, knots, degree).tocsr()
    np.testing.assert_array_equal(first, rows.indices.reshape(-1, degree + 1)[:, 0])
    np.testing.assert_array_equal(values, rows.data.reshape(-1, degree + 1))


@pytest.mark.parametrize("shape", [(9,), (9, 2), (2, 3)])
@pytest.mark.parametrize("derivative", [0, 1, 2, 3])
def test_cubics_through_points_and_slopes_are_those_of_scipy(shape, derivative):
    breaks = np.sort(RANDOM.normal(size=shape[0]))
    values, slopes = RANDOM.normal(size=shape), RANDOM.normal(size=shape)
    at = np.concatenate([RANDOM.uniform(-4.0, 4.0, 200), breaks])
    expected = interpolate.CubicHermiteSpline(breaks, values, slopes)(at, derivative)
    np.testing.assert_array_equal(exact.CubicSpline.through(breaks, values, slopes)(at, derivative), expected)


def test_breaks_that_do_not_increase_are_refused():
    with pytest.raises(ValueError, match="must increase"):
        exact.CubicSpline.through(np.array([0.0, 1.0, 1.0]), np.zeros(3), np.zeros(3))


@pytest.mark.parametrize("width", [1, 3, 7, 41])
@pytest.mark.parametrize("length", [1, 2, 20, 100])
def test_moving_windows_are_those_of_scipy_also_where_they_are_wider_than_the_values(width, length):
    values, pair = RANDOM.normal(size=length), RANDOM.normal(size=(2, length))
    np.testing.assert_array_equal(exact.moving_mean(values, width), ndimage.uniform_filter1d(values, width, mode="nearest"))
    np.testing.assert_array_equal(exact.moving_mean(pair, width), ndimage.uniform_filter1d(pair, width, axis=1, mode="nearest"))
    np.testing.assert_array_equal(exact.moving_max(values, width), ndimage.maximum_filter1d(values, width, mode="nearest"))
    np.testing.assert_array_equal(exact.moving_min(values, width), ndimage.minimum_filter1d(values, width, mode="nearest"))


@pytest.mark.parametrize("size", [1, 3, 4, 17])
def test_a_gram_matrix_is_the_product(size):
    rows = RANDOM.normal(size=(size, 37))
    np.testing.assert_array_equal(exact.gram(rows), exact.matmul(rows, rows.T))


def test_columns_are_those_of_scipy_and_clarabel_solves_with_them():
    dense = np.where(RANDOM.random((7, 5)) < 0.5, RANDOM.normal(size=(7, 5)), 0.0)
    dense[:, 2] = 0.0
    ours, theirs = Columns.of_dense(dense), sparse.csc_array(dense)
    order = RANDOM.permutation(dense.size)
    rows, columns = (index.ravel()[order] for index in np.indices(dense.shape))
    for made in (ours, Columns.of_entries(rows, columns, dense[rows, columns], (7, 5))):
        np.testing.assert_array_equal(made.data, theirs.data)
        np.testing.assert_array_equal(made.indices, theirs.indices)
        np.testing.assert_array_equal(made.indptr, theirs.indptr)
    settings = DefaultSettings()
    settings.verbose = False
    constraints = np.vstack([np.ones((1, 3)), -np.eye(3)])
    right, cones = np.array([1.0, 0.0, 0.0, 0.0]), [ZeroConeT(1), NonnegativeConeT(3)]
    found = [
        DefaultSolver(make(np.eye(3)), np.array([0.0, 1.0, -0.25]), make(constraints), right, cones, settings).solve().x
        for make in (Columns.of_dense, sparse.csc_matrix)
    ]
    assert found[0] == found[1] == pytest.approx([0.375, 0.0, 0.625], abs=1e-6)
