# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Open-loop planners: they follow the route by speed laws that do not depend on the others.

A set of scenarios tests a planner only if every speed law fails in most of them. The family has
waits before constant speeds, stops on the way, and the speeds of the reference drive, earlier or
later. Where the others drive as certified, a law passes if it is never where one of them is, and
reaches the goal in time. So all laws are compared; those that pass most often are driven.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
import math
from typing import Any, NamedTuple

import numpy as np

from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.coordination_space import pose_at, WORLD, World
from scenario_gen.closed_loop.ego import Command
from scenario_gen.closed_loop.planners import RouteFollower
from scenario_gen.closed_loop.simulation import ClosedLoop, Observation
from scenario_gen.closed_loop.verdict import judge
from scenario_gen.numerics import Bools, edge_lengths, Floats, Ints
from scenario_gen.numerics.boxes import boxes_meet, fill_footprint
from scenario_gen.numerics.curve import Curve
from scenario_gen.numerics.kernels import B1, F, F2, kernel, OUTB2
from scenario_gen.types import GenerationResult, join_ego

WAITS_S = tuple(0.5 * k for k in range(61))
SPEEDS_MPS = (2.0, 3.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0)
GAINS_PER_S = (1.0, 10.0)  # soft as `ConstantSpeed`, and as fast as the body can
STOPS_S = (2.0, 4.0, 6.0)  # on the way
STOPS_AFTER_S = (3.0, 4.0, 5.0, 6.0)
SHIFTS_S = (-3.0, -2.0, -1.5, -1.0, 1.0, 1.5, 2.0, 3.0)  # of the speeds of the reference drive
INSISTING_S = 1.0  # for which a vehicle that insists on its turn needs its way
STATION_STEP_M = 0.5  # between two points of a route
TRIVIAL_SHARE = 0.9  # a set of which a speed law passes more hardly tests
BLIND_COUNT = 50  # scenarios of a set in which speed laws drive
DRIVEN_COUNT = 3  # speed laws that are driven
GOAL_MARGIN_M = 0.2  # before the end of the route, as in `ClosedLoop.reached`


class SpeedLaw(NamedTuple):
    """A member of the family.

    Attributes:
        wait: duration [s] for which it stands first; it brakes as hard as it can.
        speed: speed after it [m/s].
        gain: acceleration per speed error [1/s].
        after: duration [s] after the wait until it stands again.
        stop: for which it stands then [s].
        shift: time [s] by which it is later than the reference drive, whose speeds it has; NaN for
            the other members.
    """

    wait: float
    speed: float
    gain: float = GAINS_PER_S[0]
    after: float = math.inf
    stop: float = 0.0
    shift: float = math.nan

    def __str__(self) -> str:
        if not math.isnan(self.shift):
            side = "later" if self.shift > 0.0 else "earlier"
            return f"the reference drive's speeds {abs(self.shift):g} s {side}"
        stop = f", a stop of {self.stop:g} s after {self.after:g} s" if self.stop else ""
        wait = f"standing for {self.wait:g} s, then " if self.wait else "a constant "
        return f"{wait}{self.speed:g} m/s{stop}"


FAMILY: tuple[SpeedLaw, ...] = (
    *(SpeedLaw(*values) for values in product(WAITS_S, SPEEDS_MPS, GAINS_PER_S)),
    *(
        SpeedLaw(*values)
        for values in product(WAITS_S[::2], (4.0, 8.0), GAINS_PER_S[:1], STOPS_AFTER_S, STOPS_S)
    ),
    *(SpeedLaw(0.0, 0.0, shift=shift) for shift in SHIFTS_S),
)


