# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""DTW and the feature matrix against hand-computed cases and the libraries."""

from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
import numpy as np
import pytest
from scipy.spatial.distance import cdist

from benchmarks._feature_matrix import dtw_distance, feature_matrix
from scenario_gen.method.evaluation.dtw import feature_extents, feature_rows, mean_feature

numbers = st.floats(-100.0, 100.0, allow_subnormal=False)


def series(channels):
    return st.integers(1, 12).flatmap(
        lambda n: arrays.arrays(np.float64, (n, channels), elements=numbers)
    )


def test_by_hand():
    assert dtw_distance([0.0, 1.0, 2.0], [0.0, 2.0]) == 1.0
    assert dtw_distance([[0.0, 0.0]], [[3.0, 4.0]]) == 5.0


@pytest.mark.parametrize("shape", [(300, 300), (257, 400), (1000, 700)])
@pytest.mark.parametrize("band", [None, 30])
def test_equals_dtaidistance(shape, band):
    peer = pytest.importorskip("dtaidistance.dtw_ndim", reason="dtaidistance is not installed")
    rng = np.random.default_rng(1)
    a, b = (rng.normal(size=(n, 2)).cumsum(axis=0) for n in shape)
    expected = peer.distance_fast(
        a, b, inner_dist="euclidean", window=None if band is None else band + 1
    )
    assert dtw_distance(a, b, band=band) == pytest.approx(expected, abs=1e-9)


def test_feature_matrix_equals_scipy():
    assert feature_matrix([0.0, 1.0], [1.0, 5.0]).tolist() == [[0.2, 1.0], [0.0, 0.8]]
    assert not feature_matrix([3.0, 3.0], [1.0, 1.0]).any()  # all distances equal
    rng = np.random.default_rng(2)
    a, b = rng.normal(size=(40, 2)), rng.normal(size=(31, 2))
    for ours, theirs in (("euclidean", "euclidean"), ("manhattan", "cityblock")):
        cost = cdist(a, b, theirs)
        np.testing.assert_allclose(
            feature_matrix(a, b, ours), (cost - cost.min()) / np.ptp(cost), atol=1e-14
        )


@settings(max_examples=60)
@given(series(1), series(1))
def test_headings_differ_by_the_wrapped_angle(a, b):
    away = np.abs(np.angle(np.exp(1j * (a - b.T))))
    spread = np.ptp(away)
    if spread > 1e-6:
        np.testing.assert_allclose(
            feature_matrix(a, b, "angle"), (away - away.min()) / spread, atol=1e-11 / spread
        )


@pytest.mark.parametrize("n_samples", [5, 70])
def test_batched_rows_are_the_matrices(n_samples):
    """With fewer and with more samples than instants."""
    rng = np.random.default_rng(3)
    a, b = (rng.normal(size=(n_samples, 2, count)) for count in (20, 30))
    single = np.stack([feature_matrix(x.T, y.T) for x, y in zip(a, b, strict=True)])
    rows = feature_rows(a, b, feature_extents(a, b, "euclidean"), range(3, 7), "euclidean")
    np.testing.assert_array_equal(rows.reshape(n_samples, 4, 30), single[:, 3:7])
    np.testing.assert_allclose(mean_feature(a, b, "euclidean"), single.mean(axis=0), atol=1e-15)
