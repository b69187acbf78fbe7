# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The verdict on one drive: what went wrong, when and by whose doing, and how close it was."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from enum import StrEnum
import math
from typing import Any

import numpy as np

from scenario_gen.closed_loop.simulation import ClosedLoop, Drive
from scenario_gen.method.evaluation import footprint_distance, Motion, time_to_collision
from scenario_gen.method.validity import collision as apart
from scenario_gen.method.validity import containment as inside
from scenario_gen.method.validity import control_points
from scenario_gen.numerics import Bools, exact, Floats
from scenario_gen.roads import clearance_in_cells, footprint_fits
from scenario_gen.template import find_conflicts
from scenario_gen.types import Road

PARTS = 200  # of a step, to which the beginning of a contact is told
RESOLUTION = 1e-6  # seconds; what cannot be told apart over such an interval counts as a contact
JERK_OVER = 0.5  # seconds over which the change of acceleration is taken


class Runner(StrEnum):
    """Who ran into whom: whose own motion closed the gap."""

    EGO = "ego"
    OTHER = "other"
    BOTH = "both"


@dataclass(frozen=True)
class Collision:
    """The first contact of the ego: when [s], with whom, at which relative speed [m/s], and who ran into whom."""

    time: float
    vehicle: str
    speed: float
    ran: Runner


@dataclass(frozen=True)
class DriveVerdict:
    """What one drive came to. Times in seconds from the drive's start; NaN where there is no such thing.

    Attributes:
        index: of the scenario; seed: of its request; ego: id of the vehicle in whose place the ego drove.
        duration: length of the drive.
        collision: first contact with another vehicle, None if there is none at any instant.
        off_road: when the footprint first leaves drivable space, NaN if never, or if no road is known.
        goal: when the goal is reached; NaN if never.
        delay: by how much later than the witness.
        min_ttc: least time to collision, at most the horizon; min_gap: least distance of two footprints [m]; min_pet: least
            post-encroachment time at crossings, negative if both were inside.
        hardest_braking: m/s²; hard_braking: seconds of hard braking; jerk: largest change of acceleration over 0.5 s [m/s³].
        progress: share of the witness' way that was driven, by its path.
        faults: steps in which a command was missing, not finite, or a jump.
        among_others: contacts of the others among themselves; there are none.
        forced: how many times one of the others braked harder than the strongest braking, to keep the order.
    """

    index: int
    seed: int
    ego: str
    duration: float
    collision: Collision | None
    off_road: float
    goal: float
    delay: float
    min_ttc: float
    min_gap: float
    min_pet: float
    hardest_braking: float
    hard_braking: float
    jerk: float
    progress: float
    faults: int
    among_others: int
    forced: int
    road_known: bool = True

    @property
    def passed(self) -> bool:
        """Whether the ego came to its goal on the road and without a collision."""
        return self.collision is None and math.isnan(self.off_road) and not math.isnan(self.goal)

    @property
    def severity(self) -> tuple[float, ...]:
        """Sorts verdicts, the worst last: collision by speed, off-road, goal not reached, then the least time to collision."""
        hit = self.collision.speed if self.collision else -1.0
        return (hit, float(not math.isnan(self.off_road)), float(math.isnan(self.goal)), -self.min_ttc, -self.min_gap)

    def sentence(self) -> str:
        """Say in words what it came to."""
        messages = []
        if (hit := self.collision) is not None:
            words = {
                Runner.EGO: f"the ego ran into {hit.vehicle}",
                Runner.OTHER: f"{hit.vehicle} ran into the ego",
                Runner.BOTH: f"the ego and {hit.vehicle} ran into each other",
            }
            messages.append(f"{words[hit.ran]} at {hit.time:.2f} s and {hit.speed:.1f} m/s")
        if not math.isnan(self.off_road):
            messages.append(f"left the road at {self.off_road:.2f} s")
        if math.isnan(self.goal):
            messages.append(f"did not reach its goal, {100.0 * self.progress:.0f} % of the way")
        elif not messages:
            messages.append(f"reached its goal at {self.goal:.1f} s")
        if self.faults:
            messages.append(f"{self.faults} faulty command(s)")
        return "; ".join(messages)

    def document(self) -> dict[str, Any]:
        """Return it as JSON's types; null for what there is not."""
        plain = asdict(self) | {"passed": self.passed, "sentence": self.sentence()}
        return {key: None if isinstance(value, float) and math.isnan(value) else value for key, value in plain.items()}


