# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The verdict on one drive: its failures, their times and causes, and the closest approaches."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
import math
from typing import Any

import numpy as np

from scenario_gen.closed_loop.contacts import contact_times
from scenario_gen.closed_loop.criteria import CheckedCriterion, CriterionResult
from scenario_gen.closed_loop.drive import Drive
from scenario_gen.closed_loop.fault import Contact, CutIn, Reason, reason_of, STANDSTILL_MPS
from scenario_gen.closed_loop.imposed import imposed_braking
from scenario_gen.closed_loop.lights import ran_red
from scenario_gen.closed_loop.off_road import (
    DEPTH_ERROR_M,
    first_obstacle,
    MAX_DEPTH_M,
    road_use,
)
from scenario_gen.closed_loop.simulation import ClosedLoop
from scenario_gen.method.evaluation import distance_and_ttc
from scenario_gen.numerics import Floats, unit
from scenario_gen.situation import conflict_of, encroachment

JERK_WINDOW_S = 0.5
MAX_TTC_S = 8.0
MIN_STANDSTILL_S = 5.0  # an ego that stood so long at the end missed its goal for that reason


class Runner(StrEnum):
    """Whose motion closed the gap."""

    EGO = "ego"
    OTHER = "other"
    BOTH = "both"


@dataclass(frozen=True)
class Collision:
    """The first contact of the ego.

    Attributes:
        time: time of the contact [s].
        vehicle: id of the other vehicle.
        speed: relative speed [m/s].
        ran: the vehicle that closed the gap; it is not always at fault.
        reason: the reason, which decides whose fault it was.
        cut_in: how the ego entered the other one's path ahead of it or at its side, if it did and
            both drove in the same direction.
    """

    time: float
    vehicle: str
    speed: float
    ran: Runner
    reason: Reason
    cut_in: CutIn | None = None

    @property
    def why(self) -> str:
        """The reason and the fault, in words."""
        words = self.reason.value.replace("_", " ")
        if self.cut_in is not None and self.reason in (Reason.CUT_IN, Reason.OTHER_RAN_INTO_EGO):
            gap, safe_gap = self.cut_in.gap, self.cut_in.safe_gap
            words = f"{words}, entered {gap:.1f} m ahead; RSS requires {safe_gap:.1f} m"
        return f"{words}; {'' if self.reason.at_fault else 'not '}at fault"


