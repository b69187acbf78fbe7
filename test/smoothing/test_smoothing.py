# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Path and motion, each against its definition."""

from dataclasses import replace

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from scipy.optimize import minimize

from scenario_gen.logs import LogConfig
from scenario_gen.logs.encounters import cut_track, pieces_of
from scenario_gen.logs.raw import Observations
from scenario_gen.logs.smoothing import interpolated_piece, smooth_piece, standing
from scenario_gen.smoothing.motion import Motion
from scenario_gen.smoothing.path import (
    estimated_noise,
    fit_path,
    headings_of,
    smoothing_spline,
    straight_path,
    white_equivalent,
)

CONFIG = LogConfig()


@pytest.mark.parametrize("starts", [False, True])
def test_motion_minimises_its_quadratic_program(starts):
    """Against scipy's general-purpose solver on a small case with active limits."""
    rng = np.random.Generator(np.random.PCG64(3))
    config = LogConfig(jerk=5.0, acceleration_limit=1.0, braking_limit=2.0)
    motion = Motion(np.zeros(12, dtype=bool), config.period, 5.0, -2.0, 1.0)
    time = np.sort(rng.uniform(0.0, 1.1, 15))
    place = 2.0 * (np.maximum(time, 0.5) if starts else np.minimum(time, 0.5))
    place += rng.normal(0.0, 0.05, 15)
    found = motion.solve([(time, place, np.full(15, 0.1), False)])

    def cost(coefficients):
        misfit = (motion.place(coefficients, time) - place) / 0.1
        jerk = np.diff(coefficients, 3) / 0.1**3
        return 0.5 * (misfit @ misfit) + 0.5 * 0.1 * (jerk @ jerk) / 25.0

    limits = [
        {"type": "ineq", "fun": lambda c: np.diff(c) / 0.1},
        {"type": "ineq", "fun": lambda c: 1.0 - np.diff(c, 2) / 0.01},
        {"type": "ineq", "fun": lambda c: 2.0 + np.diff(c, 2) / 0.01},
    ]
    best = minimize(
        cost, found + 0.01, constraints=limits, options={"maxiter": 2000, "ftol": 1e-14}
    )
    assert cost(found) <= best.fun * (1.0 + 1e-4)
    acceleration = np.diff(found, 2) / 0.01
    assert acceleration.max() <= 1.0 + 1e-5 and acceleration.min() >= -2.0 - 1e-5
    limit, reached = (1.0, acceleration.max()) if starts else (-2.0, acceleration.min())
    assert reached == pytest.approx(limit, abs=1e-3)  # the limit is active


def test_between_samples_the_acceleration_is_constant():
    rng = np.random.Generator(np.random.PCG64(4))
    motion = Motion(np.zeros(30, dtype=bool), 0.1, 0.5, -8.0, 5.0)
    coefficients = np.cumsum(rng.uniform(0.0, 1.0, 31))
    place, speed = motion.at_ticks(coefficients)
    np.testing.assert_allclose(np.diff(place), (speed[1:] + speed[:-1]) / 2.0 * 0.1, atol=1e-12)
    np.testing.assert_allclose(motion.place(coefficients, 0.1 * np.arange(30)), place, atol=1e-9)
    half = motion.place(coefficients, 0.1 * np.arange(29) + 0.05)
    np.testing.assert_allclose(
        half, place[:-1] + 0.05 * (3.0 * speed[:-1] + speed[1:]) / 4.0, atol=1e-9
    )


@given(seed=st.integers(0, 10_000), radius=st.floats(8.0, 200.0), noise=st.floats(0.0, 0.4))
@settings(max_examples=25)
def test_path_through_noisy_points_on_arc(seed, radius, noise):
    rng = np.random.Generator(np.random.PCG64(seed))
    along = np.linspace(0.0, min(60.0, 4.0 * radius), 120)
    angle = along / radius
    truth = radius * np.column_stack([np.sin(angle), 1.0 - np.cos(angle)])
    path = fit_path(
        along,
        truth + rng.normal(0.0, noise, truth.shape),
        np.ones(120),
        max(noise, 0.1),
        np.full(120, 5.0),
    )
    arc, aside = path.project(along, truth)
    assert aside.max() < 0.15 + 1.5 * noise
    np.testing.assert_allclose(np.ptp(arc), np.ptp(along), rtol=0.03)
    position, heading = path.pose(np.linspace(arc[0], arc[-1], 300))
    steps = np.hypot(*np.diff(position, axis=0).T)
    np.testing.assert_allclose(steps, steps.mean(), rtol=2e-3)  # by arc length
    assert np.ptp(heading) == pytest.approx(np.ptp(angle), abs=0.1 + noise)