def judge(loop: ClosedLoop, drive: Drive) -> DriveVerdict:
    """Judge one drive.

    Collisions and the road are looked at in continuous time, by the motion that `Scenario` defines between two instants.
    """
    motion, ego = drive.motion, drive.ego
    time, n = motion.time, len(motion.vehicles)
    config, known = loop.config, loop.certified
    others = [i for i in range(n) if i != ego]
    contacts = {(i, j): _contact(drive, i, j) for i in range(n) for j in range(i)}
    hits = [(contacts[max(ego, i), min(ego, i)], i) for i in others]
    first, who = min(((at, i) for at, i in hits if at is not None), default=(math.nan, -1))
    goal = _goal_time(loop, drive)
    pieces = [(Motion(motion.vehicles, config.step, motion.position, motion.heading, motion.speed), i) for i in others]
    seen = [drive.here[i] for i in others]
    ttc = [np.where(here, time_to_collision(m, ego, i), np.inf).min() for (m, i), here in zip(pieces, seen, strict=True)]
    gap = [np.where(here, footprint_distance(m, ego, i), np.inf).min() for (m, i), here in zip(pieces, seen, strict=True)]
    braking = np.maximum(-drive.accelerations, 0.0)
    way = known.cells[ego, :, 7]
    reached = float(np.interp(drive.clock[ego, -1], np.arange(len(way)) * 0.1, way))
    whole = float(way[-1])
    return DriveVerdict(
        index=motion.index,
        seed=motion.seed,
        ego=motion.vehicles[ego].id,
        duration=float(time[-1]),
        collision=None if who < 0 else _collision(drive, first, who),
        off_road=math.nan if loop.road is None else _off_road(drive, loop.road),
        goal=goal,
        delay=goal - loop.duration,
        min_ttc=float(min((config.horizon, *ttc))),
        min_gap=float(min(gap, default=math.nan)),
        min_pet=_pet(drive),
        hardest_braking=float(braking.max()),
        hard_braking=round(int(np.count_nonzero(braking[1:] >= config.hard_braking)) * config.step, 9),
        jerk=_jerk(drive.accelerations, config.step),
        progress=1.0 if not math.isnan(goal) or whole <= 0.0 else min(reached / whole, 1.0),
        faults=len(drive.faults),
        among_others=len([1 for (i, j), at in contacts.items() if ego not in (i, j) and at is not None]),
        forced=drive.forced,
        road_known=loop.road is not None,
    )


def _contact(drive: Drive, i: int, j: int) -> float | None:
    """Time [s] of the first contact of two vehicles while both are on the scene, None if they never touch."""
    motion = drive.motion
    both = np.flatnonzero(drive.here[i] & drive.here[j])
    if len(both) < 2:
        return None
    span = slice(both[0], both[-1] + 1)
    pair = [i, j]
    time, position = motion.time[span], motion.position[pair][:, span]
    heading, speed = motion.heading[pair][:, span], motion.speed[pair][:, span]
    control, out = np.empty((2, len(time) - 1, 4, 2)), np.empty((1, 3))
    control_points(time, position, heading, speed, control)
    half = np.array([(0.5 * motion.vehicles[k].length, 0.5 * motion.vehicles[k].width) for k in pair])
    apart.first_contacts(time, control, heading, half, 0.0, RESOLUTION, out)
    return (
        None if out[0, 0] == apart.PROVEN else _first(drive, pair, float(out[0, 1]), lambda m: footprint_distance(m, 0, 1) <= 0.0)
    )


def _first(drive: Drive, rows: list[int], found: float, wrong: Callable[[Motion], Bools]) -> float:
    """Time [s] at which something begins to be wrong, to a PART of its step; what the proof gives is any instant of it."""
    motion, step = drive.motion, float(drive.motion.time[1])
    k = min(int(found / step + 1e-9), len(motion.time) - 2)
    start = float(motion.time[k])
    u = np.linspace(0.0, max(found - start, 0.0) / step, PARTS + 1)[:, None]
    v, w = 1.0 - u, 3.0 - 2.0 * u
    position = []
    for i in rows:
        yaw, speed = motion.heading[i, k : k + 2], motion.speed[i, k : k + 2]
        way = step * speed[:, None] * np.stack([exact.cos(yaw), exact.sin(yaw)], axis=1)
        p, q = motion.position[i, k], motion.position[i, k + 1]
        position.append((1.0 + 2.0 * u) * v * v * p + u * v * v * way[0] + u * u * w * q - u * u * v * way[1])
    heading = motion.heading[rows, k, None] + u[:, 0] * (motion.heading[rows, k + 1] - motion.heading[rows, k])[:, None]
    vehicles = tuple(motion.vehicles[i] for i in rows)
    flags = wrong(Motion(vehicles, step / PARTS, np.stack(position), heading, np.zeros_like(heading)))
    return start + float(u[np.argmax(flags), 0]) * step if flags.any() else found