@dataclass(frozen=True)
class DriveVerdict:
    """The verdict on one drive.

    Times are in seconds from the drive's start; a value that does not exist is NaN.

    Attributes:
        index: index of the scenario.
        seed: seed of its request.
        ego: id of the vehicle that the ego replaced.
        duration: duration of the drive.
        collision: first contact with another vehicle; None without a contact.
        off_road: first time at which the footprint was `off_road_depth` outside the drivable area
            or touched an obstacle; NaN if never, or if no road is known.
        obstacle: the obstacle that it touched then, "" if none.
        goal: time at the goal; NaN if the ego never reached it.
        delay: delay at the goal with respect to the witness.
        min_ttc: least time to collision, at most MAX_TTC_S; 0 at a contact.
        min_gap: least distance of two footprints [m]; 0 at a contact.
        min_pet: least post-encroachment time at crossings and merges, negative if both were
            inside; 0 at a contact.
        hardest_braking: largest deceleration [m/s²].
        hard_braking: duration of hard braking.
        jerk: largest change of acceleration over 0.5 s [m/s³].
        progress: share of the witness' path that was driven on the road.
        faults: number of steps with a jump or with a command that was missing or not finite.
        among_others: number of contacts among the others; always 0.
        forced: number of times that one of the others braked harder than the strongest braking, to
            preserve the order.
        road_known: whether the road is known.
        road_margin: least signed distance [m] from the footprint to the area that is not drivable:
            positive inside, negative the greatest depth outside; at most 10 m either way; NaN if
            no road is known.
        off_road_depth: depth [m] from which a footprint is off the road.
        jumps: number of poses that no vehicle can reach in a step.
        stood: duration for which the ego stood at the end of the drive.
        criteria: results of the user's criteria.
        ran_red: first time at which the ego crossed a stop line at red; NaN if never.
        error: the error of the planner, or of a criterion, that ended the drive; "" without one.
        imposed_braking: hardest braking [m/s²] of a vehicle whose turn the ego takes.
        took_turn: whether that is hard braking.
    """

    index: int
    seed: int
    ego: str
    duration: float
    collision: Collision | None
    off_road: float
    obstacle: str
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
    road_known: bool
    road_margin: float
    off_road_depth: float
    jumps: int
    stood: float
    criteria: tuple[CriterionResult, ...] = ()
    ran_red: float = math.nan
    error: str = ""
    imposed_braking: float = 0.0
    took_turn: bool = False

    @property
    def missed(self) -> list[CriterionResult]:
        """The criteria that the drive misses."""
        return [result for result in self.criteria if result.missed]

    @property
    def passed(self) -> bool:
        """Whether the ego reached its goal without a jump, a collision or leaving the road.

        A drive that passes also runs no red light and meets all criteria.
        """
        return not self.failure

    @property
    def events(self) -> dict[str, bool]:
        """Which failures happened, the one that counts before others first."""
        return {
            "error": bool(self.error),
            "jump": self.jumps > 0,
            "collision": self.collision is not None,
            "off_road": not math.isnan(self.off_road),
            "ran_red": not math.isnan(self.ran_red),
            "took_turn": self.took_turn,
            "goal": math.isnan(self.goal),
        } | {result.name: True for result in self.missed}

    @property
    def at_fault(self) -> bool:
        """Whether the ego collided by its own fault, as `Reason` defines it."""
        return self.collision is not None and self.collision.reason.at_fault

    @property
    def failure(self) -> str:
        """The first that applies; "" if the ego passed.

        One of: error, jump, collision, off_road, ran_red, took_turn, goal, the name of a
        criterion.
        """
        return next((name for name, happened in self.events.items() if happened), "")

    @property
    def fault(self) -> str:
        """The cause of the failure; "" if the ego passed.

        One of: error, jump, the reason of a collision, off_road, obstacle, ran_red, took_turn,
        standing (at the end, before the goal), goal (missed otherwise), the name of a criterion.
        """
        if self.error:
            return "error"
        if self.collision is not None and not self.jumps:
            return self.collision.reason.value
        if self.failure == "off_road" and self.obstacle:
            return "obstacle"
        stands = self.failure == "goal" and self.stood >= MIN_STANDSTILL_S
        return "standing" if stands else self.failure

    @property
    def severity(self) -> tuple[float, ...]:
        """A key that sorts verdicts, the worst last.

        Collisions by speed, then leaving the road, a red light, taking another one's turn, a
        missed goal, missed criteria, and the least time to collision.
        """
        hit = self.collision.speed if self.collision else -1.0
        happened = self.events
        return (
            hit,
            *(float(happened[name]) for name in ("off_road", "ran_red", "took_turn", "goal")),
            float(len(self.missed)),
            -self.min_ttc,
            -self.min_gap,
        )

    def sentence(self) -> str:
        """Return the verdict in words."""
        messages = [f"failed at {self.duration:.1f} s: {self.error}"] if self.error else []
        if (hit := self.collision) is not None:
            words = {
                Runner.EGO: f"the ego ran into {hit.vehicle}",
                Runner.OTHER: f"{hit.vehicle} ran into the ego",
                Runner.BOTH: f"the ego and {hit.vehicle} ran into each other",
            }[hit.ran]
            messages.append(f"{words} at {hit.time:.2f} s and {hit.speed:.1f} m/s ({hit.why})")
        if not math.isnan(self.off_road):
            is_far = self.road_margin <= DEPTH_ERROR_M - MAX_DEPTH_M
            depth = f"more than {MAX_DEPTH_M:g} m" if is_far else f"{-self.road_margin:.2f} m"
            event = f"ran into obstacle `{self.obstacle}`" if self.obstacle else "left the road"
            messages.append(f"{event} at {self.off_road:.2f} s (by {depth})")
        if not math.isnan(self.ran_red):
            messages.append(f"ran a red light at {self.ran_red:.2f} s")
        if self.took_turn:
            braking = f"{self.imposed_braking:.1f} m/s²"
            messages.append(f"took the turn of another vehicle, which braked at {braking}")
        if self.jumps:
            messages.append(f"{self.jumps} teleport(s): poses that cannot be reached in a step")
        if math.isnan(self.goal):
            stands = ", stood at the end" if self.stood >= MIN_STANDSTILL_S else ""
            messages.append(
                f"did not reach its goal, {100.0 * self.progress:.0f} % of the route{stands}"
            )
        messages += map(str, self.missed)
        if not messages:
            messages.append(f"reached its goal at {self.goal:.1f} s")
        if self.faults:
            messages.append(f"{self.faults} faulty command(s)")
        return "; ".join(messages)

    def document(self) -> dict[str, Any]:
        """Return the verdict as JSON's types, with null for NaN."""
        criteria = [
            {
                "name": result.name,
                "value": result.value if math.isfinite(result.value) else None,
                "threshold": result.threshold,
                "met": not result.missed,
            }
            for result in self.criteria
        ]
        plain = asdict(self) | {
            "passed": self.passed,
            "at_fault": self.at_fault,
            "fault": self.fault,
            "sentence": self.sentence(),
            "criteria": criteria,
        }
        return {
            key: None if isinstance(value, float) and math.isnan(value) else value
            for key, value in plain.items()
        }


