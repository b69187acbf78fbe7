# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The core of the closed loop: the witness passes, the others keep their order whatever the ego does, nobody waits for ever."""

from dataclasses import replace

from hypothesis import example, given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from support.driving_scenes import crossing
from support.lengths import LONG

from benchmarks._driving_worlds import Anything, as_scenario, draw_scenario, PERIOD, Witness
from scenario_gen.base.parameters import assigned
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.ego import Command, EgoState, move, Pose
from scenario_gen.closed_loop.simulation import ClosedLoop
from scenario_gen.closed_loop.verdict import judge
from scenario_gen.situation import conflict_of
from scenario_gen.types import Dynamics, Facts, NamedReaction, YIELD

EXAMPLES = 10_000 if LONG else 25
FAR = Pose(1e4, 1e4, 0.0, 0.0)


def prepared(seed, reactions=False, **config):
    """A drawn scenario, one of its vehicles as ego; with reactions every second one at a conflict yields to the first."""
    scenario = draw_scenario(seed)
    ids = [vehicle.id for vehicle in scenario.vehicles]
    if reactions:
        found = [conflict_of(scenario, a, b) for b in range(len(ids)) for a in range(b)]
        yields = tuple(
            NamedReaction(YIELD, ids[c.second], ids[c.first]) for c in found if c is not None
        )
        scenario = replace(scenario, facts=Facts(reactions=yields))
    ego = seed % len(ids)
    return scenario, ego, ClosedLoop(scenario, ego, config=ClosedLoopConfig(**config))


@settings(max_examples=EXAMPLES)
@given(seed=st.integers(0, 10**9), reactions=st.booleans())
@example(
    seed=1092, reactions=False
)  # two with the earliest clock may leave neither each other behind nor the next one
@example(seed=7114, reactions=False)
def test_others_never_meet_and_always_arrive(seed, reactions):
    scenario, ego, loop = prepared(seed, reactions)
    anything, steps = Anything(seed), len(scenario.time) // 2 + seed % 50
    drive = loop.drive(anything, lambda state: state.step >= steps)
    assert judge(loop, drive).among_others == 0
    assert (np.diff(drive.clock, axis=1) >= 0.0).all()
    state = loop.start()
    anything.reset(loop.task())
    for _ in range(40):
        state = loop.step(state, anything.act(loop.observe(state)))
    others = [i for i in range(len(scenario.vehicles)) if i != ego]
    for _ in range(3000):  # the ego has gone: no circle of others may be left waiting
        state = loop.step(state, FAR)
        if (state.clock[others] >= scenario.time[-1]).all():
            return
    raise AssertionError(f"clocks {state.clock} stand still at rates {state.rate}")


@settings(max_examples=EXAMPLES)
@given(st.integers(0, 10**9), st.sampled_from(["replay", "reactive"]))
def test_witness_as_ego_changes_nothing(seed, policy):
    scenario, ego, loop = prepared(seed, policy=policy)
    drive = loop.drive(Witness(scenario, ego), lambda state: state.step >= len(scenario.time) - 1)
    assert np.abs(drive.motion.position - scenario.position).max() < 1e-6
    verdict = judge(loop, drive)
    assert verdict.collision is None and verdict.among_others == 0


def test_others_wait_as_in_the_template():
    """The ego went first in the template, but comes late: it stands 25 m before the crossing for 6 s."""
    scenario = crossing()
    loop = ClosedLoop(scenario, 0, config=ClosedLoopConfig(patience=1e6))
    state = loop.start()
    for _ in range(100):
        state = loop.step(state, Command(-4.0, 0.0))
        assert state.vehicles[1, 1] < -2.0


