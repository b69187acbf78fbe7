# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Preset `wide`: own clocks, waits, places, end speeds, sizes, and who drives on behind its route."""

from dataclasses import replace

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from support.sampling_scenes import scene_plan

from scenario_gen.method.sampling import SamplingConfig
from scenario_gen.method.sampling.build_model import build_model
from scenario_gen.method.sampling.candidates import (
    ACCELERATION_DECAY_S,
    extrapolate,
    extrapolation_time,
)
from scenario_gen.method.sampling.stage import draw_scenarios
from scenario_gen.method.sampling.time_warp import clock_from_rate
from scenario_gen.method.sampling.variation import (
    CAR_SIZES,
    relaxed_states,
    truncate,
    Variation,
    VehicleClock,
)
from scenario_gen.method.sampling.vehicle_model import NoiseScale
from scenario_gen.method.validity import Checker, Limits
from scenario_gen.situation import Situation
from scenario_gen.types import Vehicle
from scenario_gen.types.request import Request
from scenario_gen.types.scenario import BoundaryStates

GRID = 0.1 * np.arange(201)
NOMINAL = clock_from_rate(GRID, np.ones(201))


def normal(count, size, seed=0):
    return np.random.default_rng(seed).standard_normal((count, size))


def relaxed_plan(config=SamplingConfig(), request=Request()):
    """The scene with the states that preset `wide` relaxes."""
    plan = scene_plan()
    states = relaxed_states(plan.requested, plan.situation, config, request)
    return replace(plan, requested=states)


def batch(count=300, **parameters):
    config = SamplingConfig(**parameters)
    model = build_model(relaxed_plan(config), config).model
    return model, model.draw(normal(count, model.size), NoiseScale())


def arrivals(b):
    """Own time [s] of each vehicle (S, N) at the middle of its route, less the mean over vehicles."""
    middle = np.stack([one.clock.time[:, 50] for one in b.samples], axis=1)
    return middle - middle.mean(axis=1, keepdims=True)


def stand(b):
    """How long vehicle 1 waits [s]."""
    time = b.samples[1].clock.time
    return time[:, 130] - time[:, 70]


@pytest.mark.parametrize(
    ("name", "measure"),
    [
        ("arrival_sigma", lambda b: arrivals(b).std()),
        ("pace_sigma", lambda b: (b.samples[0].clock.rate / b.samples[1].clock.rate)[:, 20].std()),
        ("wait_sigma", lambda b: stand(b).std()),
        ("end_speed_sigma", lambda b: b.extension.states[0, :, 0, 3].std()),
        ("place_sigma", lambda b: b.samples[0].paths.curve[:, 0, 1].std()),
    ],
)
def test_each_freedom_has_its_monotone_effect(name, measure):
    others = dict.fromkeys(
        (
            "arrival_sigma",
            "pace_sigma",
            "wait_sigma",
            "end_speed_sigma",
            "place_sigma",
            "time_sigma",
        ),
        0.0,
    )
    largest = {"pace_sigma": 0.08, "end_speed_sigma": 0.8, "place_sigma": 0.4}.get(name, 1.6)
    found = [measure(batch(**(others | {name: share * largest}))[1]) for share in (0.0, 0.4, 1.0)]
    assert (np.diff(found) > 0.0).all(), found
    assert found[0] == pytest.approx(0.0, abs=1e-9)


@settings(max_examples=30)
@given(
    st.lists(st.floats(-4.0, 4.0), min_size=3, max_size=3),
    st.booleans(),
    st.booleans(),
    st.floats(0.1, 3.0),
    st.floats(0.0, 0.2),
)
def test_own_clocks_stay_within_bounds(z, start, end, shift, pace):
    config = replace(SamplingConfig(), arrival_sigma=shift, pace_sigma=pace)
    own = VehicleClock.of(NOMINAL, [(7.0, 13.0)], (start, end), config, (), Limits())
    clock = own.sample(
        np.array([z]),
        1.0,
        replace(NOMINAL, time=NOMINAL.time[None], rate=NOMINAL.rate[None]),
        NOMINAL,
    )
    waits = (GRID > 6.9) & (GRID < 13.1)
    assert clock.rate[0, ~waits].min() > 0.7
    assert clock.rate[0, ~waits].max() < 1.4
    assert clock.rate.min() > 0.0
    if start:
        assert clock.time[0, 0] == pytest.approx(0.0, abs=1e-9)
    if end:
        assert clock.time[0, -1] == pytest.approx(GRID[-1], abs=1e-9), (
            "it makes up for a longer wait"
        )


