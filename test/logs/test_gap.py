# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The gap of two motions in place and time, at the speeds and time gaps of roads."""

import numpy as np
import pytest

from scenario_gen.logs.gap import space_time_gap

DT = 0.1
TIME = DT * np.arange(120)


def drive(random):
    """Steady driving along a straight line or an arc, near the middle at 6 s."""
    speed = random.uniform(0.0, 40.0)
    heading = random.uniform(-3.0, 3.0) + random.uniform(-0.3, 0.3) / max(speed / 10.0, 1.0) * (
        TIME - 6.0
    )
    way = np.cumsum(DT * speed * np.column_stack([np.cos(heading), np.sin(heading)]), axis=0)
    return way - way[60] + random.uniform(-20.0, 20.0, 2)


def by_all_pairs(a, b):
    """The gap by comparing all pairs of moments, 5 ms apart."""
    fine = np.linspace(0.0, TIME[-1], 20 * (len(TIME) - 1) + 1)
    p, q = (np.column_stack([np.interp(fine, TIME, way[:, k]) for k in (0, 1)]) for way in (a, b))
    return min(
        float((np.hypot(*(p[k] - q).T) + 2.0 * np.abs(fine[k] - fine)).min())
        for k in range(len(fine))
    )


@pytest.mark.parametrize("seed", range(3))
def test_follower_has_twice_its_time_gap(seed):
    random = np.random.default_rng(seed)
    for _ in range(100):
        speed = random.uniform(10.0, 40.0)
        behind = random.uniform(0.5, 3.0)
        turned = random.uniform(-3.0, 3.0)
        along = np.array([np.cos(turned), np.sin(turned)])
        a, b = speed * TIME[:, None] * along, speed * (TIME[:, None] - behind) * along
        for one, other in ((a, b), (b, a)):
            gap, i, j = space_time_gap(one, other, DT)
            assert gap == pytest.approx(2.0 * behind, abs=1e-6)
            assert abs(i - j) * DT == pytest.approx(behind, abs=0.11)


@pytest.mark.parametrize("seed", range(2))
def test_gap_is_least_of_all_moments(seed):
    random = np.random.default_rng(seed)
    for _ in range(12):
        a, b = drive(random), drive(random)
        gap = space_time_gap(a, b, DT)[0]
        assert gap == pytest.approx(by_all_pairs(a, b), abs=0.25)
        assert gap == pytest.approx(space_time_gap(b, a, DT)[0], abs=0.1)


def test_passing_vehicles_have_their_lateral_gap():
    a = np.column_stack([20.0 * (TIME - 6.0), 0.0 * TIME])
    b = np.column_stack([-20.0 * (TIME - 6.0), 3.5 + 0.0 * TIME])
    assert space_time_gap(a, b, DT) == (pytest.approx(3.5, abs=1e-3), 60, 60)
    assert space_time_gap(a, a, DT)[0] == 0.0
