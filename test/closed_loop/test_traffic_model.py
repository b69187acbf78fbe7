# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The others as people: they react late, brake smoothly, and go before an ego that stands when they have waited long enough."""

from dataclasses import replace

from hypothesis import assume, given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from support.driving_scenes import Acts, crossing, following
from support.lengths import LONG

from benchmarks._drive_others import braking_jerks
from benchmarks._driving_worlds import Anything, as_scenario, draw_scenario, Witness
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.driver import MODEL
from scenario_gen.closed_loop.ego import Command, Pose
from scenario_gen.closed_loop.simulation import ClosedLoop, reaction_time

EXAMPLES = 2000 if LONG else 15
NEVER = 1e6  # s of patience


def braking_after(steps, braking):
    """Commands of an ego that keeps its speed for so many steps, then brakes [m/s²]."""
    return lambda k: Command(-braking if k >= steps else 0.0, 0.0)


def states(loop, commands, count):
    """The first instants of a drive."""
    made = [loop.start()]
    for k in range(count):
        made.append(loop.step(made[-1], commands(k)))
    return made


def touches(loop, commands, count):
    """Whether the ego touches somebody."""
    return any(loop.hit(state) for state in states(loop, commands, count))


def test_reaction_times_depend_on_the_scenario():
    scenario = crossing()
    times = [ClosedLoop(scenario, ego).reactions for ego in range(len(scenario.vehicles))]
    assert all((each == times[0]).all() for each in times) and len(set(times[0])) == len(times[0])
    turned = replace(scenario, vehicles=scenario.vehicles[::-1])
    assert (ClosedLoop(turned, 0).reactions == times[0][::-1]).all()
    assert (ClosedLoop(replace(scenario, index=1), 0).reactions != times[0]).all()
    assert (ClosedLoop(scenario, 0, config=ClosedLoopConfig(reaction=0.0)).reactions == 0.0).all()


@settings(max_examples=EXAMPLES)
@given(st.integers(0, 10**9), st.integers(1, 40), st.sampled_from([0.05, 0.1]))
def test_nobody_answers_before_its_reaction_time(seed, differ, step):
    """Two egos that do the same for some steps, and then not: among two vehicles the other one does the same for longer."""
    scenario = draw_scenario(seed, 2)
    assume(len(scenario.vehicles) == 2)
    loop = ClosedLoop(scenario, 0, config=ClosedLoopConfig(step=step))
    late = round(float(loop.reactions[1]) / step)
    one, two = (
        states(loop, braking_after(differ, braking), differ + late + 5) for braking in (0.0, 9.0)
    )
    for k in range(differ + late + 1):
        assert one[k].clock[1] == two[k].clock[1] and one[k].rate[1] == two[k].rate[1]


@settings(max_examples=EXAMPLES)
@given(
    st.floats(2.0, 20.0), st.floats(0.5, 9.0), st.floats(0.0, 20.0), st.sampled_from([0.05, 0.1])
)
def test_follower_stops_with_room_for_reaction(speed, braking, spare, step):
    """The gap holds what it drives in its reaction time and while its foot gets to full braking, two steps, and 0.6 m."""
    config = ClosedLoopConfig(step=step)
    reaction = reaction_time(following(speed, 50.0), "v0", config.reaction)
    need = 0.5 * speed**2 / config.strongest_braking - 0.5 * speed**2 / braking
    late = reaction + config.strongest_braking / config.jerk + 2.0 * step
    loop = ClosedLoop(
        following(speed, max(need, 0.0) + speed * late + 0.6 + spare), 1, config=config
    )
    assert not touches(loop, braking_after(1, braking), int(12 / step))


@settings(max_examples=EXAMPLES)
@given(st.integers(0, 10**9), st.floats(3.0, 20.0), st.floats(0.3, 1.8), st.floats(1.0, 2.0))
def test_no_follower_hits_braking_ego(seed, speed, headway, standstill):
    loop = ClosedLoop(replace(following(speed, standstill + headway * speed), seed=seed), 1)
    assert not touches(loop, braking_after(10, 3.5), 120)


