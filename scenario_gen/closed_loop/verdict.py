# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The verdict on one drive: what went wrong, when and by whose doing, and how close it was."""

from dataclasses import asdict, dataclass
import math
from typing import Any

import numpy as np

from scenario_gen.closed_loop.fault import (
    Contact,
    CutIn,
    Reason,
    reason_of,
    Runner,
    STANDSTILL_MPS,
)
from scenario_gen.closed_loop.off_road import PARTS, RESOLUTION, road_use
from scenario_gen.closed_loop.score import not_behind, Terms, terms
from scenario_gen.closed_loop.simulation import ClosedLoop, Drive
from scenario_gen.method.evaluation import distance_and_ttc, footprint_distance
from scenario_gen.method.validity import first_contacts, Proof
from scenario_gen.numerics import Floats
from scenario_gen.numerics.hermite import control_points
from scenario_gen.numerics.plane import unit
from scenario_gen.situation import find_conflicts
from scenario_gen.types import Scenario

__all__ = ["Collision", "DriveVerdict", "Reason", "Runner", "judge"]

JERK_OVER = 0.5  # seconds over which the change of acceleration is taken
STANDING = (
    5.0  # seconds at its end for which a drive has stood, if that is why the goal was missed
)


@dataclass(frozen=True)
class Collision:
    """The first contact of the ego.

    Attributes:
        time: when [s]; vehicle: with whom; speed: relative [m/s].
        ran: who closed the gap; that says nothing of fault.
        reason: why they met, and so whose fault it was.
        cut_in: how the ego came into the other's way ahead of it or beside it, if it did and both
            drove the same way.
    """

    time: float
    vehicle: str
    speed: float
    ran: Runner
    reason: Reason
    cut_in: CutIn | None = None

    @property
    def why(self) -> str:
        """The reason and whose fault it was, in words."""
        words = self.reason.value.replace("_", " ")
        if self.cut_in is not None and self.reason in (Reason.CUT_IN, Reason.OTHER_RAN_INTO_EGO):
            words = f"{words}, came in {self.cut_in.gap:.1f} m ahead; RSS asks for {self.cut_in.safe_gap:.1f} m"
        return f"{words}; {'' if self.reason.at_fault else 'not '}at fault"


@dataclass(frozen=True)
class DriveVerdict:
    """What one drive came to. Times in seconds from the drive's start; NaN where there is no such thing.

    Attributes:
        index: of the scenario; seed: of its request; ego: id of the vehicle in whose place the ego
            drove.
        duration: length of the drive.
        collision: first contact with another vehicle, None if there is none at any instant.
        off_road: when the footprint was first as deep outside drivable space as counts, NaN if
            never, or if no road is known.
        road_margin: least signed distance [m] of the footprint to what is not drivable: positive
            inside, negative the greatest depth outside; at most 10 m either way; NaN if no road is
            known.
        off_road_depth: depth [m] from which a footprint is off the road; off_road_area: greatest
            part of it outside [m²].
        goal: when the goal is reached; NaN if never.
        delay: by how much later than the witness.
        min_ttc: least time to collision, at most the horizon; min_gap: least distance of two
            footprints [m]; min_pet: least post-encroachment time at crossings, negative if both
            were inside.
        hardest_braking: m/s²; hard_braking: seconds of hard braking; jerk: largest change of
            acceleration over 0.5 s [m/s³].
        progress: share of the witness' way that was driven, by its path.
        faults: steps in which a command was missing, not finite, or a jump.
        jumps: of these, poses that no vehicle can reach in a step, and those that are no place.
        stood: seconds for which the ego stood at the end of the drive.
        terms: those of nuPlan's and NAVSIM's scores.
        among_others: contacts of the others among themselves; there are none.
        forced: how many times one of the others braked harder than the strongest braking, to keep
            the order.
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
    road_known: bool
    road_margin: float
    off_road_depth: float
    off_road_area: float
    jumps: int
    stood: float
    terms: Terms

    @property
    def passed(self) -> bool:
        """Whether the ego came to its goal on the road, by driving there, and without a collision."""
        return (
            self.collision is None
            and math.isnan(self.off_road)
            and not math.isnan(self.goal)
            and not self.jumps
        )

    @property
    def at_fault(self) -> bool:
        """Whether it met another by its own fault, as `Reason` says."""
        return self.collision is not None and self.collision.reason.at_fault

    @property
    def failure(self) -> str:
        """What went wrong first of these: jump, collision, off_road, goal; "" if it passed."""
        if self.passed:
            return ""
        if self.jumps:
            return "jump"
        if self.collision is not None:
            return "collision"
        return "off_road" if not math.isnan(self.off_road) else "goal"

    @property
    def fault(self) -> str:
        """Why it failed: jump, the reason of a collision, off_road, standing, or goal (missed otherwise); "" if it passed."""
        if self.collision is not None and not self.jumps:
            return self.collision.reason.value
        stands = self.failure == "goal" and self.stood >= STANDING
        return "standing" if stands else self.failure

    @property
    def severity(self) -> tuple[float, ...]:
        """Sorts verdicts, the worst last: collision by speed, off-road, goal not reached, then the least time to collision."""
        hit = self.collision.speed if self.collision else -1.0
        return (
            hit,
            float(not math.isnan(self.off_road)),
            float(math.isnan(self.goal)),
            -self.min_ttc,
            -self.min_gap,
        )

    def sentence(self) -> str:
        """Say in words what it came to."""
        messages = []
        if (hit := self.collision) is not None:
            words = {
                Runner.EGO: f"the ego ran into {hit.vehicle}",
                Runner.OTHER: f"{hit.vehicle} ran into the ego",
                Runner.BOTH: f"the ego and {hit.vehicle} ran into each other",
            }
            messages.append(
                f"{words[hit.ran]} at {hit.time:.2f} s and {hit.speed:.1f} m/s ({hit.why})"
            )
        if not math.isnan(self.off_road):
            depth = f"{-self.road_margin:.2f} m deep, {self.off_road_area:.1f} m² of its footprint"
            messages.append(f"left the road at {self.off_road:.2f} s ({depth})")
        if self.jumps:
            messages.append(f"{self.jumps} teleport(s): poses that cannot be reached in a step")
        if math.isnan(self.goal):
            stands = ", stood at the end" if self.stood >= STANDING else ""
            messages.append(
                f"did not reach its goal, {100.0 * self.progress:.0f} % of the route{stands}"
            )
        elif not messages:
            messages.append(f"reached its goal at {self.goal:.1f} s")
        if self.faults:
            messages.append(f"{self.faults} faulty command(s)")
        return "; ".join(messages)

    def document(self) -> dict[str, Any]:
        """Return it as JSON's types; null for what there is not."""
        plain = asdict(self) | {
            "passed": self.passed,
            "at_fault": self.at_fault,
            "fault": self.fault,
        }
        plain["sentence"] = self.sentence()
        plain["terms"] |= {"nuplan": self.terms.nuplan, "pdms": self.terms.pdms}
        return {
            key: None if isinstance(value, float) and math.isnan(value) else value
            for key, value in plain.items()
        }


