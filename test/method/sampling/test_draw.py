# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Whole sets on hand-made routes: a straight crossed by a quarter turn, with a wait."""

from dataclasses import astuple, replace
import math
from types import SimpleNamespace

import numpy as np
import pytest
from support.sampling_scenes import CLOCK, route, scene_plan, TIME, turn

from benchmarks._paper_speed_profile import SpeedProfile
from scenario_gen.base.road_users import Dynamics, TypeLimits
from scenario_gen.method.sampling import Callbacks, SamplingConfig
from scenario_gen.method.sampling.build_model import build_model
from scenario_gen.method.sampling.filters import PILOT_CANDIDATES, ValidityFilter
from scenario_gen.method.sampling.plan import _placed_abreast
from scenario_gen.method.sampling.sampler import LEVEL_CANDIDATES, place_of
from scenario_gen.method.sampling.stage import draw_scenarios
from scenario_gen.method.sampling.vehicle_model import NoiseScale
from scenario_gen.method.validity import Checker
from scenario_gen.numerics.arrays import wrap_angle
from scenario_gen.situation import Abreast, find_waits, Situation, Wait
from scenario_gen.types import Loss, NoteKind, Vehicle
from scenario_gen.types.road import Road
from scenario_gen.types.scenario import BoundaryStates, Cause, Verdict, Violation

PLAIN = SamplingConfig(drivers=0.0, bend_acceleration=5.0)


def all_valid(scenarios, _=None):
    return [Verdict() for _ in scenarios]


def drawn(count=50, check=all_valid, config=None, seed=5):
    return draw_scenarios(scene_plan(), check, config or PLAIN, count=count, seed=seed)


def batch(samples=200, scale=None, **changes):
    model = build_model(scene_plan(120.0), replace(PLAIN, **changes)).model
    eps = np.random.default_rng(1).standard_normal((samples, model.size))
    return model, model.draw(eps, scale or NoiseScale())


@pytest.fixture(scope="module")
def fifty():
    return drawn()


def test_grid_and_duration(fifty):
    for s in fifty.scenarios:
        assert np.array_equal(s.time, np.round(np.arange(len(s.time)) * 0.1, 9))
        assert 18.0 - 1e-9 <= s.time[-1] <= 22.0 + 1e-9
    assert len({len(s.time) for s in fifty.scenarios}) > 5
    fixed = drawn(config=SamplingConfig(drivers=0.0, fixed_duration=True, bend_acceleration=5.0))
    assert {s.time[-1] for s in fixed.scenarios} == {20.0}


def test_standing_vehicles_are_refused(fifty):
    scenario = fifty.scenarios[0]
    distances = np.array([30.0, 30.0, 0.0])
    validity = ValidityFilter(all_valid, 0, 0.1, {}, distances, 5.0)
    halted = replace(scenario, speed=scenario.speed * [[1.0], [0.1], [1.0]])
    brief = replace(
        scenario,
        time=0.2 * scenario.time,
        speed=5.0 * scenario.speed,
        acceleration=25.0 * scenario.acceleration,
    )
    assert validity([scenario, halted, brief]) == [None, Cause.TOO_SHORT, Cause.TOO_SHORT]


def test_late_braking_is_refused(fifty):
    scenario = fifty.scenarios[0]
    validity = ValidityFilter(all_valid, 0, 0.1, max_end_braking=np.array([2.0, np.inf, 2.0]))
    early, late, led = (np.zeros_like(scenario.speed) for _ in range(3))
    early[0, -28:-26] = late[0, -2:] = led[1, -2:] = -2.5
    drives = [replace(scenario, acceleration=braking) for braking in (early, late, led)]
    assert validity(drives) == [None, Cause.LATE_BRAKING, None]


def test_asked_states(fifty):
    asked = scene_plan().requested
    for s in fifty.scenarios:
        for k, state in ((0, asked.start), (-1, asked.end)):
            assert s.position[:, k] == pytest.approx(state[:, :2], abs=1e-5)
            assert s.speed[:, k] == pytest.approx(state[:, 3], abs=1e-9)
            assert np.abs(wrap_angle(s.heading[:, k] - state[:, 2])).max() < 0.01