@pytest.mark.parametrize("gap", [0.02, 0.2, 0.5])
def test_others_pass_ego_beside_their_way(gap):
    loop = ClosedLoop(crossing(), 0)
    stop = -0.5 * loop.scenario.vehicles[0].length - 0.5 * loop.scenario.vehicles[1].width - gap

    def commands(k):
        return Pose(min(-30.0 + 0.8 * (k + 1), stop), 0.0, 0.0, 8.0 * (-29.2 + 0.8 * k < stop))

    drive = states(loop, commands, 250)
    assert not loop.hit(drive[-1]) and drive[-1].clock[1] > 9.0


@settings(max_examples=EXAMPLES)
@given(
    st.integers(0, 10**9),
    st.sampled_from([0.05, 0.1]),
    st.sampled_from([3.0, 10.0]),
    st.integers(2, 4),
)
def test_jerk_is_bounded_unless_forced(seed, step, jerk, vehicles):
    """On certified motions of one speed, which have no jerk of their own; whatever the ego does."""
    scenario = replace(following(12.0, 10.0, vehicles) if seed % 2 else crossing(), seed=seed)
    ego = seed % len(scenario.vehicles)
    loop, planner = (
        ClosedLoop(scenario, ego, config=ClosedLoopConfig(step=step, jerk=jerk)),
        Anything(seed),
    )
    planner.reset(loop.task())
    drive = [loop.start()]
    for _ in range(int(12 / step)):
        drive.append(loop.step(drive[-1], planner.act(loop.observe(drive[-1]))))
    others = [i for i in range(len(scenario.vehicles)) if i != ego]
    speed = np.array([state.vehicles[others, 3] for state in drive])
    change = np.diff(np.diff(speed, axis=0), axis=0) / step
    stays = np.array([[state.clock[i] < scenario.time[-1] for i in others] for state in drive[2:]])
    forced = np.diff([state.forced for state in drive]) > 0
    free = stays & ~(forced[1:] | forced[:-1])[:, None]
    most = (jerk * step * step + 0.051) / step
    assert change[free].min() >= -most  # braking grows
    assert (
        change[free & (speed[2:] > 0.2)].max() <= most
    )  # and lessens, but where the order ends what is left of a stop


def test_braking_is_as_sudden_as_recorded():
    """99 of 100 steps in which somebody brakes, those that the order forced among them, in drawn scenarios."""
    found = []
    for seed in range(10_000 if LONG else 50):
        scenario = draw_scenario(seed)
        loop = ClosedLoop(scenario, seed % len(scenario.vehicles))
        drive = loop.drive(
            Anything(seed), lambda state, last=len(scenario.time) // 2: state.step >= last
        )
        found.append(braking_jerks(scenario, drive))
    jerk = np.concatenate(found)
    assert len(jerk) > 250 and np.percentile(jerk, 99) <= 10.0


def test_departed_vehicle_brakes_for_no_ego():
    scenario = replace(following(10.0, 20.0), present=np.array([[0, 149], [0, 60]]))
    drive = ClosedLoop(scenario, 0).drive(Witness(scenario, 0), lambda state: state.step >= 149)
    assert np.abs(drive.motion.position[1, :61] - scenario.position[1, :61]).max() < 1e-6
    assert drive.present[1].sum() == 61


