# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Blind planners: they follow the route at speeds that do not depend on the other vehicles.

A set of scenarios tests a planner only if every blind planner fails in most of them. The family
has constant speeds, which are reached softly or at once, and the non-reactive baseline. A second
family is timed: it stands before it drives at a constant speed, or has the speeds of the reference
drive, earlier or later. Members stay exactly on the route, so one compiled loop drives all of
them; the others react to them as to any ego. A drive ends at the first contact, at the goal, or
when its time is over.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
import math
from typing import Any, NamedTuple

import numpy as np

from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.coordination_space import pose_at, WORLD, World
from scenario_gen.closed_loop.driver import CLOCK, DRIVER_PARAMETERS, DriverParameters, RATE
from scenario_gen.closed_loop.simulation import ClosedLoop
from scenario_gen.closed_loop.step import advance, ego_hits
from scenario_gen.method.evaluation import (
    MAX_ACCELERATION_MPS2,
    MAX_BRAKING_MPS2,
    STANDSTILL_MPS,
    wanted_speeds,
)
from scenario_gen.numerics import Bools, Floats, Ints
from scenario_gen.numerics.curve import Curve
from scenario_gen.numerics.kernels import F, F2, I, kernel, named, OUTB1
from scenario_gen.numerics.loops import copy_rows, copy_to
from scenario_gen.numerics.plane import edge_lengths
from scenario_gen.types import GenerationResult, join_ego

MIN_SPEED_MPS = 3.0  # a slower planner stands in the way, or misses the goal
TOP_SPEED_MPS = 15.0  # of the family where no reference drive is faster
SPEEDS_COUNT = 13  # constant speeds of the family
GAINS_PER_S = (1.0, 10.0)  # soft as `ConstantSpeed`, and as fast as the body can
STANDS_S = (1.0, 2.0, 3.0, 4.0, 6.0, 8.0)  # before constant speeds
SPEEDS_AFTER_STAND_COUNT = 4
SHIFTS_S = (-4.0, -2.0, -1.0, 1.0, 2.0, 4.0)  # of the speeds of the reference drive
STATION_STEP_M = 0.5  # between two points of a course
TRIVIAL_SHARE = 0.9  # a set of which a blind planner passes more hardly tests
BLIND_COUNT = 50  # scenarios of a set in which blind planners drive
GOAL_MARGIN_M = 0.2  # before the end of the route, as in `ClosedLoop.reached`


class BlindPlanner(NamedTuple):
    """A member of the family.

    Attributes:
        speed: constant speed [m/s]; NaN for the non-reactive baseline.
        gain: acceleration per speed error [1/s].
        stand: duration [s] for which it stands first; it brakes as hard as it can.
        shift: time [s] by which it is later than the reference drive, whose speeds it has; NaN
            for the other members.
    """

    speed: float
    gain: float = GAINS_PER_S[0]
    stand: float = 0.0
    shift: float = math.nan

    def __str__(self) -> str:
        if not math.isnan(self.shift):
            side = "later" if self.shift > 0.0 else "earlier"
            return f"the reference drive's speeds {abs(self.shift):g} s {side}"
        if math.isnan(self.speed):
            return "the non-reactive baseline"
        if self.stand:
            return f"standing for {self.stand:g} s, then {self.speed:g} m/s"
        return f"a constant {self.speed:g} m/s"


def _speeds(top_speed: float, count: int) -> list[float]:
    """Return some speeds [m/s] for reference drives with a highest speed [m/s]."""
    top = max(math.ceil(top_speed), TOP_SPEED_MPS)
    speeds: list[float] = np.round(np.geomspace(MIN_SPEED_MPS, top, count), 1).tolist()
    return speeds


def blind_family(top_speed: float) -> tuple[BlindPlanner, ...]:
    """Return the family for reference drives with a highest speed [m/s]; the baseline is first."""
    speeds = _speeds(top_speed, SPEEDS_COUNT)
    constant = [BlindPlanner(speed, gain) for gain in GAINS_PER_S for speed in speeds]
    return BlindPlanner(math.nan), *constant


def timed_family(top_speed: float) -> tuple[BlindPlanner, ...]:
    """Return the timed family for reference drives with a highest speed [m/s]."""
    speeds = _speeds(top_speed, SPEEDS_AFTER_STAND_COUNT)
    standing = [BlindPlanner(speed, stand=stand) for stand in STANDS_S for speed in speeds]
    return *standing, *(BlindPlanner(math.nan, shift=shift) for shift in SHIFTS_S)