def test_waits_stand_exactly(fifty):
    for s in fifty.scenarios:
        standing = s.speed[1] < 0.1
        assert standing.sum() * 0.1 > 4.0
        exactly = s.speed[1] == 0.0
        assert np.ptp(s.position[1][exactly], axis=0).max() == 0.0
        assert np.ptp(s.heading[1][exactly]) == 0.0
        assert np.ptp(s.position[2], axis=0).max() == 0.0
        assert (s.speed[2] == 0.0).all()


def test_derivatives_agree(fifty):
    for s in fifty.scenarios[:10]:
        step = np.diff(s.position, axis=1)
        along = 0.5 * (s.heading[:, 1:] + s.heading[:, :-1])
        ahead = step[..., 0] * np.cos(along) + step[..., 1] * np.sin(along)
        aside = -step[..., 0] * np.sin(along) + step[..., 1] * np.cos(along)
        assert np.abs(ahead / 0.1 - 0.5 * (s.speed[:, 1:] + s.speed[:, :-1])).max() < 0.02
        assert np.abs(aside / 0.1).max() < 0.05
        rate = np.diff(s.speed, axis=1) / 0.1
        low = np.minimum(s.acceleration[:, 1:], s.acceleration[:, :-1])
        high = np.maximum(s.acceleration[:, 1:], s.acceleration[:, :-1])
        assert ((rate > low - 0.05) & (rate < high + 0.05)).all()
        assert (
            np.abs(np.diff(s.acceleration, axis=1)).max() / 0.1 < 14.0
        )  # the template's has corners of 20


def test_same_seed_same_bytes(fifty):
    again = drawn()
    more = drawn(count=120)
    for a, b, c in zip(fifty.scenarios, again.scenarios, more.scenarios, strict=False):
        assert a.position.tobytes() == b.position.tobytes()
        assert a.speed.tobytes() == b.speed.tobytes()
        np.testing.assert_allclose(c.position, a.position, atol=1e-9)
    assert (
        drawn(count=1, seed=6).scenarios[0].position.tobytes()
        != fifty.scenarios[0].position.tobytes()
    )


def states_at(b, time):
    """States of all candidates at all of these times."""
    return b.states(time, np.full(len(b.feasible), len(time)))


def test_states_agree_with_samples():
    _, some = batch(8)
    published = some.scenarios(0, range(8), "map")
    for k, s in enumerate(published):
        state = states_at(some, s.time)[:, k]
        assert np.array_equal(state[..., :2], s.position)
        assert np.array_equal(state[..., 3], s.speed)
        between = states_at(some, np.linspace(0.0, s.time[-1], 5001))[:, k]
        for n in range(2):
            travelled = np.hypot(*np.diff(between[n, :, :2], axis=0).T).sum()
            assert travelled == pytest.approx(some.samples[n].paths.arc[k, -1], abs=2e-3)


def spread_across(b):
    """Mean standard deviation [m] of y on the straight."""
    return float(b.samples[0].paths.curve[:, :, 1].std(axis=0).mean())


def roughness(b):
    """Mean standard deviation of the slope of the lateral deviation on the straight."""
    return float(
        (b.samples[0].paths.curve[:, :, 3] / b.samples[0].paths.curve[:, :, 2]).std(axis=0).mean()
    )


@pytest.mark.parametrize(
    ("name", "values", "measure", "sign"),
    [
        ("lateral_sigma", (0.1, 0.2, 0.8), spread_across, 1),
        ("observation_sigma", (0.05, 0.2, 0.6), spread_across, 1),
        ("lateral_length", (8.0, 20.0, 60.0), roughness, -1),
        ("time_sigma", (0.1, 0.4, 1.0), lambda b: float(warped(b)[:, 2].std()), 1),
        ("time_sigma", (0.1, 0.4, 1.0), lambda b: float(warped(b)[:, -1].std()), 1),
        ("longitudinal_sigma", (0.0, 1.0, 2.0), lambda b: float(stops(b).std()), 1),
    ],
)
def test_each_parameter_has_its_monotone_effect(name, values, measure, sign):
    found = [sign * measure(batch(**{name: value})[1]) for value in values]
    assert (np.diff(found) > 0.0).all(), found


def warped(b):
    """Times (S, K + 2) [s] of start, changepoints and end."""
    return b.samples[0].clock.time[:, np.searchsorted(b.samples[0].clock.grid, CLOCK - 1e-9)]