@pytest.mark.parametrize(("braking", "first"), [(0.0, 0), (1.0, 0), (4.0, 40)])
def test_follower_enters_if_it_can_stop(braking, first):
    """It is recorded from 6 s on; the ego is where it was recorded, drives on more slowly, or stands in its place."""
    scenario = replace(following(10.0, 6.0), present=np.array([[60, 149], [0, 149]]))
    loop = ClosedLoop(scenario, 1)
    brakes = range(first, first + 30)
    drive = loop.record(states(loop, lambda k: Command(-braking * (k in brakes), 0.0), 140))
    assert drive.present[0, 61] == (braking == 0.0)
    assert drive.present[0].any() == (braking < 4.0)
    gap = drive.motion.position[1, :, 0] - drive.motion.position[0, :, 0] - 4.25
    assert gap[drive.present[0]].min(initial=10.0) > 2.0
    change = np.diff(drive.motion.speed[0])[drive.present[0, 1:] & drive.present[0, :-1]]
    assert change.min(initial=0.0) >= -0.31  # comfortable braking


def test_leader_drives_on_out_of_way():
    """Its recording ends 20 m ahead of the ego, which is hardly slower; or far ahead."""
    scenario = replace(following(10.0, 20.0), present=np.array([[0, 149], [0, 60]]))
    loop = ClosedLoop(scenario, 0)
    drive = loop.record(states(loop, lambda k: Command(-2.0 if 10 <= k < 12 else 0.0, 0.0), 140))
    there = drive.present[1]
    gap = drive.motion.position[1, :, 0] - drive.motion.position[0, :, 0] - 4.25
    assert there.sum() > 100 and 24.9 < gap[np.argmin(there)] < 26.0
    assert np.ptp(np.diff(drive.motion.position[1, there, 0])) < 1e-6
    late = loop.record(states(loop, braking_after(1, 6.0), 140))
    assert late.present[1].sum() == 61  # it is 60 m ahead by then


@pytest.mark.parametrize("patience", [2.0, 5.0, NEVER])
def test_patience_ends_a_wait_for_ego(patience):
    """The ego went first in the template, but stands 20 m before the crossing."""
    loop = ClosedLoop(crossing(), 0, config=ClosedLoopConfig(patience=patience))
    drive = states(loop, braking_after(3, 4.0), 300)
    stands = np.array([state.present[1] and state.vehicles[1, 3] < 0.5 for state in drive])
    assert stands.any()
    assert (drive[-1].vehicles[1, 1] > 5.0) == (patience < NEVER)
    if patience < NEVER:
        assert 0.1 * stands.sum() == pytest.approx(loop.traits.patience[1], abs=1.0)


@pytest.mark.parametrize(("x", "speed"), [(-2.0, 0.0), (-6.0, 2.0)])
def test_nobody_goes_before_ego_in_way(x, speed):
    scenario = crossing()
    loop = ClosedLoop(scenario, 0)
    drive = states(loop, lambda k: Pose(min(-30.0 + 0.8 * k, x), 0.0, 0.0, speed), 300)
    assert drive[-1].vehicles[1, 1] < -2.0


def test_creeping_distant_ego_loses_its_turn():
    drive = states(ClosedLoop(crossing(), 0), lambda k: Pose(-20.0 + 0.03 * k, 0.0, 0.0, 0.3), 200)
    assert drive[-1].vehicles[1, 1] > 5.0


@pytest.mark.parametrize(("beside", "passes"), [(2.0, False), (2.6, True)])
def test_slower_ego_is_not_overtaken_closely(beside, passes):
    """The ego, 1.8 m wide as the other, drives so far beside the middle of the lane that 0.2 or 0.8 m are left."""
    start = following(8.0, 20.0).position[1, 0, 0]
    poses = [Pose(start + 0.3 * k, min(0.1 * k, beside), 0.0, 3.0) for k in range(1, 150)]
    drive = states(ClosedLoop(following(8.0, 20.0), 1), poses.__getitem__, 130)
    assert (drive[-1].vehicles[0, 0] > drive[-1].ego.x) == passes


@pytest.mark.parametrize("faster", [2.0, 6.0, 12.0])
def test_nobody_brakes_for_ego_from_behind(faster):
    """The ego speeds up behind a vehicle on its path, up to the contact."""
    loop = ClosedLoop(following(8.0, 12.0), 0)
    drive = loop.drive(pushes(8.0 + faster), lambda state: loop.hit(state) or state.step >= 100)
    assert np.abs(drive.motion.speed[1] - 8.0).max() < 1e-6


