# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The speed on the template's clock: basis, mean, and what is drawn about it."""

from types import SimpleNamespace

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.optimize import minimize

from scenario_gen.method.sampling.speed_profile import mean as mean_module
from scenario_gen.method.sampling.speed_profile.mean import (
    Bounds,
    fixed_coefficients,
    mean_speed,
    MeanSpeed,
    Motion,
    Target,
)
from scenario_gen.method.sampling.speed_profile.model import kernel_root, SpeedModel
from scenario_gen.method.sampling.speed_profile.spline import (
    KNOT_SPACING_S,
    least_shares,
    lengthened_waits,
    MIN_WAIT_S,
    SpeedSpline,
)
from scenario_gen.method.sampling.time_warp import clock_from_rate, slowed_clock, SLOWING_S
from scenario_gen.situation import Wait

TIME = np.arange(201) * 0.1
CLOCK = np.array([0.0, 6.0, 9.0, 14.0, 20.0])
STANDS = [(7.0, 13.05)]


def spline(stands=STANDS):
    return SpeedSpline.over(0.0, 20.0, stands)


def plain(basis):
    m = len(basis.stations)
    return Motion.of(basis, np.ones(m), np.zeros(m), np.zeros(m))


def loose(basis, **changes):
    given = {
        "speed": np.full(basis.size, 40.0),
        "acceleration": 4.5,
        "deceleration": 8.0,
        "jerk": 3.0,
    } | changes
    return Bounds(**given)


def target(speed, length=None, ends=None):
    anchor = np.interp(
        CLOCK[1:-1], TIME, np.concatenate([[0.0], np.cumsum(0.05 * (speed[1:] + speed[:-1]))])
    )
    total = float((0.05 * (speed[1:] + speed[:-1])).sum()) if length is None else length
    return Target(
        TIME, speed, CLOCK[1:-1], anchor, (speed[0], speed[-1]) if ends is None else ends, total
    )


def test_basis_is_scipys():
    basis, c = spline(), np.random.default_rng(0).normal(size=spline().size)
    other, x = BSpline(basis.knots, c, 3), np.linspace(0.0, 20.0, 997)
    for k in range(3):  # a knot that stands twice has no third
        assert basis.design(x, k) @ c == pytest.approx(
            (other.derivative(k) if k else other)(x), abs=1e-9
        )
    whole = other.antiderivative()
    assert basis.driven(x) @ c == pytest.approx(whole(x) - whole(0.0), abs=1e-9)
    assert basis.length @ c == pytest.approx(whole(20.0) - whole(0.0))
    i = 7
    dt = 0.6 * (basis.breaks[i + 1] - basis.breaks[i])
    assert basis.pieces[i] @ c[basis.first[i] : basis.first[i] + 4] @ dt ** np.arange(
        4
    ) == pytest.approx(float(other(basis.breaks[i] + dt)))
    hat = np.interp(x, [0.0, 6.0, 9.0, 20.0], [0.0, 1.0, 0.0, 0.0])
    found = basis.projected(np.array([0.0, 6.0, 9.0, 20.0]), np.array([0.0, 1.0, 0.0, 0.0]))
    assert found == pytest.approx(
        np.trapezoid(basis.design(x) * hat[:, None], x, axis=0), abs=1e-3
    )


def test_stand_is_exactly_zero():
    basis = spline()
    c = np.where(basis.still, 0.0, 1.0)
    inside = np.linspace(*STANDS[0], 300)
    assert (basis.design(inside) @ c == 0.0).all()
    assert basis.design(np.array([5.5, 14.5])) @ c == pytest.approx([1.0, 1.0])
    assert np.diff(basis.breaks).min() > 0.75 * KNOT_SPACING_S