def stops(b):
    """Where vehicle 1 stands [m]."""
    middle = 0.5 * (warped(b)[:, 2] + warped(b)[:, 3])
    order = np.argsort(middle)
    return states_at(b, middle[order])[1, order, np.arange(len(order)), 1]


def test_deviations_have_the_stated_standard_deviation():
    assert set(astuple(NoiseScale())) == {1.0}, "no factor unless a level asks for it"
    model, some = batch(4000, lateral_sigma=0.4, observation_sigma=10.0)
    middle = len(model.vehicles[0].path.node) // 2
    assert some.samples[0].paths.curve[:, middle, 1].std() == pytest.approx(
        0.36, rel=0.05
    )  # tied down at both ends


def test_clocks_are_monotone_and_shared():
    _, some = batch(500, time_sigma=3.0)
    rate = some.samples[0].clock.rate
    assert rate.min() > 0.7
    assert rate.max() < 1.4
    assert (
        np.abs(
            some.samples[0].clock.time[:, -1] / 0.1
            - np.round(some.samples[0].clock.time[:, -1] / 0.1)
        ).max()
        < 1e-9
    )
    assert np.abs(rate[:, [0, -1]] - 1.0).max() < 1e-6  # speeds are given at both ends


@pytest.mark.parametrize("rows", [(57, 63), (47, 63), (57, 73)])
def test_lateral_deviation_fits_narrow_roads(rows):
    """1.5 m to the nearer side of y = 0, whichever that is."""
    plan = scene_plan()
    lane = np.zeros(plan.road.drivable.shape, dtype=bool)
    lane[slice(*rows)] = True
    narrow = replace(plan, road=Road("lane", lane, 0.5, plan.road.origin, [], []))
    built = build_model(narrow, SamplingConfig(drivers=0.0))
    eps = np.random.default_rng(0).standard_normal((500, built.model.size))
    curve = built.model.draw(eps, NoiseScale()).samples[0].paths.curve
    assert np.abs(curve[..., 1]).max() < 1.5 - 0.5 * 1.9
    assert NoteKind.NARROW in {note.kind for note in built.notes}


def test_refusals_are_counted_by_cause():
    def strict(scenarios, _=None):
        wide = [np.abs(s.position[0, :, 1]).max() > 0.12 for s in scenarios]
        return [
            Verdict((Violation(Cause.OFF_ROAD, 0.0, (0,), ""),)) if w else Verdict() for w in wide
        ]

    found = drawn(check=strict)
    assert len(found.scenarios) == 50
    assert found.candidates == 50 + found.refused.total()
    assert set(found.refused) == {Cause.OFF_ROAD}
    assert NoteKind.LESS_VARIATION in {note.kind for note in found.adaptations}
    assert max(s.index for s in found.scenarios) >= LEVEL_CANDIDATES


@pytest.mark.parametrize(("drivers", "share"), [(0.0, 0.3), (1.0, 0.1)])
def test_levels_follow_the_valid_share(drivers, share):
    """Three in ten where one driver is drawn, one in ten where drivers differ, too."""
    enough = math.ceil(share * PILOT_CANDIDATES)
    for accepted in (enough, enough - 1):

        def first_ones(scenarios, _=None, accepted=accepted):
            fault = Verdict((Violation(Cause.OVERLAP, 0.0, (0, 1), ""),))
            numbers = (place_of(scenario.index)[1] for scenario in scenarios)
            return [Verdict() if number < accepted else fault for number in numbers]

        found = drawn(count=5, check=first_ones, config=replace(PLAIN, drivers=drivers))
        tried = NoteKind.FEW_VALID in {note.kind for note in found.adaptations}
        assert tried == (accepted < enough)


def test_short_set_has_its_account():
    def never(scenarios, _=None):
        return [Verdict((Violation(Cause.OVERLAP, 0.0, (0, 1), ""),)) for _ in scenarios]

    found = drawn(count=10, check=never, config=SamplingConfig(drivers=0.0, attempts=5))
    assert found.scenarios == ()
    assert found.candidates == found.refused[Cause.OVERLAP] == 50


