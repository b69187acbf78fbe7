# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The elementary functions against numpy and scipy: right to the last bits, and defined where they are."""

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from scipy import special, stats

from scenario_gen.numerics import exact

RANDOM = np.random.default_rng(0)
WIDE = np.concatenate([RANDOM.normal(size=20000), RANDOM.uniform(-700.0, 700.0, 20000), RANDOM.uniform(-1e6, 1e6, 20000)])
POSITIVE = np.concatenate([np.abs(WIDE), 10.0 ** RANDOM.uniform(-320.0, 300.0, 20000), RANDOM.uniform(0.9, 1.1, 20000)])


def units(found: np.ndarray, wanted: np.ndarray) -> float:
    """Largest error in units of the last place."""
    return float((np.abs(found - wanted) / np.spacing(np.abs(wanted))).max())


@pytest.mark.parametrize(
    ("name", "x", "most"),
    [
        ("exp", WIDE[np.abs(WIDE) < 700.0], 1.0),
        ("log", POSITIVE, 1.0),
        ("sin", WIDE, 1.0),
        ("cos", WIDE, 1.0),
        ("tan", WIDE, 2.0),
        ("arctan", WIDE, 1.0),
        ("tanh", WIDE, 16.0),
    ],
)
def test_functions_of_one_number(name, x, most):
    assert units(getattr(exact, name)(x), getattr(np, name)(x)) <= most


def test_functions_of_two_numbers():
    y = RANDOM.permutation(WIDE)
    assert units(exact.arctan2(y, WIDE), np.arctan2(y, WIDE)) <= 1.0
    assert units(exact.hypot(y, WIDE), np.hypot(y, WIDE)) <= 1.0


def test_arctan2_on_the_axes():
    for y in (0.0, -0.0, 1.0, -1.0, np.inf):
        for x in (0.0, -0.0, 1.0, -1.0, np.inf, -np.inf):
            assert exact.arctan2(y, x) == pytest.approx(np.arctan2(y, x), abs=5e-16), (y, x)
            assert np.signbit(exact.arctan2(y, x)) == np.signbit(np.arctan2(y, x)), (y, x)


def test_functions_of_statistics():
    x = POSITIVE[(POSITIVE > 1e-9) & (POSITIVE < 1e5)]
    assert (np.abs(exact.lgamma(x) - special.gammaln(x)) <= 1e-14 * np.maximum(1.0, np.abs(special.gammaln(x)))).all()
    z = RANDOM.normal(0.0, 6.0, 50000)
    assert exact.ndtr(z) == pytest.approx(special.ndtr(z), rel=1e-13)
    p = np.concatenate([RANDOM.random(50000), 10.0 ** RANDOM.uniform(-300.0, -1.0, 20000)])
    assert exact.ndtri(p) == pytest.approx(special.ndtri(p), rel=1e-14)


def test_limits():
    with np.errstate(all="ignore"):
        assert exact.exp(np.array([-np.inf, -800.0, 800.0])).tolist() == [0.0, 0.0, np.inf]
        assert exact.log(np.array([0.0, np.inf])).tolist() == [-np.inf, np.inf]
        assert exact.ndtri(np.array([0.0, 1.0])).tolist() == [-np.inf, np.inf]
        assert exact.tanh(np.array([-np.inf, np.inf])).tolist() == [-1.0, 1.0]
        for function in (exact.exp, exact.log, exact.sin, exact.cos, exact.tanh, exact.ndtr, exact.ndtri, exact.arctan):
            assert np.isnan(function(np.nan))
        assert np.isnan([exact.log(-1.0), exact.ndtri(-0.1), exact.ndtri(1.1), exact.lgamma(0.0)]).all()
        assert np.abs(exact.sin(np.array([1e9, 1e18, 1e300]))).max() <= 1.0


@given(st.floats(-1e6, 1e6))
def test_sine_and_cosine_belong_together(x):
    assert exact.sin(x) ** 2 + exact.cos(x) ** 2 == pytest.approx(1.0, abs=1e-15)
    assert exact.sin(-x) == -exact.sin(x)
    assert exact.cos(-x) == exact.cos(x)


def test_power_multiplies():
    x = np.array([2.0, -3.0, 0.5])
    assert exact.power(x, 3).tolist() == [8.0, -27.0, 0.125]
    assert exact.power(x, -2).tolist() == [0.25, 1.0 / 9.0, 4.0]
    assert exact.power(x, 0).tolist() == [1.0, 1.0, 1.0]
    assert exact.power(2.0, 10) == 1024.0


def test_normal_numbers_are_normal():
    drawn = exact.standard_normal(np.random.default_rng(5), (100_000,))
    assert stats.kstest(drawn, "norm").pvalue > 0.01
    assert np.abs([drawn.mean(), drawn.std() - 1.0, stats.skew(drawn), stats.kurtosis(drawn)]).max() < 0.05
    assert np.isfinite(exact.ndtri(np.array([0.5**54, 1.0 - 0.5**53]))).all()  # the first and last that can be drawn
