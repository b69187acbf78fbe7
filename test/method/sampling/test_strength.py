# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A stronger driver brakes and accelerates in a shorter time, and arrives as the recorded one."""

import numpy as np
import pytest

from scenario_gen.method.sampling.speed_profile.model import Strength
from scenario_gen.method.sampling.speed_profile.spline import SpeedSpline

TIME = np.linspace(0.0, 20.0, 401)


def slowing():
    """From 10 to 5 m/s about 7 s, back to 9 m/s about 14 s."""
    ramp = 0.5 * (1.0 + np.tanh((TIME - 7.0) / 1.2)), 0.5 * (1.0 + np.tanh((TIME - 14.0) / 1.2))
    return SpeedSpline.over(0.0, 20.0, []), 10.0 - 5.0 * ramp[0] + 4.0 * ramp[1]


def strength_of(spline, speed):
    mean = np.linalg.lstsq(spline.design(TIME), speed, rcond=None)[0]
    mean[spline.still] = 0.0
    longer = np.where(spline.still, 0.0, 1.0)
    return mean, Strength.of(spline, mean, longer / (spline.length @ longer))


@pytest.mark.parametrize("factor", [0.7, 1.2, 1.4])
def test_strength_scales_braking_only(factor):
    spline, speed = slowing()
    mean, strength = strength_of(spline, speed)
    other = mean + strength.changes(np.log([[factor, 1.0]]))[0]
    before, after = ((spline.design(TIME, 1) @ c)[TIME < 10.5].min() for c in (mean, other))
    assert after / before == pytest.approx(factor, rel=0.08)
    assert (other - mean)[[0, -1]] == pytest.approx(0.0, abs=1e-3)
    outside = (TIME < 2.0) | (TIME > 12.0)
    assert (spline.driven(TIME) @ (other - mean))[outside] == pytest.approx(0.0, abs=0.05)
    unchanged = (spline.design(TIME) @ (other - mean))[TIME > 12.0]
    assert unchanged == pytest.approx(0.0, abs=0.05)


def test_strength_is_that_of_drivers():
    spline, speed = slowing()
    mean, strength = strength_of(spline, speed)
    strong = mean + strength.changes(np.log([[2.2, 2.2]]))[0]
    acceleration = spline.design(TIME, 1) @ strong
    assert -3.3 < acceleration.min() < -2.6 and 1.7 < acceleration.max() < 2.3


def test_stands_and_ends_stay():
    spline = SpeedSpline.over(0.0, 20.0, [(8.0, 12.0)])
    speed = np.interp(TIME, [0.0, 4.0, 8.0, 12.0, 16.0, 20.0], [8.0, 8.0, 0.0, 0.0, 6.0, 7.0])
    mean, strength = strength_of(spline, speed)
    for factor in (0.5, 0.8, 1.5, 2.0):
        other = mean + strength.changes(np.log([[factor, factor]]))[0]
        assert (other[spline.still] == 0.0).all()
        assert other.min() > -0.2
        assert other @ spline.length == pytest.approx(mean @ spline.length)
    standing = SpeedSpline.over(0.0, 20.0, [(0.0, 20.0)])
    assert not Strength.of(standing, np.zeros(standing.size), np.zeros(standing.size)).change.any()