@pytest.mark.parametrize("late", [0.0, 2.0])
def test_nobody_stops_at_reference_end(late):
    """The reference of the ego ends at 6 s before a vehicle that follows; the ego goes on."""
    scenario = replace(following(10.0, 15.0), present=np.array([[0, 149], [0, 60]]))
    drive = ClosedLoop(scenario, 1).drive(pushes(10.0, late), lambda state: state.step >= 140)
    assert drive.motion.speed[0, 40:].min() > 8.0 - late and drive.motion.speed[0, -1] > 9.9


def pushes(speed, late=0.0):
    """Return a planner that drives straight on to a speed [m/s]; it brakes lightly for a time [s] before."""

    def act(seen):
        return Command(-1.0 if seen.time < late else min(2.0 * (speed - seen.ego.speed), 3.0), 0.0)

    return Acts(act)


@pytest.mark.parametrize("policy", ["reactive", "committed"])
@pytest.mark.parametrize("braking", [1.0, 2.0, 4.0])
def test_late_ego_with_priority_goes_first(policy, braking):
    """The ego brakes for 1 s, then keeps its speed, and reaches the crossing 0.4 to 3.6 s late."""
    for start in (-45.0, -50.0, -60.0):
        loop = ClosedLoop(crossing(second_start=start), 0, config=ClosedLoopConfig(policy=policy))
        drive = states(loop, lambda k: Command(-braking * (5 <= k < 15), 0.0), 140)
        passed = next(state for state in drive if state.ego.x > 4.0)
        assert not any(loop.hit(state) for state in drive) and passed.vehicles[1, 1] < 0.0
        assert drive[-1].vehicles[1, 1] > 5.0


def test_much_later_ego_loses_its_turn():
    """The ego goes on at 2 m/s from 20 m before the crossing on, which takes it 8 s more."""
    loop = ClosedLoop(crossing(second_start=-45.0), 0, config=ClosedLoopConfig(patience=NEVER))
    drive = states(loop, lambda k: Pose(min(0.8 * k, 8.0 + 0.2 * k) - 30.0, 0.0, 0.0, 2.0), 90)
    assert not any(loop.hit(state) for state in drive)
    assert drive[-1].vehicles[1, 1] > 5.0 and drive[-1].ego.x < -3.0


def test_vehicle_behind_early_ego_hurries():
    loop = ClosedLoop(crossing(second_start=-50.0), 0)
    early = states(loop, lambda k: Command(2.0 * (k < 20), 0.0), 80)
    assert early[-1].clock[0] > 10.0 and early[-1].clock[1] > 8.2
    late = states(loop, lambda k: Command(-2.0 * (k < 20), 0.0), 80)
    assert late[-1].clock[1] <= 8.0 + 1e-9


def test_drivers_differ_and_keep_their_headway():
    traits = [ClosedLoop(draw_scenario(seed), 0).traits for seed in range(5)]
    patience = np.concatenate([each.patience for each in traits])
    assert len(set(patience)) == len(patience) and np.ptp(patience) > 1.0
    loop = ClosedLoop(following(10.0, 25.0, 3), 2)
    gap = -np.diff(loop.world.motion[:, 0, 0])[::-1] * -1.0 - 4.5
    assert loop.traits.headway[:2] == pytest.approx((gap[::-1] - 2.0) / 10.0, abs=0.1)


@pytest.mark.parametrize("braking", [0.5, 1.0, 2.0])
def test_follower_brakes_comfortably_for_the_ego(braking):
    """It ends as near behind the slower ego as its own time gap."""
    loop = ClosedLoop(following(15.0, 30.0), 1)
    drive = states(
        loop, lambda k: Command(-braking * (10 <= k < 10 + 50 / (10 * braking)), 0.0), 140
    )
    speed = np.array([state.vehicles[0, 3] for state in drive])
    acceleration = np.diff(speed) / 0.1
    assert acceleration.min() > -3.1 and np.abs(np.diff(acceleration)).max() / 0.1 < 4.1
    gap = drive[-1].vehicles[1, 0] - drive[-1].vehicles[0, 0] - 4.25
    assert gap / speed[-1] == pytest.approx(2.0, abs=0.3)