@pytest.mark.parametrize("patience", [2.0, 1e6])
def test_patient_vehicle_passes_a_delayed_one(patience):
    """Vehicle 0 crosses before vehicle 1 and is held up by the ego ahead of it: vehicle 1 waits for it, then goes first; all go on."""
    base, time = crossing(), np.arange(150) * PERIOD
    lead = (
        np.stack([-20.0 + 8.0 * time, np.zeros_like(time)], axis=1),
        np.zeros_like(time),
        np.full_like(time, 8.0),
    )
    motions = [(base.position[i], base.heading[i], base.speed[i]) for i in range(2)]
    scenario = as_scenario([*motions, lead], len(time))
    loop = ClosedLoop(scenario, 2, config=ClosedLoopConfig(patience=patience))
    state = loop.start()
    for _ in range(220):
        state = loop.step(state, Command(-6.0, 0.0))
    assert state.vehicles[2, 0] < -10.0 and state.vehicles[0, 0] < -10.0
    if patience > 100.0:
        assert state.vehicles[1, 1] < -3.0 and state.vehicles[1, 3] < 0.5
    else:
        assert state.vehicles[1, 1] > 5.0 and state.passes[1, 0]
    for _ in range(250):
        state = loop.step(state, FAR)
    assert (state.clock[:2] >= scenario.time[-1]).all()


def test_body_keeps_limits_and_drives_arcs():
    config, limits = ClosedLoopConfig(ego_curvature_rate=20.0), Dynamics()
    state, turn = EgoState(0.0, 0.0, 0.0, 5.0, 0.1), 0.1
    for _ in range(200):
        state = move(state, Command(0.0, turn), config, limits).state
    centre = np.hypot(state.x, state.y - 10.0)
    assert centre == pytest.approx(10.0, abs=1e-9) and state.yaw == pytest.approx(5.0 * 20.0 * 0.1)
    fast = move(state, Command(100.0, 9.0), config, limits).state
    assert fast.acceleration == pytest.approx(limits.max_acceleration)
    assert fast.curvature == limits.max_curvature
    state = EgoState(0.0, 0.0, 0.0, 0.45)
    stopped = move(state, Command(-9.0, 0.0), config, limits).state
    assert stopped.speed == 0.0 and stopped.x == pytest.approx(0.45**2 / 18.0)


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (None, "no command"),
        (Command(float("nan"), 0.0), "not finite"),
        (Pose(0.0, float("inf"), 0.0, 0.0), "not finite"),
        (Pose(500.0, 0.0, 0.0, 0.0), "jumped 500.0 m"),
    ],
)
def test_wrong_command_is_described(asked, said):
    moved = move(EgoState(0.0, 0.0, 0.0, 5.0), asked, ClosedLoopConfig(), Dynamics())
    assert said in moved.fault and np.isfinite(moved.state).all()


def test_partly_present_vehicles_keep_their_times():
    """Vehicle 1 comes at 3 s and leaves at 9 s; held up by the ego on its place, it comes later."""
    base = crossing()
    present = np.array([[0, 149], [30, 90]])
    scenario = replace(base, present=present)
    loop = ClosedLoop(scenario, 0)
    drive = loop.drive(Witness(scenario, 0), lambda state: state.step >= 149)
    assert (
        drive.present == scenario.is_present
    ).sum() >= drive.present.size - 1  # at the very end of its presence it has gone
    assert np.abs((drive.motion.position - scenario.position)[drive.present]).max() < 1e-9
    x, y = scenario.position[1, 30].tolist()
    state = loop.start()
    for _ in range(60):
        state = loop.step(state, Pose(x, y, 0.0, 0.0))
    assert not state.present[1] and state.clock[1] < 3.0
    for _ in range(15):
        state = loop.step(state, FAR)
    assert state.present[1]
    late = ClosedLoop(replace(base, present=np.array([[0, 149], [30, 149]])), 1)
    assert late.start().vehicles[1].tolist() == pytest.approx(
        [*base.position[1, 30].tolist(), np.pi / 2, 8.0]
    )
    drive = late.drive(Late(base, 1, 3.0))
    verdict = judge(late, drive)
    assert verdict.passed and verdict.delay == pytest.approx(0.0, abs=1e-9)


class Late(Witness):
    """A witness that comes onto the scene later."""

    def __init__(self, scenario, ego, begin):
        super().__init__(scenario, ego)
        self.begin = begin

    def act(self, seen):
        return super().act(replace(seen, time=seen.time + self.begin))


def test_type_limits_bind_the_ego():
    config = assigned(ClosedLoopConfig(), "limits.car.max_acceleration=1.2")
    loop = ClosedLoop(crossing(), 0, config=config)
    state = loop.step(loop.start(), Command(9.0, 0.0))
    assert state.ego.acceleration == pytest.approx(1.2)
    assert loop.task().limits.max_acceleration == 1.2