def _collision(drive: Drive, at: float, who: int) -> Collision:
    """Say how fast and by whom: the speeds of both towards each other, along the line of their centres."""
    motion = drive.motion
    state = []
    for i in (drive.ego, who):
        x, y = (float(np.interp(at, motion.time, motion.position[i, :, axis])) for axis in range(2))
        yaw, speed = (float(np.interp(at, motion.time, each[i])) for each in (motion.heading, motion.speed))
        state.append((x, y, speed * exact.cos(yaw), speed * exact.sin(yaw)))
    (x, y, vx, vy), (ox, oy, wx, wy) = state
    away = max(float(exact.hypot(ox - x, oy - y)), 1e-9)
    dx, dy = (ox - x) / away, (oy - y) / away
    mine, its = vx * dx + vy * dy, -(wx * dx + wy * dy)
    if mine > 2.0 * max(its, 0.0):
        ran = Runner.EGO
    elif its > 2.0 * max(mine, 0.0):
        ran = Runner.OTHER
    else:
        ran = Runner.BOTH
    return Collision(at, motion.vehicles[who].id, float(exact.hypot(vx - wx, vy - wy)), ran)


def _off_road(drive: Drive, road: Road) -> float:
    """Time [s] at which the ego's footprint first leaves drivable cells, NaN if never."""
    motion, ego = drive.motion, [drive.ego]
    control, out = np.empty((1, len(motion.time) - 1, 4, 2)), np.empty((1, 2))
    control_points(motion.time, motion.position[ego], motion.heading[ego], motion.speed[ego], control)
    vehicle = motion.vehicles[drive.ego]
    inside.first_exits(
        motion.time,
        control,
        motion.heading[ego],
        np.array([(0.5 * vehicle.length, 0.5 * vehicle.width)]),
        clearance_in_cells(road),
        inside.blocked_before(road.drivable),
        np.array((*road.origin, road.resolution)),
        RESOLUTION,
        out,
    )
    if out[0, 0] == inside.PROVEN:
        return math.nan

    def off(fine: Motion) -> Bools:
        poses = np.column_stack([fine.position[0], fine.heading[0]])
        return ~footprint_fits(road, poses, vehicle.length, vehicle.width)

    return _first(drive, ego, float(out[0, 1]), off)


def _goal_time(loop: ClosedLoop, drive: Drive) -> float:
    """Time [s] of the first instant at which the ego is at its goal, NaN if it never is."""
    motion, ego = drive.motion, drive.ego
    poses = np.concatenate([motion.position[ego], motion.heading[ego, :, None]], axis=1)
    times = zip(motion.time.tolist(), poses, strict=True)
    return next((time for time, pose in times if loop.at_goal(time, pose)), math.nan)


def _pet(drive: Drive) -> float:
    """Least post-encroachment time [s] of the ego at crossings; NaN without one. Source: Allen, Shin & Cooper 1978."""
    motion, ego, found = drive.motion, drive.ego, []
    for i in range(len(motion.vehicles)):
        span = np.flatnonzero(drive.here[i])
        if i == ego or len(span) < 2:
            continue
        part, pair = slice(span[0], span[-1] + 1), [ego, i]
        vehicles = (motion.vehicles[ego], motion.vehicles[i])
        position, heading = motion.position[pair][:, part], motion.heading[pair][:, part]
        conflicts = find_conflicts(vehicles, motion.time[part], position, heading)
        found += [one.encroachment for one in conflicts if not one.following]
    return min(found, default=math.nan)


def _jerk(acceleration: Floats, step: float) -> float:
    """Largest change of acceleration [m/s³] over JERK_OVER; the first instant has none yet."""
    over = max(round(JERK_OVER / step), 1)
    change = acceleration[1 + over :] - acceleration[1:-over]
    return float(np.abs(change).max(initial=0.0)) / (over * step)