@dataclass(frozen=True, eq=False)
class Course:
    """What a speed law needs of a scenario.

    Attributes:
        points: (P, 3) x, y [m], yaw [rad] of the route, STATION_STEP_M apart.
        length: way to the goal [m].
        reference: (T + 1,) speeds of the reference drive at the steps [m/s].
        loop: the scenario.
    """

    points: Floats
    length: float
    reference: Floats
    loop: ClosedLoop

    @classmethod
    def of(cls, loop: ClosedLoop) -> "Course | None":
        """Return the course of a scenario; None if the reference drive hardly moves."""
        witness = loop.world.motion[loop.ego, int(loop.scenario.present[loop.ego, 0]) :]
        way = edge_lengths(witness[:, :2])
        if way.sum() < 1.0:
            return None
        route = Curve.through(witness[np.concatenate([[True], way > 1e-3]), :2])
        stations = np.arange(0.0, route.length + STATION_STEP_M, STATION_STEP_M)
        times = loop.begin + loop.config.step * np.arange(loop.last_step + 1)
        end = loop.begin + loop.duration
        reference = np.interp(
            np.minimum(times, end), loop.scenario.time, loop.scenario.speed[loop.ego]
        )
        return cls(route.at(stations), route.length - GOAL_MARGIN_M, reference, loop)

    def speeds(self, laws: Sequence[SpeedLaw]) -> Floats:
        """Return the speeds (M, T + 1) [m/s] of laws at the steps."""
        step, limits = self.loop.config.step, self.loop.limits
        wait, speed, gain, after, stop, shift = np.array(laws).T
        count = len(self.reference)
        speeds = np.empty((len(laws), count))
        speeds[:, 0] = self.reference[0]
        is_shifted = ~np.isnan(shift)
        for k in range(1, count):
            time = (k - 1) * step + 1e-9
            left = time - wait
            stands = (left < 0.0) | ((left >= after) & (left < after + stop))
            wanted = np.where(stands, -np.inf, gain * (speed - speeds[:, k - 1]))
            source = np.clip(k * step - shift[is_shifted], 0.0, (count - 1) * step) / step
            target = np.interp(source, np.arange(count), self.reference)
            wanted[is_shifted] = (target - speeds[is_shifted, k - 1]) / step
            gained = step * np.clip(wanted, -limits.max_deceleration, limits.max_acceleration)
            speeds[:, k] = np.maximum(speeds[:, k - 1] + gained, 0.0)
        return speeds

    def passes(self, laws: Sequence[SpeedLaw]) -> Bools:
        """Return (M,) whether laws pass where the others drive as certified."""
        speeds = self.speeds(laws)
        ways = 0.5 * self.loop.config.step * (speeds[:, 1:] + speeds[:, :-1])
        stations = np.concatenate([np.zeros((len(laws), 1)), ways.cumsum(axis=1)], axis=1)
        occupied = np.zeros((stations.shape[1], len(self.points)), dtype=np.bool_)
        world, begin, no_one = self.loop.world, self.loop.begin, np.zeros_like(self.loop.insists)
        fill_occupied(world, begin, 0.0, no_one, self.points, occupied)
        for ahead in (0.5 * INSISTING_S, INSISTING_S):
            fill_occupied(world, begin, ahead, ~self.loop.insists, self.points, occupied)
        rows = np.minimum(
            (stations / STATION_STEP_M).round().astype(np.int64), len(self.points) - 1
        )
        hits = occupied[np.arange(stations.shape[1]), rows]
        arrived = stations >= self.length
        goal = np.where(arrived.any(axis=1), arrived.argmax(axis=1), stations.shape[1])
        before = np.arange(stations.shape[1]) < goal[:, None]
        return np.asarray(arrived.any(axis=1) & ~(hits & before).any(axis=1))


@kernel(WORLD, F, F, B1, F2, OUTB2)
def fill_occupied(
    world: World, begin: float, ahead: float, ignored: Bools, points: Floats, out: Bools
) -> None:
    """Mark where another vehicle is where the ego would be, as certified.

    Args:
        world: the scenario.
        begin: certified time [s] of the first step.
        ahead: time [s] by which the others are ahead.
        ignored: (N,) vehicles that do not count.
        points: (P, 3) poses of the ego.
        out: (T, P) for each step and pose.
    """
    pose = np.empty(5)
    box = np.empty(7)
    ego_box = np.empty(7)
    for pair in range(out.shape[0] * len(world.motion)):
        step = pair // len(world.motion)
        i = pair % len(world.motion)
        clock = begin + step * world.step
        has_left = world.leaves[i] and clock > world.spans[i, 1]
        if i == world.ego or ignored[i] or clock < world.spans[i, 0] or has_left:
            continue
        pose_at(world.time, world.motion[i], clock + ahead, pose)
        fill_footprint(pose, world.half[i], box)
        for p in range(len(points)):
            fill_footprint(points[p], world.half[world.ego], ego_box)
            out[step, p] = out[step, p] or boxes_meet(ego_box, box)