def test_a_straight_path():
    path = straight_path(np.array([3.0, 4.0]), np.pi / 2.0, 0.0, 2.0)
    position, heading = path.pose(np.array([1.0, 2.0]))
    np.testing.assert_allclose(position, [[3.0, 4.0], [3.0, 5.0]], atol=1e-9)
    np.testing.assert_allclose(heading, np.pi / 2.0)


def drive(speed, noise, seed=0, rate=10.0, sensor=1.0):
    """A track east with the given speeds at `rate` Hz."""
    rng = np.random.Generator(np.random.PCG64(seed))
    place = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2.0 / rate)])
    stamps = (np.arange(len(speed)) / rate * 1e9).astype(np.int64)
    fix = np.column_stack([place, np.zeros(len(speed))]) + rng.normal(0.0, noise, (len(speed), 2))
    rows = np.arange(len(speed))
    return place, Observations(
        "v", stamps, fix, rows, np.full(len(speed), np.nan), stamps, speed * sensor, rows, 4.8, 1.9
    )


def smoothed(track):
    return smooth_piece(track, interpolated_piece(track, 0, CONFIG), 0, CONFIG)


def test_standing_is_still_and_keeps_heading():
    speed = np.interp(np.arange(0.0, 20.0, 0.1), [0, 5, 8, 13, 18], [8.0, 8.0, 0.0, 0.0, 6.0])
    place, track = drive(speed, noise=0.3)
    smooth = smoothed(track)
    still = (smooth.speed == 0.0).nonzero()[0]
    assert abs(still[0] - 80) <= 4 and abs(still[-1] - 130) <= 4
    assert np.ptp(smooth.position[still], axis=0).max() < 1e-9
    assert np.ptp(smooth.heading[still]) < 1e-12
    assert np.abs(smooth.heading).max() < 0.12
    assert np.abs(smooth.position[:, 0] - place).max() < 0.4


def test_biased_sensor_does_not_lengthen_way():
    speed = np.full(400, 12.0)
    place, track = drive(speed, noise=0.2, sensor=1.03)
    smooth = smoothed(track)
    assert np.abs(smooth.position[:, 0] - place).max() < 0.5
    assert smooth.speed.mean() == pytest.approx(12.0, abs=0.1)


def test_stuck_speed_sensor_stops_no_car():
    speed = np.full(100, 10.0)
    place, track = drive(speed, noise=0.1, sensor=0.0)
    assert not standing(
        0.1 * np.arange(100), track.fix_ns * 1e-9, track.fix, track.speed_ns * 1e-9, track.speed
    ).any()
    smooth = smoothed(track)
    assert np.abs(smooth.position[:, 0] - place).max() < 1.5


@pytest.mark.parametrize(("rolling_mps", "still_count"), [(0.095, 50), (0.105, 30)])
def test_standing_car_does_not_roll(rolling_mps, still_count):
    """A second on either side of a stand is part of it below 0.1 m/s only."""
    speed = np.repeat([5.0, rolling_mps, 0.0, rolling_mps, 5.0], [10, 10, 30, 10, 10])
    seconds = 0.1 * np.arange(len(speed))
    stands = standing(seconds, seconds, np.zeros((len(speed), 2)), seconds, speed)
    assert stands.sum() == still_count


def test_coloured_noise_counts_more_than_white():
    rng = np.random.Generator(np.random.PCG64(5))
    white = rng.normal(0.0, 1.0, 20_000)
    assert white_equivalent(white) == pytest.approx(1.0, rel=0.03)
    coloured = np.convolve(white, np.ones(5) / np.sqrt(5.0), mode="same")  # autocorrelation time 5
    assert white_equivalent(coloured) == pytest.approx(np.sqrt(5.0), rel=0.08)


def test_noise_of_fixes_does_not_accelerate():
    """A straight drive at 15 m/s with 0.3 m of noise: before, the path followed it with several m/s²."""
    speed = np.full(150, 15.0)
    _, track = drive(speed, noise=0.3, seed=2)
    smooth = smoothed(track)
    assert np.abs(np.diff(smooth.heading) / 0.1 * smooth.speed[1:]).max() < 0.8
    assert 0.2 < smooth.noise < 0.4
    assert np.sqrt(np.square(smooth.moved).mean()) < 0.3 * np.sqrt(2.0) * 1.1