def judge(loop: ClosedLoop, drive: Drive) -> DriveVerdict:
    """Judge one drive.

    Collisions and the road are looked at in continuous time, by the motion that `Scenario` defines
    between two instants. A jump is no motion: nobody is met on the way, and what comes after it
    reaches no goal and leaves no road.
    """
    motion, ego = drive.motion, drive.ego
    time, n = motion.time, len(motion.vehicles)
    config, known = loop.config, loop.world
    others = [i for i in range(n) if i != ego]
    contacts = {(i, j): _contact(drive, i, j) for i in range(n) for j in range(i)}
    hits = [(contacts[max(ego, i), min(ego, i)], i) for i in others]
    first, who = min(((at, i) for at, i in hits if at is not None), default=(math.nan, -1))
    goal = _goal_time(loop, drive)
    gap, ttc, close = [], [], []
    for i in others:
        distance, to_contact = distance_and_ttc(motion, ego, i)
        to_contact = np.where(drive.here[i], to_contact, np.inf)
        gap.append(float(np.where(drive.here[i], distance, np.inf).min()))
        ttc.append(float(to_contact.min()))
        close.append(float(np.where(not_behind(drive, i), to_contact, np.inf).min()))
    braking = np.maximum(-drive.accelerations, 0.0)
    way = known.cells[ego, :, 7]
    reached = float(np.interp(drive.clock[ego, -1], np.arange(len(way)) * known.cell, way))
    whole = float(way[-1])
    progress = 1.0 if not math.isnan(goal) or whole <= 0.0 else min(reached / whole, 1.0)
    road = road_use(drive, loop.road, config.off_road_depth)
    return DriveVerdict(
        index=motion.index,
        seed=motion.seed,
        ego=motion.vehicles[ego].id,
        duration=float(time[-1]),
        collision=None if who < 0 else _collision(loop, drive, first, who),
        off_road=road.time,
        goal=goal,
        delay=goal - loop.duration,
        min_ttc=min((config.horizon, *ttc)),
        min_gap=min(gap, default=math.nan),
        min_pet=_pet(drive),
        hardest_braking=float(braking.max()),
        hard_braking=round(
            int(np.count_nonzero(braking[1:] >= config.hard_braking)) * config.step, 9
        ),
        jerk=_jerk(drive.accelerations, config.step),
        progress=progress,
        faults=len(drive.faults),
        among_others=len(
            [1 for (i, j), at in contacts.items() if ego not in (i, j) and at is not None]
        ),
        forced=drive.forced,
        road_known=loop.road is not None,
        road_margin=road.margin,
        off_road_depth=config.off_road_depth,
        off_road_area=road.area,
        jumps=len(drive.jumps),
        stood=_stood(motion.speed[ego], config.step),
        terms=terms(
            drive,
            None if who < 0 else (who, first),
            road.margin,
            progress,
            min(close, default=math.inf),
        ),
    )