class LawFollower(RouteFollower):
    """Follows its route by a speed law."""

    def __init__(self, speeds: Floats) -> None:
        """Take the speeds (T + 1,) [m/s] of the law at the steps."""
        self.speeds = speeds

    def act(self, observation: Observation) -> Command:
        """Return the command that reaches the speed of the next step."""
        ego = observation.ego
        k = min(round(observation.time / self.task.step) + 1, len(self.speeds) - 1)
        gained = float(self.speeds[k]) - ego.speed
        return Command(gained / self.task.step, self.steer(ego)[0])


def drive_passes(loop: ClosedLoop, law: SpeedLaw) -> bool:
    """Return whether a speed law passes a scenario; the others react."""
    course = Course.of(loop)
    if course is None:
        return True
    return judge(loop, loop.drive(LawFollower(course.speeds([law])[0]))).passed


@dataclass(frozen=True)
class BlindRate:
    """How the best speed law does in a set.

    Attributes:
        law: the best of those that are driven.
        passed: number of scenarios that it passes.
        driven: number of scenarios.
    """

    law: SpeedLaw
    passed: int
    driven: int

    def document(self) -> dict[str, Any]:
        """Return it as JSON's types."""
        return {"planner": str(self.law), "passed": self.passed, "driven": self.driven}

    @property
    def is_trivial(self) -> bool:
        """Whether the set hardly tests a planner."""
        return self.passed > TRIVIAL_SHARE * self.driven

    def __str__(self) -> str:
        prefix = "these scenarios hardly test a planner: " if self.is_trivial else ""
        rate = f"{self.law}, passes {self.passed} of {self.driven}"
        return f"{prefix}the best of {len(FAMILY)} open-loop speed laws, {rate}"


def blind_rate(loops: Sequence[ClosedLoop]) -> BlindRate | None:
    """Return how the best speed law does in some scenarios; None without any."""
    if not loops:
        return None
    passes: Ints = np.sum([law_passes(loop) for loop in loops], axis=0)
    best = [FAMILY[row] for row in np.argsort(-passes, kind="stable")[:DRIVEN_COUNT]]
    rates = [
        BlindRate(law, sum(drive_passes(loop, law) for loop in loops), len(loops)) for law in best
    ]
    return max(rates, key=lambda rate: rate.passed)


def law_passes(loop: ClosedLoop) -> Bools:
    """Return (M,) whether each law of the family passes where the others drive as certified."""
    course = Course.of(loop)
    return np.ones(len(FAMILY), dtype=np.bool_) if course is None else course.passes(FAMILY)


def blind_sentence(
    cases: Sequence[GenerationResult], config: ClosedLoopConfig = ClosedLoopConfig()
) -> str:
    """Return in words how the best speed law does in sets from one recorded encounter.

    It drives in the first BLIND_COUNT scenarios with an ego slot; "" if there is none.
    """
    slots = [
        (case, scenario)
        for case in cases
        for scenario in case.generated.scenarios
        if case.generated.ego is not None
    ]
    loops = [
        ClosedLoop(join_ego(scenario), case.generated.ego.vehicle.id, case.road, config)
        for case, scenario in slots[:BLIND_COUNT]
        if case.generated.ego is not None
    ]
    rate = blind_rate(loops)
    if rate is None:
        return ""
    first = slots[0][0]
    place = f" on {first.road.name}" if first.road else ""
    return f"{first.encounter.recording}{place}, ego {loops[0].task().vehicle.id}: {rate}"
