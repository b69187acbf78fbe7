# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The layout of the standard normal numbers: each slice moves what its name says, and only that."""

from dataclasses import replace

import numpy as np
import pytest
from support.sampling_scenes import scene_plan

from scenario_gen.method.sampling import SamplingConfig
from scenario_gen.method.sampling.build_model import build_model
from scenario_gen.method.sampling.candidates import CandidateModel
from scenario_gen.method.sampling.numbers import ModelNumbers, VehicleNumbers
from scenario_gen.method.sampling.variation import relaxed_states
from scenario_gen.method.sampling.vehicle_model import NoiseScale
from scenario_gen.types import FOLLOW, Reaction, ReactionGraph, Request

EDGE = Reaction(FOLLOW, 1, 0, 1.0, 0.8, 0.5, 1.0, 2.0, 18.0, (1.0, 1.5, 2.0))


@pytest.fixture(scope="module")
def model():
    """Vehicle 1 follows vehicle 0; all that preset `wide` varies is free."""
    plan, config = scene_plan(), SamplingConfig(strength_sigma=0.4)
    states = relaxed_states(plan.requested, plan.situation, config, Request())
    built = build_model(replace(plan, requested=states), config).model
    return CandidateModel(built.vehicles, built.warp, ReactionGraph((EDGE,), (0, 1, 2)))


def test_the_slices_are_consecutive_and_complete():
    vehicle = VehicleNumbers.of(3, 5, 2)
    assert [part.stop - part.start for part in vehicle] == [3, 5, 2, 1, 2, 1, 0]
    assert VehicleNumbers.of(3, 5, 2, 2).strength == slice(14, 16)
    assert [part.start for part in vehicle[1:]] == [part.stop for part in vehicle[:-1]]
    assert vehicle.total == 14 and VehicleNumbers.of(3, 5, None).total == 8
    whole = ModelNumbers.of(4, [vehicle, vehicle], 2)
    assert whole.vehicles == (slice(4, 18), slice(18, 32)) and whole.total == 34


@pytest.mark.parametrize("name", VehicleNumbers._fields)
def test_each_slice_moves_its_namesake(model, name):
    vehicle, nominal = model.vehicles[0], model.warp.nominal
    z = np.zeros((2, vehicle.numbers.total))
    z[1, getattr(vehicle.numbers, name)] = 1.5
    shared = model.warp.sample(np.zeros((2, model.warp.count)), 1.0)
    samples = vehicle.sample(z, NoiseScale(), shared, nominal)
    moved = {
        "clock": np.ptp(samples.clock.time, axis=0).max() > 1e-6,
        "path": np.ptp(samples.paths.curve, axis=0).max() > 1e-6,
        "speed": np.ptp(samples.speeds.coefficients, axis=0).max() > 1e-6,
        "size": samples.vehicles[0] != samples.vehicles[1],
    }
    names = {"lateral": "path", "place": "path", "end_speeds": "speed", "strength": "speed"}
    expected = names.get(name, name)
    assert moved[expected]
    assert not any(value for key, value in moved.items() if key not in (expected, "speed"))