def judge(
    loop: ClosedLoop, drive: Drive, criteria: Sequence[CheckedCriterion] | None = None
) -> DriveVerdict:
    """Judge one drive, by default with the criteria of the loop.

    Collisions and exits from the road are detected in continuous time, on the motion that
    `Scenario` defines between two instants. A jump is not a motion: the ego meets nobody on its
    way, and after it the ego neither reaches its goal nor leaves the road.

    Raises:
        InputError: a criterion fails.
    """
    motion, config = drive.motion, loop.config
    used = loop.criteria if criteria is None else criteria
    contacts = contact_times(drive)
    hit = _first_of_ego(drive, contacts)
    goal = _goal_time(loop, drive)
    imposed = imposed_braking(loop, drive)
    min_gap, min_ttc = _clearance(drive, hit)
    braking = np.maximum(-drive.accelerations, 0.0)
    hard_braking_count = int(np.count_nonzero(braking[1:] >= config.hard_braking))
    road = road_use(drive, loop.road, config.off_road_depth)
    off_road, obstacle = road.time, ""
    touched = first_obstacle(drive, loop.road)
    # An obstacle is touched at most 0.5 s later than the cells that it closes.
    if touched is not None and not touched[0] > off_road + 0.5:
        off_road, obstacle = float(np.fmin(off_road, touched[0])), str(touched[1])
    is_at_goal = not (math.isnan(goal) or off_road < goal)
    progress = 1.0 if is_at_goal else _progress(loop, drive, off_road)
    return DriveVerdict(
        index=motion.index,
        seed=motion.seed,
        ego=motion.vehicles[drive.ego].id,
        duration=float(motion.time[-1]),
        collision=None if hit is None else _collision(loop, drive, *hit),
        off_road=off_road,
        obstacle=obstacle,
        goal=goal,
        delay=goal - loop.duration,
        min_ttc=min_ttc,
        min_gap=min_gap,
        min_pet=_pet(drive, math.nan if hit is None else 0.0),
        hardest_braking=float(braking.max()),
        hard_braking=round(hard_braking_count * config.step, 9),
        jerk=_jerk(drive.accelerations, config.step),
        progress=progress,
        faults=len(drive.faults),
        among_others=len([pair for pair in contacts if drive.ego not in pair]),
        forced=drive.forced,
        road_known=loop.road is not None,
        road_margin=road.margin,
        off_road_depth=config.off_road_depth,
        jumps=len(drive.jumps),
        stood=_stood(motion.speed[drive.ego], config.step),
        criteria=tuple(measure(replace(drive, road=loop.road)) for measure in used),
        ran_red=ran_red(drive.motion, drive.ego, drive.driven),
        imposed_braking=imposed,
        took_turn=imposed >= config.hard_braking,
    )


def _first_of_ego(
    drive: Drive, contacts: dict[tuple[int, int], float]
) -> tuple[float, int] | None:
    """Return the time [s] at which the ego first touches a vehicle, and which; None if never."""
    hits = [(time, sum(pair) - drive.ego) for pair, time in contacts.items() if drive.ego in pair]
    return min(hits, default=None)