def test_progress_and_cancellation():
    seen = []
    callbacks = Callbacks(progress=lambda *a: seen.append(a), cancelled=lambda: len(seen) > 2)
    found = draw_scenarios(scene_plan(), all_valid, count=500, callbacks=callbacks)
    assert 0 < len(found.scenarios) < 500
    assert seen[-1] == (len(found.scenarios), 500, found.candidates)
    assert NoteKind.CANCELLED in {note.kind for note in found.adaptations}


def test_wait_stands_without_creeping():
    speed = (
        build_model(
            replace(scene_plan(), waits=(Wait(1, 6.8, 13.2),)), SamplingConfig(drivers=0.0)
        )
        .model.vehicles[1]
        .speed
    )
    at_rest = speed.spline.breaks[speed.spline.design(speed.spline.breaks) @ speed.mean == 0.0]
    assert 7.0 <= at_rest[0] < 7.5
    assert 12.5 < at_rest[-1] <= 13.0


def test_creeping_wait_does_not_stand():
    plan = scene_plan()
    encounter = plan.encounter
    rolls = np.interp(TIME, [0.0, 6.0, 8.0, 12.0, 13.0, 20.0], [6.0, 6.0, 0.4, 0.4, 0.6, 6.0])
    creeping = replace(encounter, speed=np.array([encounter.speed[0], rolls, encounter.speed[2]]))
    total = SpeedProfile(TIME, rolls).travelled[-1]
    slow_route = route(*turn(35.0, 9.0, total - 35.0 - 4.5 * np.pi), rolls)
    ends = np.array(plan.requested.end)
    ends[1] = [*slow_route.points[-1], 6.0]
    waits = tuple(wait for wait in find_waits(creeping) if wait.vehicle == 1)
    assert [wait.moves_slowly for wait in waits] == [True]
    plan = replace(
        plan,
        situation=Situation.of(creeping),
        routes=(plan.routes[0], slow_route, plan.routes[2]),
        requested=BoundaryStates(plan.requested.start, ends),
        waits=waits,
    )
    made = draw_scenarios(plan, all_valid, PLAIN, count=20, seed=1).scenarios
    verdicts = Checker(None, None, None, waits).check(made)
    causes = [violation.cause for verdict in verdicts for violation in verdict.violations]
    assert Cause.STOP_NOT_KEPT not in causes
    assert all((s.speed[1] > 0.0).all() for s in made)
    stands = replace(plan, waits=(replace(waits[0], moves_slowly=False),))
    stood = draw_scenarios(stands, all_valid, PLAIN, count=20, seed=1).scenarios
    assert all((s.speed[1] == 0.0).sum() > 30 for s in stood)


def test_stretched_clock_is_said():
    plan = replace(scene_plan(), limits=TypeLimits(car=Dynamics(max_speed=6.75)))
    done = build_model(plan, PLAIN)
    assert done.model is not None
    assert NoteKind.STRETCHED in {note.kind for note in done.notes}
    slowest = replace(plan, limits=TypeLimits(car=Dynamics(max_speed=3.375)))
    impossible = draw_scenarios(slowest, all_valid, PLAIN, count=5)
    assert impossible.refused[Cause.SPEED_PROFILE] == 1
    assert "cannot drive" in str(impossible.adaptations[0])
    assert "more of limits.car.max_speed would do" in str(impossible.adaptations[0])


@pytest.mark.parametrize(("left", "is_lost"), [(-3.05, True), (-2.05, True), (-3.05, False)])
def test_lost_side_distance_is_adapted(left, is_lost):
    """Recorded 2.55 m apart with 1.3 m between their sides; the road may not have room for it."""
    pair = Abreast((0, 1), -2.55, 1.3, np.ones(3, dtype=bool), np.zeros((2, 2)))
    ways = np.stack([np.linspace(0.0, 60.0, 61), np.zeros(61), np.zeros(61)], axis=-1)
    paths = [SimpleNamespace(path=ways + np.array([0.0, y, 0.0])) for y in (0.0, left)]
    losses = (Loss("side", ("a", "b"), ""),) if is_lost else ()
    fit = SimpleNamespace(vehicles=(Vehicle("a"), Vehicle("b")), fitted=paths, losses=losses)
    placed = _placed_abreast(pair, fit)
    shown = left if is_lost else -2.55
    assert placed.offset == pytest.approx(shown)
    assert placed.clearance == pytest.approx(1.3 + abs(shown) - 2.55)
