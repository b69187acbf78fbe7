# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The speed profile: exact lengths, given end speeds, limits kept, waits still, no ringing."""

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from benchmarks._paper_speed_knots import speed_knots
from benchmarks._paper_speed_profile import SpeedProfile, SpeedProfileQP
from scenario_gen.types import Dynamics

TIME = np.arange(201) * 0.1
CLOCK = np.array([0.0, 6.0, 9.0, 14.0, 20.0])
NO_DWELL = np.zeros(4, dtype=bool)


def dip(depth=6.0):
    return 10.0 - depth * np.exp(-(((TIME - 10.0) / 3.0) ** 2))


def driven(speed, clock=CLOCK):
    profile = SpeedProfile(TIME, speed)
    return np.diff(profile.state(clock)[0])


@settings(max_examples=20)
@given(
    st.lists(st.floats(0.85, 1.15), min_size=4, max_size=4),
    st.floats(0.0, 9.0),
    st.floats(8.0, 11.0),
)
def test_lengths_ends_and_limits_hold(factors, depth, first):
    template, limits = dip(depth), Dynamics().planned
    knots = speed_knots(CLOCK, NO_DWELL, [], TIME, template, (first, 10.0))
    lengths = driven(template) * np.array(factors)
    speed, ok = SpeedProfileQP(knots, limits).solve(knots.knot[None], lengths[None])
    if not ok[0]:
        return
    profile = SpeedProfile(knots.knot, speed[0])
    assert np.diff(profile.state(CLOCK)[0]) == pytest.approx(lengths, abs=1e-5)
    assert (speed[0][[0, -1]] == [first, 10.0]).all()
    acceleration = np.diff(speed[0]) / np.diff(knots.knot)
    assert (speed[0] >= 0.0).all()
    assert acceleration.max() <= limits.max_acceleration + 1e-5
    assert acceleration.min() >= -limits.max_deceleration - 1e-5


def test_wait_inside_a_primitive_stands_exactly():
    template = np.interp(TIME, [0.0, 5.0, 7.4, 15.3, 18.0, 20.0], [6.0, 6.0, 0.0, 0.0, 6.0, 6.0])
    knots = speed_knots(
        CLOCK, np.array([False, False, True, False]), [(7.4, 15.3)], TIME, template, (6.0, 6.0)
    )
    lengths = np.array([[35.0, 3.0, 20.5]])
    speed, ok = SpeedProfileQP(knots, Dynamics().planned).solve(knots.knot[None], lengths)
    assert ok[0]
    profile = SpeedProfile(knots.knot, speed[0])
    at, v, _ = profile.state(np.linspace(7.4, 15.3, 80))
    assert (v == 0.0).all()
    assert np.ptp(at) == 0.0
    assert profile.state(CLOCK)[0] == pytest.approx([0.0, 35.0, 38.0, 38.0, 58.5], abs=1e-5)