def test_mean_speed_is_the_minimum():
    speed = 8.0 + 2.0 * np.sin(TIME / 2.0)
    basis = spline([])
    wanted = target(speed, length=170.0, ends=(7.0, 9.5))
    smooth, found = (
        mean_speed(basis, wanted, plain(basis), loose(basis, jerk=jerk)) for jerk in (3.0, 1e3)
    )
    for one in (smooth, found):
        assert basis.length @ one == pytest.approx(170.0, abs=1e-5)
        assert one[[0, -1]].tolist() == [7.0, 9.5]
    assert (
        np.abs(plain(basis).jerk @ smooth).max()
        < 3.0 + 1e-6
        < np.abs(plain(basis).jerk @ found).max()
    )
    fine = np.linspace(0.0, 20.0, 2001)
    rows = basis.design(fine)
    bends = basis.design(fine, 2)
    reach = basis.driven(wanted.anchor_time)
    line = np.interp(fine, TIME, speed)

    def cost(c):
        off = np.square(rows @ c - line) + mean_module.SMOOTHING_S**4 * np.square(bends @ c)
        return (
            np.trapezoid(off, fine)
            + mean_module.ANCHOR_WEIGHT * np.square(reach @ c - wanted.anchor).sum()
        )

    best = minimize(
        lambda c: cost(np.r_[7.0, c, 9.5]), found[1:-1], constraints={"type": "eq", "fun": lambda c: basis.length[1:-1] @ c
        + basis.length[[0, -1]] @ [7.0, 9.5] - 170.0}, method="SLSQP", options={"maxiter": 30},
    )  # fmt: skip
    assert cost(found) <= best.fun * (1.0 + 1e-3)


def test_no_mean_where_none_can_be():
    basis = spline([])
    assert (
        mean_speed(basis, target(np.full(201, 8.0), length=900.0), plain(basis), loose(basis))
        is None
    )


def drawn(count=4000, sigma=0.8, jerk=3.0):
    speed = np.interp(TIME, [3.0, 6.5, 13.5, 17.0], [1.0, 0.0, 0.0, 1.0]) ** 2 * (
        6.0 + np.sin(1.5 * TIME)
    )
    basis = spline()
    ends = (speed[0], speed[-1])
    bounds = loose(basis, jerk=jerk)
    mean = mean_speed(basis, target(speed), plain(basis), bounds)
    model = SpeedModel.of(basis, MeanSpeed(mean, plain(basis), bounds), TIME, speed, sigma, 4.0)
    z = np.random.default_rng(3).standard_normal((count, model.count))
    longer = np.linspace(-0.2, 0.2, count)
    pace, same = np.ones((count, len(model.time))), np.ones((count, 2))
    return model, ends, longer, model.draw(z, longer, pace, same, 0.0 * same)


def test_draws_keep_ends_stands_and_bounds():
    model, ends, longer, (c, ok) = drawn()
    basis = model.spline
    assert ok.all()
    assert np.abs(c[:, [0, -1]] - ends).max() < 1e-9
    assert (c[:, basis.still] == 0.0).all()
    assert c.min() >= 0.0
    assert c @ basis.length - model.mean @ basis.length == pytest.approx(longer, abs=1e-4)
    jerk = np.abs(c @ plain(basis).jerk.T)
    assert jerk.max() < max(1.06 * 3.0, 1.01 * np.abs(plain(basis).jerk @ model.mean).max())


def test_given_speed_holds_on_any_clock():
    model, ends, _, _ = drawn(1)
    pace = np.array([[0.9, 1.2]])
    c, _ = model.draw(
        np.zeros((1, model.count)),
        np.zeros(1),
        np.ones((1, len(model.time))),
        pace,
        np.zeros((1, 2)),
    )
    assert c[0, [0, -1]] / pace[0] == pytest.approx(ends)
    assert model.spline.length @ (c[0] - model.mean) == pytest.approx(0.0, abs=1e-9)


def test_draws_have_the_stated_covariance():
    model, _, _, (c, _) = drawn(20_000, jerk=1e3)
    free = ~fixed_coefficients(model.spline, (0.0, 0.0))[0]
    away = free & (model.mean > 5.0 * np.sqrt(np.square(model.factor).sum(axis=1)))
    found, stated = np.cov(c[:, away].T), (model.factor @ model.factor.T)[np.ix_(away, away)]
    assert np.abs(found - stated).max() < 0.05 * stated.max()


