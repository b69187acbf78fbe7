# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Pedestrians in closed loop: they do not step before a car that cannot stop, and go on otherwise, whatever the ego does."""

from dataclasses import replace

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from support.driving_scenes import Acts
from support.lengths import LONG

from benchmarks._driving_worlds import Anything, as_scenario, draw_scenario, PERIOD, Witness
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.ego import Command, Pose
from scenario_gen.closed_loop.fault import Reason
from scenario_gen.closed_loop.simulation import ClosedLoop
from scenario_gen.closed_loop.verdict import judge
from scenario_gen.types import Vehicle

EXAMPLES = 2000 if LONG else 20
TIME = np.arange(240) * PERIOD
ZERO = np.zeros_like(TIME)
LANE = 0.95  # metres of half a car


def walker(start, speed=1.4, x=0.0):
    """A pedestrian that walks north from (x, start)."""
    return np.stack([x + ZERO, start + speed * TIME], axis=1), ZERO + np.pi / 2, ZERO + speed


def waiting_car(begin, end, speed=8.0, y=0.0):
    """A car from the west that stands 5 m before x = 0 from `begin` to `end` [s]."""
    speeds = np.clip(np.where(begin > TIME, 2.0 * (begin - TIME), 2.0 * (TIME - end)), 0.0, speed)
    way = np.concatenate([[0.0], np.cumsum((speeds[1:] + speeds[:-1]) / 2.0 * PERIOD)])
    x = way - way[np.searchsorted(TIME, begin)] - 5.0
    return np.stack([x, y + ZERO], axis=1), ZERO, speeds


def scene(*motions):
    """A car, a pedestrian, and other cars."""
    kinds = ((4.8, 1.9, "car"), (0.5, 0.5, "pedestrian"), (4.8, 1.9, "car"))
    vehicles = tuple(
        Vehicle(str(n), *kind) for n, kind in zip(range(len(motions)), kinds, strict=False)
    )
    return replace(as_scenario(motions, len(TIME)), vehicles=vehicles)


def accelerates(wish):
    """Return a planner that drives straight on with what a function gives of what it sees [m/s²]."""
    return Acts(lambda seen: Command(wish(seen), 0.0))


KEEPS = accelerates(lambda seen: 0.0)
BRAKES = accelerates(lambda seen: -2.0 if seen.ego.x > -25.0 else 0.0)


@pytest.mark.parametrize("walks", [0.8, 1.4, 2.0])
@pytest.mark.parametrize("late", [0.0, 0.4, 0.8])
def test_pedestrian_waits_for_car_then_goes(walks, late):
    """The car does not slow down from 3 s on, as it should; its front passes at 5.3 s."""
    scenario = scene(waiting_car(7.0, 16.0), walker(-walks * (4.8 + late) - 2.0, walks))
    loop = ClosedLoop(scenario, 0)
    drive = loop.drive(KEEPS, lambda state: state.step >= 150)
    verdict, place = judge(loop, drive), drive.motion.position
    assert verdict.collision is None
    there = (np.abs(place[0, :, 0]) < 2.65) & (np.abs(place[1, :, 1]) < LANE + 0.25)
    assert not there.any() and place[1, -1, 1] > 2.0
    slow = drive.motion.speed[1] < 0.4 * walks
    assert (np.abs(place[1, slow, 1]) > LANE + 0.5).all()  # it does not stop in the lane
    assert np.diff(drive.motion.speed[1]).min() / PERIOD > -5.1


def test_pedestrian_beside_parked_car_waits():
    parked = np.stack([3.5 + ZERO, -4.0 + ZERO], axis=1), ZERO, ZERO
    loop = ClosedLoop(scene(waiting_car(7.0, 16.0), walker(-9.0), parked), 0)
    drive = loop.drive(KEEPS, lambda state: state.step >= 150)
    y = drive.motion.position[1, :, 1]
    assert judge(loop, drive).collision is None
    assert (np.abs(y[drive.motion.speed[1] < 0.5]) > LANE + 0.5).all()
    assert y[-1] > 2.0


