# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Changepoints while samples arrive."""

import numpy as np
import pytest

from scenario_gen.base.errors import InputError
from scenario_gen.method.segmentation import OnlineConfig, OnlineSegmenter


def found_in(encounter):
    online = OnlineSegmenter(len(encounter.vehicles), encounter.dt)
    return [
        c
        for t in range(len(encounter.time))
        for c in online.push(encounter.position[:, t], encounter.speed[:, t])
    ]


def test_finds_changes_soon_after_them(encounter_of):
    t = np.arange(400) * 0.1
    speeds = np.array(
        [np.full(400, 8.0), np.interp(t, [0, 10, 15, 25, 30, 40], [10, 10, 2, 2, 12, 12])]
    )
    found = found_in(encounter_of(speeds, noise=0.1, seed=3))
    assert [round(c.sample / 50) * 50 for c in found] == [100, 150, 250, 300]
    assert (
        max(abs(c.sample - truth) for c, truth in zip(found, [100, 150, 250, 300], strict=True))
        <= 4
    )
    assert (
        max(c.confirmed - truth for c, truth in zip(found, [100, 150, 250, 300], strict=True))
        <= 15
    )


def test_steady_noise_gives_nothing(encounter_of):
    assert found_in(encounter_of(np.full((3, 600), 9.0), noise=0.1, seed=4)) == []


def test_memory_is_bounded():
    online = OnlineSegmenter(2, 0.1)
    for t in range(700):
        online.push(np.array([[t * 0.8, 0.0], [0.0, 5.0]]), np.array([8.0, 0.0]))
    assert len(online._samples) <= 300


@pytest.mark.parametrize(
    "bad", [(np.zeros((2, 2)), np.array([1.0, np.nan])), (np.zeros((3, 2)), np.zeros(3))]
)
def test_refuses_bad_samples(bad):
    with pytest.raises(InputError, match="sample 0"):
        OnlineSegmenter(2, 0.1).push(*bad)


def drive(behaviours, seed=1, seconds=5.0):
    """A vehicle that cruises (0), brakes (1), accelerates (2) or turns left (3)."""
    rng = np.random.default_rng(seed)
    true = np.repeat(behaviours, round(seconds * 10))
    speed = 12.0 + np.cumsum(np.array([0.0, -1.5, 1.5, 0.0])[true]) * 0.1
    heading = np.cumsum(np.array([0.0, 0.0, 0.0, 0.25])[true]) * 0.1
    position = np.cumsum(
        np.column_stack([speed * np.cos(heading), speed * np.sin(heading)]) * 0.1, axis=0
    )
    return position + rng.normal(size=position.shape) * 0.1, speed + rng.normal(
        size=len(speed)
    ) * 0.1


def pushed(position, speed, **options):
    online = OnlineSegmenter(1, 0.1, **options)
    return [
        c
        for xy, v in zip(position, speed, strict=True)
        for c in online.push(xy[None], np.array([v]))
    ]


def test_single_outliers_change_nothing():
    position, speed = drive([0, 1, 0, 2, 0, 1, 0, 3, 0, 3, 0, 2, 0])
    clean = pushed(position, speed)
    wild, fast = position.copy(), speed.copy()
    wild[13::97] += [500.0, -200.0]
    fast[60::83] += 40.0
    found = pushed(wild, fast)
    assert len(found) == len(clean)
    assert max(abs(a.sample - b.sample) for a, b in zip(found, clean, strict=True)) <= 3


def test_probability_rises_with_the_change():
    """Changes of acceleration by 0.1 to 1.5 m/s², at a level that noise reaches, too."""
    least = {}
    for change in (0.1, 0.2, 1.5):
        speed = 12.0 + np.where(np.arange(300) < 150, 0.0, (np.arange(300) - 150) * 0.1 * change)
        rng = np.random.default_rng(3)
        position = (
            np.column_stack([np.cumsum(speed) * 0.1, np.zeros(300)])
            + rng.normal(size=(300, 2)) * 0.1
        )
        found = pushed(
            position,
            speed + rng.normal(size=300) * 0.1,
            config=OnlineConfig(significance_level=0.05),
        )
        near = [c.probability for c in found if abs(c.sample - 150) <= 15]
        least[change] = max(near, default=0.0)
    assert least[0.1] < least[0.2] < least[1.5]
    assert least[0.1] < 0.9
    assert least[1.5] > 0.999