def _clearance(drive: Drive, hit: tuple[float, int] | None) -> tuple[float, float]:
    """Return the least distance [m] and TTC [s] of the ego and the others.

    Without others the distance is NaN. The TTC is at most MAX_TTC_S.
    """
    gap, ttc = math.nan, MAX_TTC_S
    for i in range(len(drive.motion.vehicles)):
        if i == drive.ego:
            continue
        distance, to_contact = distance_and_ttc(drive.motion, drive.ego, i)
        distance = np.where(drive.present[i], distance, np.inf)
        to_contact = np.where(drive.present[i], to_contact, np.inf)
        if hit is not None and hit[1] == i:  # between two instants, or after the last one
            k = int(np.searchsorted(drive.motion.time[:-1], hit[0]))
            distance[k] = to_contact[k] = 0.0
        gap = float(np.fmin(gap, distance.min()))
        ttc = min(ttc, float(to_contact.min()))
    return gap, ttc


def _progress(loop: ClosedLoop, drive: Drive, off_road: float) -> float:
    """Return the share of the witness' path that the ego drove until it left the road [s]."""
    on_road = drive.clock[drive.ego][~(drive.motion.time > off_road)]
    clocks = np.array([on_road[-1], np.inf])
    driven, length = loop.driven_distance(drive.ego, clocks).tolist()
    return min(driven / length, 1.0) if length > 0.0 else 1.0


def _stood(speed: Floats, step: float) -> float:
    """Return the duration [s] for which a vehicle stood at the end."""
    moved = np.flatnonzero(speed >= STANDSTILL_MPS)
    return round((len(speed) - 1 - (int(moved[-1]) if len(moved) else 0)) * step, 9)


def _collision(loop: ClosedLoop, drive: Drive, time: float, other_index: int) -> Collision:
    """Return the facts of a contact at a time [s] with a vehicle.

    The speeds along the line of the centres decide which vehicle closed the gap.
    """
    contact = Contact(loop, drive, other_index, time)
    ego, other = contact.ego_state, contact.other_state
    velocity, other_velocity = ego.speed * unit(ego.yaw), other.speed * unit(other.yaw)
    offset = np.subtract(other[:2], ego[:2])
    direction = offset / max(math.hypot(*offset), 1e-9)
    closing, other_closing = float(velocity @ direction), float(-other_velocity @ direction)
    runner = Runner.BOTH
    if closing > 2.0 * max(other_closing, 0.0):
        runner = Runner.EGO
    elif other_closing > 2.0 * max(closing, 0.0):
        runner = Runner.OTHER
    return Collision(
        time=time,
        vehicle=drive.motion.vehicles[other_index].id,
        speed=math.hypot(*(velocity - other_velocity)),
        ran=runner,
        reason=reason_of(contact),
        cut_in=contact.cut_in,
    )


def _goal_time(loop: ClosedLoop, drive: Drive) -> float:
    """Return the time [s] of the first instant at the goal, before any jump; NaN without one."""
    motion, ego, until = drive.motion, drive.ego, slice(drive.driven)
    poses = np.column_stack([motion.position[ego, until], motion.heading[ego, until]])
    reached = loop.reached(motion.time[until], poses)
    return float(motion.time[np.argmax(reached)]) if reached.any() else math.nan


def _pet(drive: Drive, most: float) -> float:
    """Return the ego's least post-encroachment time [s], at most `most`.

    It is `most` if nobody crosses or merges; NaN is no limit.

    Source: Allen, Shin & Cooper 1978.
    """
    motion, ego = drive.motion, drive.ego
    times: list[float] = []
    for i in range(len(motion.vehicles)):
        span = np.flatnonzero(drive.present[i])
        if i == ego or len(span) < 2:
            continue
        pair = motion.select([ego, i], int(span[0]), int(span[-1]))
        conflict = conflict_of(pair, 0, 1)
        if conflict is not None:
            times.append(encroachment(pair, conflict))
    return float(np.fmin.reduce(times, initial=most))


def _jerk(acceleration: Floats, step: float) -> float:
    """Return the largest jerk [m/s³] over JERK_WINDOW_S, without the first instant."""
    over = max(round(JERK_WINDOW_S / step), 1)
    change = acceleration[1 + over :] - acceleration[1:-over]
    return float(np.abs(change).max(initial=0.0)) / (over * step)