def _stood(speed: Floats, step: float) -> float:
    """Return for how long [s] a vehicle stood at the end."""
    moved = np.flatnonzero(speed >= STANDSTILL_MPS)
    return round((len(speed) - 1 - (int(moved[-1]) if len(moved) else 0)) * step, 9)


def _contact(drive: Drive, i: int, j: int) -> float | None:
    """Time [s] of the first contact of two vehicles while both are on the scene, None if they never touch."""
    both = np.flatnonzero(drive.here[i] & drive.here[j])
    parts = np.split(both, np.searchsorted(both, drive.jumps)) if drive.ego in (i, j) else [both]
    times = (
        _contact_in(drive.motion, [i, j], slice(part[0], part[-1] + 1))
        for part in parts
        if len(part)
    )
    return next((time for time in times if time is not None), None)


def _contact_in(motion: Scenario, pair: list[int], span: slice) -> float | None:
    """Return the time [s] of the first contact of two vehicles in a span of instants, None if they do not touch in it."""
    vehicles = (motion.vehicles[pair[0]], motion.vehicles[pair[1]])
    if span.stop - span.start < 2:
        touches = footprint_distance(motion, *pair)[span.start] <= 0.0
        return float(motion.time[span.start]) if touches else None
    time, position = motion.time[span], motion.position[pair][:, span]
    heading, speed = motion.heading[pair][:, span], motion.speed[pair][:, span]
    control, out = np.empty((2, len(time) - 1, 4, 2)), np.empty((1, 3))
    control_points(time, position, heading, speed, control)
    half = np.array([vehicle.half for vehicle in vehicles])
    first_contacts(time, control, heading, half, 0.0, RESOLUTION, out)
    if out[0, 0] == Proof.PROVEN:
        return None
    found, step = float(out[0, 1]), float(motion.time[1])  # any instant of the contact
    k = min(int(found / step + 1e-9), len(motion.time) - 2)
    start = float(motion.time[k])
    u = np.linspace(0.0, max(found - start, 0.0) / step, PARTS + 1)
    fine = motion.of_vehicles(pair).at_times(start + u * step)
    touch = footprint_distance(fine, 0, 1) <= 0.0  # from when on, to a PART of the step
    return start + float(u[np.argmax(touch)]) * step if touch.any() else found


def _collision(loop: ClosedLoop, drive: Drive, at: float, who: int) -> Collision:
    """Say how fast they met, who closed the gap, by both speeds along the line of their centres, and why."""
    contact = Contact(loop, drive, who, at)
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
        time=at,
        vehicle=drive.motion.vehicles[who].id,
        speed=math.hypot(*(velocity - other_velocity)),
        ran=runner,
        reason=reason_of(contact),
        cut_in=contact.cut_in,
    )


def _goal_time(loop: ClosedLoop, drive: Drive) -> float:
    """Time [s] of the first instant before any jump at which the ego is at its goal, NaN if it never is."""
    motion, ego, until = drive.motion, drive.ego, slice(drive.driven)
    poses = np.column_stack([motion.position[ego, until], motion.heading[ego, until]])
    reached = loop.reached(motion.time[until], poses)
    return float(motion.time[np.argmax(reached)]) if reached.any() else math.nan


def _pet(drive: Drive) -> float:
    """Least post-encroachment time [s] of the ego at crossings; NaN without one. Source: Allen, Shin & Cooper 1978."""
    motion, ego, found = drive.motion, drive.ego, []
    for i in range(len(motion.vehicles)):
        span = np.flatnonzero(drive.here[i])
        if i == ego or len(span) < 2:
            continue
        conflicts = find_conflicts(motion.select([ego, i], int(span[0]), int(span[-1])))
        found += [one.encroachment for one in conflicts if not one.following]
    return min(found, default=math.nan)


def _jerk(acceleration: Floats, step: float) -> float:
    """Largest change of acceleration [m/s³] over JERK_OVER; the first instant has none yet."""
    over = max(round(JERK_OVER / step), 1)
    change = acceleration[1 + over :] - acceleration[1:-over]
    return float(np.abs(change).max(initial=0.0)) / (over * step)
