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
from scenario_gen.types import Encounter, Motion, Vehicle


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


def test_steady_drive_is_one_primitive(encounter_of):
    found = segment(encounter_of(np.full((2, 200), 10.0), noise=0.1))
    assert found.n_primitives == 1
    assert "drives at 10.0 m/s" in found.descriptions[0]


@pytest.mark.parametrize("preset", ["driving", "paper"])
@pytest.mark.parametrize("samples", [4, 7, 30, 200])
def test_short_encounters(encounter_of, preset, samples):
    rng = np.random.default_rng(samples)
    found = segment(
        encounter_of(np.abs(rng.normal(5.0, 2.0, (3, samples)))), SegmentationConfig(preset=preset)
    )
    assert found.labels.shape == (samples,)


def test_too_short(encounter_of):
    with pytest.raises(InputError, match="at least 4 samples"):
        segment(encounter_of(np.ones((2, 3))))


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


def test_one_vehicle_is_no_encounter(encounter_of):
    with pytest.raises(InputError, match="1 vehicle"):
        segment(encounter_of(np.full((1, 200), 8.0)))


@pytest.mark.parametrize("preset", ["driving", "paper"])
def test_nothing_moves(encounter_of, preset):
    found = segment(encounter_of(np.zeros((2, 60))), SegmentationConfig(preset=preset))
    assert found.n_primitives == 1
    assert np.isfinite(found.changepoint_probability).all()


@pytest.mark.parametrize("field", ["position", "speed"])
def test_not_a_number(encounter_of, field):
    encounter = wait_and_brake(encounter_of)
    values = np.array(getattr(encounter, field))
    values[1, 20] = np.nan
    with pytest.raises(InputError):
        segment(replace(encounter, **{field: values}))


@pytest.mark.parametrize("preset", ["driving", "paper"])
@pytest.mark.parametrize("shortest", [0.2, 1.5])
def test_short_segments_and_small_clusters_are_merged(encounter_of, preset, shortest):
    rng = np.random.default_rng(5)
    speeds = np.abs(np.cumsum(rng.standard_t(2, (2, 150)), axis=1)) * 0.3
    found = segment(
        encounter_of(speeds, noise=0.2),
        SegmentationConfig(preset=preset, min_segment=shortest, max_rate=10.0),
    )
    lengths = np.diff([0, *found.changepoints, 150])
    assert lengths.min() >= round(shortest / 0.1)
    assert np.bincount(found.labels).min() >= 2


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
def test_a_track_that_cannot_be_used_is_refused(position, speed, dt):
    with pytest.raises(InputError):
        segment_track(position, speed, dt)


def test_a_vehicle_that_comes_and_goes_makes_no_changepoint(encounter_of):
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


@pytest.mark.parametrize("preset", ["driving", "paper"])
def test_what_is_held_outside_of_a_presence_does_not_count(encounter_of, preset):
    whole = encounter_of(
        np.array([np.full(80, 8.0), np.linspace(8.0, 4.0, 80), np.full(80, 5.0)]), noise=0.05
    )
    found = segment(
        replace(whole, present=np.array([[0, 79], [0, 40], [41, 79]])),
        SegmentationConfig(preset=preset),
        seed=2,
    )
    assert "has left" in found.descriptions[-1] or len(found.descriptions) == 1
    assert np.isfinite(found.changepoint_probability).all()


def test_steps_of_a_pedestrian_are_no_changepoints_and_its_halt_is_seen():
    """At 1.3 ± 0.15 m/s in each step; one halts for 3 s and goes on within a step."""
    time, rng = np.arange(0.0, 16.0, 0.1), np.random.default_rng(4)
    steady = 1.3 + 0.15 * np.sin(2.0 * np.pi * 1.9 * time) + rng.normal(0.0, 0.03, len(time))
    halts = np.where((time > 6.0) & (time < 9.0), 0.0, steady)
    for speed, changes in ((steady, []), (halts, [6.0, 9.0])):
        position = np.stack([np.cumsum(speed) * 0.1, 0.0 * time], axis=1)
        walker, heading = Vehicle("p", 0.5, 0.5, "pedestrian"), 0.0 * speed[None]
        alone = Motion.sampled((walker,), 0.1, position[None], heading, speed[None])
        found = segment(alone, seed=1)
        assert all(min(abs(0.1 * found.changepoints - change)) < 0.5 for change in changes)
        assert len(changes) <= len(found.changepoints) <= 2 * len(changes)
    assert (
        any("stands" in words for words in found.descriptions)
        and "walks at 1.3 m/s" in found.descriptions[0]
    )