def test_requested_and_relaxed_states_hold():
    x, y, yaw, speed = scene_plan().requested.start[0]
    request = Request(starts=f"a: {x} {y} {yaw} {speed}")
    plan = relaxed_plan(request=request)
    assert (plan.requested.relaxed[0, 0] == 0.0).all()
    assert (plan.requested.relaxed[0, 1] > 0.0).all()
    check = Checker(None, plan.requested, None, None).check
    made = draw_scenarios(plan, check, count=40, request=request)
    assert len(made.scenarios) == 40
    for scenario in made.scenarios:
        assert np.hypot(*(scenario.position[0, 0] - (x, y))) < 0.1
        assert abs(scenario.speed[0, 0] - speed) < 0.1
    ends = np.array([scenario.position[0, -1] for scenario in made.scenarios])
    assert np.ptp(ends[:, 0]) > 1.0  # its end is free


@pytest.mark.parametrize("sigma", [0.5, 2.0])
def test_free_ends_reach_slowest_clock(sigma):
    """What a vehicle at 5 m/s drives in twice its greatest delay at 0.75 times its pace."""
    zero = dict.fromkeys(("wait_sigma", "gap_sigma", "pace_sigma", "leave_out"), 0.0)
    zero |= dict.fromkeys(("place_sigma", "end_speed_sigma", "duration_tolerance"), 0.0)
    config = SamplingConfig(arrival_sigma=sigma, **zero)
    plan = scene_plan()
    encounter = replace(plan.encounter, speed=np.full(plan.encounter.speed.shape, 5.0))
    states = np.full((3, 4), 5.0)
    asked = relaxed_states(
        BoundaryStates(states, states), Situation.of(encounter), config, Request()
    )
    expected = config.scaled.freedom * 2.0 * config.scaled.arrival_sigma / 0.75 * 5.0
    np.testing.assert_allclose(asked.relaxed[:, :, 0], expected, atol=1e-3)


@pytest.mark.parametrize(
    ("gap", "longest"), [(np.inf, 4.96), (3.1, 4.46), (0.4, 4.05), (0.0, 3.6), (-0.3, 3.6)]
)
def test_close_vehicle_hardly_becomes_longer(gap, longest):
    car, arc, none = Vehicle("1", 4.0, 1.8), np.arange(20.0), np.zeros(2)
    clock = VehicleClock.of(NOMINAL, [], (False, False), SamplingConfig(), (), Limits())
    made = Variation.of(car, arc, clock, np.ones((2, 2)), none, gap, SamplingConfig())
    assert made.sizes[:, 0].max() == longest


def test_sizes_are_those_of_the_catalogue():
    model, some = batch(200)
    sizes = {(one.length, one.width) for one in some.samples[0].vehicles}
    assert (
        sizes
        == {tuple(size) for size in model.vehicles[0].variation.sizes.tolist()}
        <= {tuple(size) for size in CAR_SIZES.tolist()}
    )
    assert len(sizes) > 4
    assert {one.id for one in some.samples[0].vehicles} == {"a"}
    _, same = batch(20, sizes="recorded")
    assert {(one.length, one.width) for one in same.samples[0].vehicles} == {
        (model.vehicles[0].vehicle.length, model.vehicles[0].vehicle.width)
    }


@settings(max_examples=50)
@given(
    st.floats(2.0, 20.0),
    st.floats(-5.0, 4.0),
    st.floats(-0.15, 0.15),
    st.sampled_from([-1.0, 1.0]),
)
def test_who_drives_on_does_so_smoothly(speed, acceleration, bend, sign):
    state = np.array([[3.0, -2.0, 0.7, speed, acceleration]])
    if extrapolation_time(state, 100.0, sign)[0] == 0.0:
        assert sign * acceleration < 0.0  # it would stand
        return
    since = np.linspace(0.0, 3.0, 601)[None]
    found = extrapolate(state, np.array([bend]), since, sign)[0]
    assert found[0] == pytest.approx(state[0], abs=1e-9)
    assert (found[:, 3] > 0.0).all()
    step = np.hypot(*np.diff(found[:, :2], axis=0).T)
    assert step / 0.005 == pytest.approx(0.5 * (found[1:, 3] + found[:-1, 3]), rel=2e-3)
    assert np.diff(found[:, 3]) / 0.005 * sign == pytest.approx(
        0.5 * (found[1:, 4] + found[:-1, 4]), abs=0.02
    )
    heading = np.arctan2(*(sign * np.diff(found[:, :2], axis=0))[:, ::-1].T)
    assert np.abs(np.angle(np.exp(1j * (heading - found[1:, 2])))).max() < 0.02
    assert abs(found[1, 4] - found[0, 4]) < 1e-3 * abs(acceleration) + 1e-9  # no jolt
    assert np.abs(found[-1, 4]) < abs(acceleration) * np.exp(-2.0 / ACCELERATION_DECAY_S) + 1e-9


def test_cut_numbers_are_truncated_normal():
    values = truncate(normal(20_000, 1)[:, 0], 2.0)
    assert np.abs(values).max() <= 2.0
    assert values.std() == pytest.approx(
        0.8796, rel=0.02
    )  # of the standard normal truncated at two standard deviations
    assert (np.diff(truncate(np.linspace(-5.0, 5.0, 101), 2.0)) > 0.0).all()