def test_pedestrian_precedes_stopping_car():
    scenario = scene(waiting_car(7.0, 16.0), walker(-9.0))
    drive = ClosedLoop(scenario, 0).drive(BRAKES, lambda state: state.step >= 150)
    assert (
        np.abs(drive.motion.position[1] - scenario.position[1, : len(drive.motion.time)]).max()
        < 1e-6
    )


def test_pedestrian_on_lane_convicts_the_ego():
    """The ego brakes until the pedestrian is on its lane, then speeds up."""
    scenario = scene(waiting_car(7.0, 16.0), walker(-9.0))
    hits = accelerates(
        lambda seen: (
            -2.0 if seen.others[0, 1] < -1.0 and seen.ego.x > -25.0 else 4.0 * (seen.ego.x > -25.0)
        )
    )
    loop = ClosedLoop(scenario, 0)
    drive = loop.drive(hits)
    collision = judge(loop, drive).collision
    assert collision is not None and collision.reason == Reason.OUT_OF_ORDER
    assert drive.motion.speed[1, drive.motion.position[1, :, 1] < 0.0].min() > 1.3


def test_pedestrian_waits_until_patience_ends():
    """The ego stands 10 m before the crossing; who waits for it does so beside the lane, not on it."""
    car = np.stack([-30.0 + 8.0 * TIME, ZERO], axis=1), ZERO, ZERO + 8.0
    loop = ClosedLoop(scene(car, walker(-10.0)), 0, config=ClosedLoopConfig(patience=4.0))
    drive = loop.drive(accelerates(lambda seen: -4.0), lambda state: state.step >= 230)
    stands = drive.motion.speed[1] < 0.05
    assert 0.1 * stands.sum() == pytest.approx(loop.traits.patience[1], abs=1.0)
    assert drive.motion.position[1, -1, 1] > 3.0
    assert (drive.motion.position[1, stands, 1] < -LANE - 0.5).all()


def test_car_waits_behind_waiting_pedestrian():
    """It is not braked more than drivers brake, and nobody stays."""
    far = waiting_car(7.5, 16.0, y=3.5)
    loop = ClosedLoop(scene(waiting_car(7.0, 16.0), walker(-9.0), far), 0)
    state = loop.start()
    for _ in range(400):
        state = loop.step(state, KEEPS.act(loop.observe(state)))
    assert state.forced == 0 and (state.clock[1:] >= TIME[-1] - 1e-9).all()


@settings(max_examples=EXAMPLES)
@given(st.integers(0, 10**9))
def test_pedestrians_keep_promises_of_the_loop(seed):
    """Drawn scenarios in which one is on foot, at any speed and of any size."""
    drawn = draw_scenario(seed)
    ego = seed % len(drawn.vehicles)
    walks = (ego + 1) % len(drawn.vehicles)
    kinds = ["pedestrian" if n == walks else "car" for n in range(len(drawn.vehicles))]
    vehicles = tuple(
        replace(one, type=kind) for one, kind in zip(drawn.vehicles, kinds, strict=True)
    )
    scenario = replace(drawn, vehicles=vehicles)
    loop = ClosedLoop(scenario, ego)
    drive = loop.drive(Witness(scenario, ego), lambda state: state.step >= len(scenario.time) - 1)
    assert np.abs(drive.motion.position - scenario.position).max() < 1e-6
    drive = loop.drive(Anything(seed), lambda state: state.step >= len(scenario.time) // 2)
    assert judge(loop, drive).among_others == 0
    state = loop.start()
    others = [i for i in range(len(kinds)) if i != ego]
    for _ in range(3000):
        state = loop.step(state, Pose(1e4, 1e4, 0.0, 0.0))
        if (state.clock[others] >= scenario.time[-1]).all():
            return
    raise AssertionError(f"clocks {state.clock} stand still at rates {state.rate}")
