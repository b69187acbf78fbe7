# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Encounters into primitives: waits, speed changes, the rules of the result."""

from dataclasses import replace

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from support.lengths import LONG

from scenario_gen.base.errors import InputError
from scenario_gen.method.segmentation import segment, segment_track, SegmentationConfig
from scenario_gen.types import Encounter


def wait_and_brake(encounter_of) -> Encounter:
    """The paper's case (a): one stands; the other brakes to a stop, stands, pulls away."""
    t = np.arange(200) * 0.1
    other = np.interp(t, [0, 7, 11, 20], [10, 0, 0, 12])
    return encounter_of(np.array([np.zeros(200), other]), noise=0.05)


def test_paper_case_a(encounter_of):
    found, again = (segment(wait_and_brake(encounter_of), seed=1) for _ in range(2))
    assert found.labels.tobytes() == again.labels.tobytes()
    assert found.changepoint_probability.tobytes() == again.changepoint_probability.tobytes()
    assert len(found.changepoints) == 2
    assert np.abs(found.changepoints - [70, 110]).max() <= 5
    assert found.descriptions[0].startswith("vehicle 0 stands, vehicle 1 brakes to a stop from 10")
    assert found.descriptions[1] == "vehicle 0 stands, vehicle 1 stands"
    assert "vehicle 1 pulls away" in found.descriptions[2]


@settings(max_examples=100 if LONG else 8)
@given(
    st.integers(10, 120),
    st.integers(2, 4),
    st.integers(0, 10_000),
    st.sampled_from([0.1, 0.5, 2.0]),
)
def test_rules_of_the_result(encounter_of, samples, vehicles, seed, rate):
    rng = np.random.default_rng(seed)
    knots = np.linspace(0, samples, 6)
    speeds = np.array(
        [
            np.interp(np.arange(samples), knots, np.abs(rng.normal(4.0, 5.0, 6)))
            for _ in range(vehicles)
        ]
    )
    encounter = encounter_of(speeds, noise=0.1, seed=seed)
    found = segment(encounter, SegmentationConfig(max_rate=rate), seed=seed)
    points = found.changepoints
    assert len(points) <= encounter.duration * rate
    assert len(found.descriptions) == len(points) + 1
    np.testing.assert_array_equal(np.flatnonzero(np.diff(found.labels)) + 1, points)
    assert (np.diff([0, *points, samples]) >= 2).all()
    first = [int(np.flatnonzero(found.labels == k)[0]) for k in range(found.n_primitives)]
    assert first == sorted(first)


def lone_drive(seed=0):
    """Steady, braking to a stop, standing, pulling away into a left bend."""
    dt, rng = 0.1, np.random.default_rng(seed)
    acceleration = np.repeat([0.0, -1.5, 0.0, 1.5], [60, 67, 40, 60])
    turn = np.repeat([0.0, 0.0, 0.0, 0.2], [60, 67, 40, 60])
    speed = np.maximum(10.0 + np.cumsum(acceleration) * dt, 0.0)
    heading = np.cumsum(turn) * dt
    position = np.cumsum(
        np.column_stack([speed * np.cos(heading), speed * np.sin(heading)]) * dt, axis=0
    )
    return (
        position + rng.normal(size=position.shape) * 0.1,
        np.maximum(speed + rng.normal(size=len(speed)) * 0.1, 0.0),
        dt,
    )


def test_one_vehicle_alone_can_be_segmented():
    found = segment_track(*lone_drive(), seed=1)
    for truth in (60, 127, 167):
        assert np.abs(found.changepoints - truth).min() <= 5
    assert len(found.changepoints) <= 5
    assert any("brakes to a stop" in words for words in found.descriptions)
    assert any("turning left" in words for words in found.descriptions)


@pytest.mark.parametrize(
    ("position", "speed", "dt"),
    [
        (np.zeros((3, 2)), np.zeros(3), 0.1),
        (np.zeros((9, 3)), np.zeros(9), 0.1),
        (np.zeros((9, 2)), np.zeros(8), 0.1),
        (np.full((9, 2), np.nan), np.zeros(9), 0.1),
        (np.zeros((9, 2)), np.full(9, -1.0), 0.1),
        (np.zeros((9, 2)), np.zeros(9), 0.0),
    ],
)
def test_unusable_track_is_refused(position, speed, dt):
    with pytest.raises(InputError):
        segment_track(position, speed, dt)


def test_presence_makes_no_changepoint(encounter_of):
    t = np.arange(200) * 0.1
    speed = np.array(
        [np.interp(t, [0, 10, 20], [10, 10, 2]), np.full(200, 8.0), np.full(200, 12.0)]
    )
    found = segment(
        replace(
            encounter_of(speed, noise=0.05), present=np.array([[0, 199], [45, 199], [0, 150]])
        ),
        seed=1,
    )
    assert np.abs(found.changepoints - [100]).max() <= 5
    assert "vehicle 1 arrives after 4.5 s and drives at" in found.descriptions[0]
    assert found.descriptions[1].endswith("leaves after 5.0 s")