class Course(NamedTuple):
    """The route of blind planners from a clock on, with its points STATION_STEP_M apart.

    Attributes:
        begin: certified time [s] at which they begin.
        speed: their first speed [m/s].
        acceleration: the body's largest acceleration [m/s²].
        deceleration: its largest deceleration [m/s²].
        length: way to the goal [m].
        steps: largest number of steps.
        points: (P, 5) x, y [m], yaw [rad], curvature [1/m], and speed of the baseline [m/s].
    """

    begin: float
    speed: float
    acceleration: float
    deceleration: float
    length: float
    steps: int
    points: Floats


COURSE = named(Course, F, F, F, F, F, I, F2)


def course_of(loop: ClosedLoop, begin: float) -> Course | None:
    """Return the course from a clock [s] of the reference drive on; None if it hardly moves."""
    world, limits = loop.world, loop.limits
    witness = world.motion[loop.ego, int(np.searchsorted(world.time, begin - 1e-9)) :]
    way = edge_lengths(witness[:, :2])
    if way.sum() < 1.0:
        return None
    route = Curve.through(witness[np.concatenate([[True], way > 1e-3]), :2])
    stations = np.arange(0.0, route.length + STATION_STEP_M, STATION_STEP_M)
    poses = route.at(stations)
    stops = bool(witness[-1, 3] < STANDSTILL_MPS)
    wanted = wanted_speeds(route, stations, float(witness[:, 3].max()), stops=stops)
    curvature = np.gradient(poses[:, 2], STATION_STEP_M)
    return Course(
        begin,
        float(witness[0, 3]),
        limits.max_acceleration,
        limits.max_deceleration,
        route.length - GOAL_MARGIN_M,
        loop.steps_from(begin),
        np.column_stack([poses, curvature, wanted]),
    )


def blind_passes(
    loop: ClosedLoop, family: Sequence[BlindPlanner], begin: float | None = None
) -> Bools:
    """Return (M,) whether each member of a family passes a scenario, from a clock [s] on."""
    out = np.ones(len(family), dtype=np.bool_)
    course = course_of(loop, loop.begin if begin is None else begin)
    if course is not None:
        drive_blindly(loop.world, loop.parameters, course, np.array(family), out)
    return out


@dataclass(frozen=True)
class BlindRate:
    """How the best blind planner does in a set.

    Attributes:
        planner: the best one.
        passed: number of scenarios that it passes.
        driven: number of scenarios.
        planners: number of blind planners.
        timed: how the best of the timed family does; None if it is not known.
    """

    planner: BlindPlanner
    passed: int
    driven: int
    planners: int
    timed: "BlindRate | None" = None

    @classmethod
    def of(cls, family: Sequence[BlindPlanner], passed: Ints, driven: int) -> "BlindRate":
        """Return the rate of the best member of a family that passes some scenarios (M,)."""
        best = int(passed.argmax())
        return cls(family[best], int(passed[best]), driven, len(family))

    def document(self) -> dict[str, Any]:
        """Return it as JSON's types."""
        document = {"planner": str(self.planner), "passed": self.passed, "driven": self.driven}
        return document if self.timed is None else document | {"timed": self.timed.document()}

    @property
    def is_trivial(self) -> bool:
        """Whether the set hardly tests a planner."""
        return self.passed > TRIVIAL_SHARE * self.driven

    def __str__(self) -> str:
        prefix = "these scenarios hardly test a planner: " if self.is_trivial else ""
        rate = f"{self.planner}, passes {self.passed} of {self.driven}"
        timed = ""
        if self.timed is not None:
            untested = " (waiting is not tested)" if self.timed.is_trivial else ""
            of_timed = f"{self.timed.planner}, passes {self.timed.passed}"
            timed = (
                f"; of {self.timed.planners} that stand first or are shifted, {of_timed}{untested}"
            )
        return f"{prefix}the best of {self.planners} blind planners, {rate}{timed}"


def blind_rate(loops: Sequence[ClosedLoop]) -> BlindRate | None:
    """Return how the best blind planner does in some scenarios; None without any."""
    if not loops:
        return None
    top_speed = max(loop.task().speed for loop in loops)
    rate, timed = (
        BlindRate.of(
            family, np.sum([blind_passes(loop, family) for loop in loops], axis=0), len(loops)
        )
        for family in (blind_family(top_speed), timed_family(top_speed))
    )
    return replace(rate, timed=timed)


