# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The small corrections of a driver: found in a recorded drive, and drawn again."""

import numpy as np
import pytest

from scenario_gen.method.sampling.deviations import Steering

TIME = 0.1 * np.arange(1201)


def drive(sigma, length, speed, course=0.0):
    """Yaw of a drive whose place across the road is a process with these parameters [m, s], at speeds (T,) [m/s]."""
    rng = np.random.default_rng(3)
    wave = rng.normal(
        0.0, 1.0 / length, 400
    )  # of a squared-exponential kernel: random Fourier features
    phase = rng.uniform(0.0, 2.0 * np.pi, 400)
    sideways = (
        sigma * np.sqrt(2.0 / 400) * (-wave * np.sin(wave * TIME[:, None] + phase)).sum(axis=1)
    )
    return course + sideways / speed


@pytest.mark.parametrize("speed", [5.0, 15.0])
def test_drawn_steering_is_found(speed):
    speeds = np.full(len(TIME), speed)
    found = Steering.of(TIME, drive(0.03, 0.6, speeds), speeds, 100.0)
    assert found.length == pytest.approx(0.6, rel=0.35)
    assert found.sigma == pytest.approx(
        0.03, rel=0.6
    )  # what is slower than some seconds counts as course


def test_a_turn_is_course_not_correction():
    speeds = np.full(len(TIME), 8.0)
    straight = Steering.of(TIME, drive(0.03, 0.6, speeds), speeds, 100.0)
    turning = Steering.of(
        TIME, drive(0.03, 0.6, speeds, np.clip((TIME - 50.0) / 3.0, 0.0, np.pi / 2)), speeds, 100.0
    )
    assert turning.sigma == pytest.approx(straight.sigma, rel=0.2)


@pytest.mark.parametrize("yaw", [np.zeros(len(TIME)), 0.01 * TIME])
def test_perfect_steering_has_no_deviation(yaw):
    assert Steering.of(TIME, yaw, np.full(len(TIME), 8.0), 100.0).root(
        np.linspace(0.0, 100.0, 101)
    ).shape == (101, 0)


def test_who_stands_has_none():
    assert (
        Steering.of(TIME, drive(0.03, 0.6, np.ones(len(TIME))), np.zeros(len(TIME)), 0.0).sigma
        == 0.0
    )


def test_steering_has_its_stated_strength():
    speeds = np.full(len(TIME), 8.0)
    found = Steering.of(TIME, drive(0.03, 0.6, speeds), speeds, 960.0)
    root = found.root(np.linspace(0.0, 960.0, 961))
    spread = np.sqrt(np.square(root).sum(axis=1))
    assert spread[400:500] == pytest.approx(found.sigma, rel=0.02)
    assert spread[[0, -1]].max() < 1e-6