def test_kernel_is_of_a_derivative():
    t = np.linspace(0.0, 10.0, 60)
    root = kernel_root(t, np.full(60, 0.3), 1.2)
    d = t[:, None] - t
    assert root @ root.T == pytest.approx(
        0.09 * (1.0 - (d / 1.2) ** 2) * np.exp(-0.5 * (d / 1.2) ** 2), abs=1e-6
    )


@settings(max_examples=50)
@given(st.floats(1.0, 1.8), st.floats(2.0, 17.0), st.floats(0.3, 3.0))
def test_clock_slows_where_it_must(need, at, width):
    grid = np.linspace(0.0, 20.0, 201)
    needs = np.where(np.abs(grid - at) < 0.5 * width, need, 1.0)
    clock = slowed_clock(grid, [np.ones(201), needs], 2.0)
    assert (clock.rate >= needs - 1e-9).all()
    assert clock.rate.max() <= need + 1e-9
    far = np.abs(grid - at) > 0.5 * width + 2.5 * SLOWING_S
    assert clock.rate[far] == pytest.approx(1.0)
    assert np.abs(np.diff(clock.rate, 2)).max() < 0.02
    assert clock.time[-1] == pytest.approx(np.trapezoid(clock.rate, grid))
    assert slowed_clock(grid, [needs], 1.01).time[-1] <= 20.2 + 1e-9


def test_motion_follows_the_chain_rule():
    basis = spline([])
    grid = np.linspace(0.0, 20.0, 2001)
    clock = clock_from_rate(grid, 1.0 + 0.2 * np.sin(0.5 * grid) ** 2)
    c = 8.0 + np.random.default_rng(5).normal(size=basis.size)
    tau = basis.breaks[5:-5]
    motion = Motion.of(basis, *clock.at(basis.stations)[1:])
    h = 1e-3

    def speed(at):
        return basis.design(at) @ c / clock.at(at)[1]

    rate = clock.at(tau)[1]
    slope = (speed(tau + h) - speed(tau - h)) / (2.0 * h)
    assert (motion.acceleration @ c)[5:-5] == pytest.approx(slope / rate, abs=1e-2)


@pytest.mark.parametrize("seconds", [0.3, 1.0, MIN_WAIT_S, 4.0])
def test_short_waits_are_lengthened(seconds):
    waits = [
        Wait(0, 1.0, 9.0),
        Wait(1, 6.0, 6.0 + seconds),
        Wait(1, 12.0, 15.0, moves_slowly=True),
    ]
    ((start, end),) = lengthened_waits(1, waits, creeping=False)
    assert end - start == pytest.approx(max(seconds, MIN_WAIT_S))
    assert start + end == pytest.approx(12.0 + seconds)
    assert lengthened_waits(1, waits, creeping=True) == [(12.0, 15.0)]


def test_fast_clock_keeps_a_wait():
    """Sampled at 10 Hz in any phase, it stands for the 1 s of a wait; no clock has to be slower for it."""
    ((start, end),) = lengthened_waits(0, [Wait(0, 5.0, 5.3)], creeping=False)
    (share,) = least_shares(np.array([5.15]), [Wait(0, 5.0, 5.3)])
    assert share < 1.0
    shortest = (end - start) * share
    for phase in np.linspace(0.0, 0.1, 101):
        count = np.count_nonzero(np.arange(phase, 4.0, 0.1) <= shortest)
        assert 0.1 * (count - 1) > 1.0 - 1e-9


def test_standing_end_has_no_speed():
    """Whatever speed is given for that end."""
    stands = SimpleNamespace(still=np.array([True, True, False, False]), size=4)
    given, value = fixed_coefficients(stands, (0.3, 5.0))
    assert given.tolist() == [True, True, False, True]
    assert value.tolist() == [0.0, 0.0, 0.0, 5.0]