def test_vehicle_at_its_end_stands():
    time = 0.1 * np.arange(60)
    zero, slow = np.zeros_like(time), np.full_like(time, 0.4)
    motions = [(np.stack([x + 0.4 * time, zero], axis=1), zero, slow) for x in (0.0, 20.0)]
    drive = states(
        ClosedLoop(as_scenario(motions, len(time)), 1), lambda _: Command(-1.0, 0.0), 80
    )
    assert drive[30].vehicles[0, 3] == pytest.approx(0.4) and drive[-1].vehicles[0, 3] == 0.0


def test_a_drive_can_be_branched_anywhere():
    """What drivers have seen, their patience and their accelerations are in the state: a branch goes on as the drive did."""
    loop = ClosedLoop(draw_scenario(12), 0)
    drive = states(loop, braking_after(8, 5.0), 60)
    for first in (0, 9, 30):
        state = drive[first]
        for k in range(first, 60):
            state = loop.step(state, braking_after(8, 5.0)(k))
        last = drive[-1]
        for name in ("vehicles", "clock", "rate", "acceleration", "waited", "seen"):
            assert (getattr(state, name) == getattr(last, name)).all()


@settings(max_examples=EXAMPLES)
@given(st.integers(0, 10**9), st.sampled_from([None, -3.0, -1.0, 1.0, 2.5]))
def test_hardest_braking_is_bounded_or_counted(seed, gain):
    """The ego does anything, or speeds up or brakes for 3 s."""
    scenario = draw_scenario(seed)
    ego = seed % len(scenario.vehicles)
    planner, loop = Anything(seed), ClosedLoop(scenario, ego)
    planner.reset(loop.task())
    drive = [loop.start()]
    while (step := drive[-1].step) < len(scenario.time) + 30:
        command = planner.act(loop.observe(drive[-1]))
        if gain is not None:
            command = Command(gain * (step < 30), 0.0)
        drive.append(loop.step(drive[-1], command))
    gained = np.diff([state.vehicles[:, 3] for state in drive], axis=0) / 0.1
    stays = np.array([state.present for state in drive])
    hardest = -loop.parameters.strongest - MODEL.braking_tolerance_mps / 0.1 - 1e-9
    hard = (gained < hardest) & stays[1:] & stays[:-1]
    hard[:, ego] = False
    counted = np.diff([state.forced for state in drive])
    assert (hard.sum(axis=1) <= counted).all()


@pytest.mark.parametrize("ahead", [0.5, 1.0, 1.5])
@pytest.mark.parametrize("late", [0.0, 0.5, 1.0])
def test_hurrying_vehicle_brakes_for_its_place(ahead, late):
    """It crosses behind the ego after a stop; the ego is early by more and more, then late."""
    time = np.arange(150) * 0.1
    speed = np.interp(time, [0.0, 1.0, 4.0, 7.0, 10.0], [8.0, 8.0, 0.0, 0.0, 5.0])
    way = np.concatenate([[0.0], np.cumsum(0.05 * (speed[1:] + speed[:-1]))])
    other = np.stack([way - 26.0, 0.0 * way], -1), 0.0 * way, speed
    ego = np.stack([0.0 * way, 6.0 * time - 35.0], -1), np.full(150, np.pi / 2), 6.0 + 0.0 * time
    loop = ClosedLoop(as_scenario([ego, other], 150), 0)
    made = states(loop, lambda k: Command(ahead if k < 25 else -late, 0.0), 140)
    gained = np.diff([state.vehicles[1, 3] for state in made]) / 0.1
    assert gained.min() >= -5.0 and made[-1].forced == 0