def turning(noise, heading_noise):
    """A car that turns left by 90° at 2 m/s, with a heading sensor; true positions and headings beside the track."""
    rng = np.random.Generator(np.random.PCG64(8))
    along = 0.2 * np.arange(120)
    course = np.clip((along - 6.0) / 6.0, 0.0, np.pi / 2.0)
    xy = np.cumsum(0.2 * np.column_stack((np.cos(course), np.sin(course))), axis=0)
    _, track = drive(np.full(120, 2.0), noise=0.0)
    fix = xy + rng.normal(0.0, noise, xy.shape)
    return (
        xy,
        course,
        replace(track, fix=fix, heading=course + rng.normal(0.0, heading_noise, 120)),
    )


def test_slow_cars_have_their_recorded_headings():
    _, course, track = turning(1.0, np.radians(1.0))
    with_them = smoothed(track)
    without = smoothed(replace(track, heading=np.full(120, np.nan)))
    off = [
        np.sqrt(np.square(np.degrees(smooth.heading - course)).mean())
        for smooth in (with_them, without)
    ]
    assert off[0] < 2.0
    assert off[1] > 4.0
    assert np.degrees(np.abs(with_them.turned)).max() < 10.0


@pytest.mark.parametrize("wrong", [0.0, 2.5])
def test_missing_headings_are_not_used(wrong):
    """A default, or one that is always far off; and one that jumps about while the car stands."""
    _, course, track = turning(0.1, 0.0)
    heading = np.full(120, wrong) if wrong else np.where(np.arange(120) < 10, -1.5, course)
    smooth = smoothed(replace(track, heading=heading))
    assert np.degrees(np.abs(smooth.heading - course)).max() < 8.0


def test_headings_are_weighed_by_their_scatter():
    """Headings that alternate by ±a turn by 2a, of which the second difference is 4a."""
    course, speed = np.zeros(200), np.full(200, 5.0)
    scatter = np.radians(0.5) * (-1.0) ** np.arange(200)
    for heading, added in ((course, 0.0), (scatter, 9.0 * (4.0 * np.radians(0.5)) ** 2 / 6.0)):
        weight = headings_of(heading, course, speed).weight
        np.testing.assert_allclose(weight, 1.0 / (np.radians(2.0) ** 2 + added), rtol=1e-9)
    assert headings_of(np.full(200, np.nan), course, speed) is None


def test_noise_is_independent_of_axes():
    rng = np.random.Generator(np.random.PCG64(6))
    along = np.linspace(0.0, 90.0, 300)
    fix = np.column_stack((along, 0.002 * along**2)) + rng.normal(0.0, (0.2, 0.5), (300, 2))
    turned = fix @ np.array([[0.6, 0.8], [-0.8, 0.6]])
    assert estimated_noise(turned) == pytest.approx(estimated_noise(fix), rel=1e-9)
    assert estimated_noise(fix) == pytest.approx(0.5, rel=0.1)
    smooth = np.column_stack((along, np.zeros(300)))
    assert (estimated_noise(smooth), estimated_noise(smooth, 0.02)) == (0.1, 0.02)
    assert estimated_noise(smooth[:5]) == 0.5


@pytest.mark.parametrize("wavelength", [20.0, 60.0])
def test_a_spline_halves_its_wavelength(wavelength):
    u = np.linspace(0.0, 600.0, 2401)
    wave = np.column_stack((np.cos(2.0 * np.pi * u / wavelength), np.ones(len(u))))
    grid, smooth = smoothing_spline(u, wave, wavelength)
    middle = np.abs(grid - 300.0) < wavelength
    assert np.ptp(smooth[middle, 0]) == pytest.approx(1.0, rel=0.02)
    np.testing.assert_allclose(smooth[:, 1], 1.0, atol=1e-9)


def test_reversing_in_a_stop_is_cut():
    along = np.concatenate((0.2 * np.arange(100), np.full(5, 19.8), 19.8 - 0.2 * np.arange(100)))
    speed = np.abs(np.gradient(along, 0.1))
    _, track = drive(speed, noise=0.0)
    aside = np.where(np.arange(205) < 105, 0.0, 0.05 * (np.arange(205) - 105))
    track = replace(track, fix=np.column_stack((along, aside)))
    pieces, quality = pieces_of(cut_track(track, 0, CONFIG), 0, CONFIG)
    assert quality.reversals >= 1
    for piece in pieces:
        steps = np.hypot(*np.diff(piece.smooth.position, axis=0).T)
        assert (np.abs(np.diff(piece.smooth.heading)) <= 0.4 * steps + 1e-6).all()
