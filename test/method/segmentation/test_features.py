# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Single outliers are left out of an encounter; nothing else is touched."""

from dataclasses import replace

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np

from scenario_gen.method.segmentation import segment
from scenario_gen.method.segmentation.features import without_outliers, without_spikes


@settings(max_examples=30)
@given(at=st.integers(2, 57), size=st.floats(5.0, 1e6), seed=st.integers(0, 1000))
def test_spike_is_replaced(at, size, seed):
    smooth = (
        np.cumsum(np.random.default_rng(seed).normal(size=(60, 2)) * 0.01, axis=0)
        + np.arange(60.0)[:, None]
    )
    values = smooth.copy()
    values[at] += size
    np.testing.assert_allclose(
        without_spikes(values, 0.5)[at], (smooth[at - 1] + smooth[at + 1]) / 2.0, atol=0.1
    )
    np.testing.assert_array_equal(
        np.delete(without_spikes(values, 0.5), at, axis=0), np.delete(smooth, at, axis=0)
    )


@given(st.integers(0, 1000))
def test_a_drive_stays_as_it_is(seed):
    """Hard braking, from 10 m/s at 8 m/s², and a turn are no spikes."""
    rng = np.random.default_rng(seed)
    speed = np.maximum(10.0 - 8.0 * np.maximum(np.arange(80) * 0.1 - 3.0, 0.0), 0.0)
    heading = np.cumsum(0.04 * speed * 0.1 * 2.0)
    position = np.cumsum(
        0.1 * speed[:, None] * np.column_stack([np.cos(heading), np.sin(heading)]), axis=0
    )
    noisy = position + rng.uniform(-0.1, 0.1, size=position.shape)
    np.testing.assert_array_equal(without_spikes(noisy, 0.5), noisy)
    np.testing.assert_array_equal(without_spikes(speed[:, None], 0.5), speed[:, None])


def test_outliers_change_no_changepoint(encounter_of):
    time = np.arange(100) * 0.1
    encounter = encounter_of(
        np.array([5.0 + np.minimum(time, 5.0), 12.0 - 1.5 * np.maximum(time - 5.0, 0.0)]),
        noise=0.05,
    )
    position, speed = encounter.position.copy(), encounter.speed.copy()
    position[0, 30] += 40.0
    speed[1, [20, 60]] += 15.0
    spoilt = replace(encounter, position=position, speed=speed)
    assert np.abs(without_outliers(spoilt).position - encounter.position).max() < 0.3
    points = segment(encounter).changepoints
    assert len(points)
    assert np.abs(segment(spoilt).changepoints - points).max() <= 3
