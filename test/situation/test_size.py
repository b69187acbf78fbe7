# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Encounters that are too large are refused at once, with what would fit."""

import numpy as np
import pytest
from support.motions import encounter_of

from scenario_gen.base.errors import RefusedError
from scenario_gen.pipeline import generate, PipelineConfig
from scenario_gen.situation.size import refuse_reversing, refuse_too_large


def standing(count, seconds):
    return encounter_of(np.zeros((count, round(seconds / 0.1) + 1, 2)), speed=0.0)


def test_too_many_vehicle_seconds_are_refused():
    encounter = standing(30, 1000.0)
    with pytest.raises(RefusedError) as caught:
        generate(encounter, "no such road", PipelineConfig(), count=10, seed=0)
    said = str(caught.value)
    assert "--set log.max_duration=133" in said and "--set log.max_vehicles=4" in said
    for count, seconds in ((30, 133.0), (4, 1000.0), (64, 60.0)):
        refuse_too_large(standing(count, seconds))
    with pytest.raises(RefusedError, match=r"log\.max_vehicles=64"):
        refuse_too_large(standing(65, 10.0))


def driving(offset=0.0, jump=0.0, samples=100, period_ns=100_000_000):
    """Two vehicles side by side; the second one's positions are off by `offset` [m], and one of them by `jump`."""
    position = np.zeros((2, samples, 2))
    position[..., 0] = np.arange(samples) * period_ns * 1e-8  # at 10 m/s
    position[1, :, 1] = 4.0 + offset
    position[1, samples // 2, 1] += jump
    return encounter_of(position, dt=period_ns * 1e-9)


@pytest.mark.parametrize("metres", [1e4, 1e7, -1e7])
def test_impossible_places_are_refused(metres):
    with pytest.raises(
        RefusedError, match=r"vehicle \w is never nearer than .* m to another, 2000 m are possible"
    ):
        refuse_too_large(driving(offset=metres))
    with pytest.raises(
        RefusedError,
        match=r"positions of vehicle 2 are up to .* m apart while its speeds add up to 100 m",
    ):
        refuse_too_large(driving(jump=metres))
    refuse_too_large(driving(offset=1900.0))
    refuse_too_large(driving(jump=1900.0))


def test_too_many_samples_are_refused():
    with pytest.raises(
        RefusedError,
        match=r"a sample every 0.001 s have 200000 samples, 45000 are possible.*log\.period=0\.1",
    ):
        refuse_too_large(driving(samples=100_000, period_ns=1_000_000))
    refuse_too_large(driving(samples=20_000, period_ns=50_000_000))


@pytest.mark.parametrize("frame", [0.0, 2.2, -1.6])
@pytest.mark.parametrize("metres", [1.9, 2.1])
def test_driving_backwards_is_refused(frame, metres):
    """Whatever its direction; and when it began is said."""
    along = np.interp(np.arange(100) * 0.1, [0.0, 4.0, 7.0, 9.9], [0.0, 20.0, 20.0 - metres, 30.0])
    ahead = np.array([np.cos(frame), np.sin(frame)])
    position = along[None, :, None] * ahead
    made = encounter_of(np.concatenate([position, position + 9.0]), frame, 5.0)
    if metres < 2.0:
        refuse_reversing(made)
        return
    with pytest.raises(RefusedError, match=f"drives backwards for {metres} m, from 4.0 s on"):
        refuse_reversing(made)
