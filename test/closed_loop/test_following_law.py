# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Accelerations behind a leader and towards a wait, against IDM's equations (Treiber, Hennecke, Helbing 2000)."""

import numpy as np
import pytest

from scenario_gen.closed_loop import driver
from scenario_gen.closed_loop.driver import DriverParameters
from scenario_gen.numerics.kernel_cache import OPTIONS
from scenario_gen.numerics.numba_import import numba

# Only kernels can call these helpers.
following_acceleration = numba.jit(driver.following_acceleration.py_func, **OPTIONS)
approach_acceleration = numba.jit(driver.approach_acceleration.py_func, **OPTIONS)

A, B, T, S0 = 1.4, 2.2, 1.3, 2.0  # m/s², m/s², s, m
DRIVER = DriverParameters(
    np.array([T]), S0, np.array([A]), np.array([B]), np.array([9.0]), 4.0,
    np.array([5.0]), np.array([1.0]), 3.0, True, True, np.array([0]),
)  # fmt: skip


def desired_gap(speed, leader):
    return S0 + speed * T + speed * (speed - leader) / (2.0 * (A * B) ** 0.5)


@pytest.mark.parametrize(("speed", "leader"), [(3.0, 3.0), (12.0, 12.0), (12.0, 10.0), (9.0, 9.5)])
@pytest.mark.parametrize("ratio", [0.8, 1.0, 1.25, 2.0, 5.0])
def test_acceleration_falls_with_squared_gap(speed, leader, ratio):
    gap = ratio * desired_gap(speed, leader)
    expected = A - A / ratio**2
    assert following_acceleration(DRIVER, 0, gap, speed, leader, 0.0) == pytest.approx(expected)


def test_faster_leader_leaves_standstill_gap():
    assert desired_gap(5.0, 30.0) < S0
    assert following_acceleration(DRIVER, 0, S0, 5.0, 30.0, 0.0) == pytest.approx(0.0)


@pytest.mark.parametrize("leader", [0.0, 4.0])
@pytest.mark.parametrize("braking", [1.0, 6.0])
def test_braking_is_comfortable_or_just_stops(leader, braking):
    speed = 12.0
    assert following_acceleration(DRIVER, 0, 60.0, speed, leader, braking) == pytest.approx(
        max(-B, A - A * (desired_gap(speed, leader) / 60.0) ** 2)
    )
    needed = 5.0
    # The leader needs v² / 2b to stop; the driver's foot, which takes .4 s, costs speed × .4 s.
    gap = speed**2 / (2.0 * needed) - leader**2 / (2.0 * max(braking, B)) + 0.4 * speed
    bound = following_acceleration(DRIVER, 0, gap, speed, leader, braking)
    assert bound == pytest.approx(-1.25 * needed)


@pytest.mark.parametrize(("way", "speed", "wait"), [(10.0, 6.0, 2.0), (10.0, 6.0, 2.5)])
def test_place_is_reached_after_its_wait(way, speed, wait):
    acceleration = approach_acceleration(DRIVER, 0, way, speed, wait)
    assert speed * wait + 0.5 * acceleration * wait**2 == pytest.approx(way)


def test_stop_needs_the_whole_way():
    acceleration = approach_acceleration(DRIVER, 0, 10.0, 6.0, 60.0)
    assert acceleration == pytest.approx(-(6.0**2) / (2.0 * 10.0))