@kernel(inline=True)
def _blind_speed(
    world: World, planner: Floats, course: Course, station: float, speed: float, begin: float
) -> float:
    """Return the speed [m/s] of a blind planner (4,) after a step that begins at a time [s].

    The fields of the planner are those of `BlindPlanner`.
    """
    h = world.step
    if not np.isnan(planner[3]):
        pose = np.empty(5)
        clock = course.begin + begin + h - planner[3]
        pose_at(world.time, world.motion[world.ego], max(clock, course.begin), pose)
        wanted = (pose[3] - speed) / h
    elif begin < planner[2]:
        wanted = -course.deceleration
    elif np.isnan(planner[0]):
        row = min(int(station / STATION_STEP_M), len(course.points) - 1)
        excess = speed / max(course.points[row, 4], 0.1)
        wanted = max(MAX_ACCELERATION_MPS2 * (1.0 - excess * excess), -MAX_BRAKING_MPS2)
    else:
        wanted = planner[1] * (planner[0] - speed)
    return float(max(speed + h * min(max(wanted, -course.deceleration), course.acceleration), 0.0))


@kernel(inline=True)
def _fill_ego(course: Course, station: float, speed: float, gained: float, out: Floats) -> None:
    """Write the `EgoState` (6,) on a course at a station [m]."""
    last = len(course.points) - 1
    row = min(int(station / STATION_STEP_M), last - 1)
    share = station / STATION_STEP_M - row
    for k in range(3):
        out[k] = course.points[row, k]
        out[k] += share * (course.points[row + 1, k] - course.points[row, k])
    out[3] = speed
    out[4] = course.points[row, 3]
    out[5] = gained


@kernel(WORLD, DRIVER_PARAMETERS, COURSE, F2, OUTB1)
def drive_blindly(
    world: World, parameters: DriverParameters, course: Course, family: Floats, out: Bools
) -> None:
    """Write whether each member (M, 4) of a family passes (M,)."""
    n = len(world.motion)
    oldest = 1
    for i in range(n):
        oldest = max(oldest, parameters.delay[i] + 1)
    before = np.empty((n, 4))
    after = np.empty((n, 5))
    vehicles = np.empty((n, 5))
    poses = np.empty((n, 4))
    seen = np.empty((oldest, 9))
    for m in range(len(family)):
        out[m] = False
        before[:] = 0.0
        before[:, CLOCK] = course.begin
        before[:, RATE] = 1.0
        for i in range(n):
            has_left = world.leaves[i] and course.begin >= world.spans[i, 1]
            vehicles[i, 4] = course.begin >= world.spans[i, 0] and not has_left
        passes = np.zeros((n, n), dtype=np.bool_)
        station = 0.0
        speed = course.speed
        _fill_ego(course, station, speed, 0.0, seen[0])
        seen[0, 6] = course.begin
        seen[0, 7:] = 1.0
        for step in range(1, course.steps + 1):
            begin = (step - 1) * world.step
            end_speed = _blind_speed(world, family[m], course, station, speed, begin)
            station += 0.5 * (speed + end_speed) * world.step
            known = min(step + 1, oldest)
            for row in range(known - 1, 0, -1):
                copy_to(seen[row], seen[row - 1])
            _fill_ego(course, station, end_speed, (end_speed - speed) / world.step, seen[0])
            speed = end_speed
            now = course.begin + step * world.step
            advance(world, parameters, now, before, seen[:known], passes, after, vehicles)
            copy_rows(before, after)
            copy_rows(poses, vehicles)
            if ego_hits(poses, world.half, vehicles[:, 4] > 0.0, world.ego):
                break
            if station >= course.length:
                out[m] = True
                break


def blind_sentence(case: GenerationResult, config: ClosedLoopConfig = ClosedLoopConfig()) -> str:
    """Return in words how the best blind planner does in a set; "" without an ego slot.

    It drives in the first BLIND_COUNT scenarios at most.
    """
    drawn = case.generated
    if drawn.ego is None or not drawn.scenarios:
        return ""
    ego = drawn.ego.vehicle.id
    scenarios = map(join_ego, drawn.scenarios[:BLIND_COUNT])
    rate = blind_rate([ClosedLoop(scenario, ego, case.road, config) for scenario in scenarios])
    return f"{case.title}, ego {ego}: {rate}"
