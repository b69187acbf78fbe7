# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The terms of nuPlan's and NAVSIM's scores, for one drive in closed loop.

Sources: nuPlan's closed-loop score (Karnchanachari et al. 2024, "Towards learning-based planning:
the nuPlan benchmark", and the metric configurations of nuplan-devkit 1.2); NAVSIM's predictive
driver model score, PDMS (Dauner et al. 2024, "NAVSIM: data-driven non-reactive autonomous vehicle
simulation and benchmarking"). Both multiply what must hold and weigh the rest::

    nuPlan:  no at-fault collision · drivable area · driving direction · making progress
             · (5 TTC + 5 progress + 4 speed limit + 2 comfort) / 16
    PDMS:    no at-fault collision · drivable area · (5 TTC + 5 progress + 2 comfort) / 12

A road of this suite knows neither directions nor speed limits: those terms of nuPlan are left out,
and the sum is divided by 12. Progress is measured against the witness (nuPlan: the expert; PDMS:
its rule-based planner). Lanes are not known either: a contact at the side counts as at fault if
the ego was off the road, as in nuPlan, but not for being in two lanes.
"""

from dataclasses import dataclass
import math

import numpy as np
from scipy.signal import savgol_filter
import shapely

from scenario_gen.closed_loop.fault import state_at, VehicleState
from scenario_gen.closed_loop.simulation import Drive
from scenario_gen.numerics import Floats
from scenario_gen.numerics.boxes import corners
from scenario_gen.numerics.plane import ahead_and_left
from scenario_gen.types import Vehicle

OUTSIDE = 0.3  # m; nuPlan's `max_violation_threshold` of drivable_area_compliance
LEAST_TTC = (
    0.95  # s; nuPlan's `least_min_ttc` of time_to_collision_within_bound; PDMS looks ahead 1 s
)
LEAST_PROGRESS = 0.2  # nuPlan's `min_progress_threshold` of ego_is_making_progress
STOPPED = 0.05  # m/s; nuPlan's `stopped_speed_threshold`
BEHIND = 150.0  # degrees from the ego's heading; nuPlan's `is_agent_behind`
BUMPER = 0.05  # metres within which a contact is at the front
# nuPlan's ego_is_comfortable, which PDMS takes over: m/s², m/s³, rad/s, rad/s²
SPEEDING_UP, BRAKING, SIDEWAYS = 2.40, 4.05, 4.89
JERK, JERK_ALONG = 8.37, 4.13
YAW_RATE, YAW_ACCELERATION = 0.95, 1.93
SMOOTHED, DERIVED = (
    0.4,
    0.7,
)  # s to each side: nuPlan's Savitzky-Golay windows of 8 and 15 samples at 0.1 s, quadratic
WEIGHTS = {"ttc": 5.0, "progress": 5.0, "comfort": 2.0}


@dataclass(frozen=True)
class Terms:
    """Each from 0 to 1.

    Attributes:
        no_at_fault_collision: 0 if, as nuPlan has it, the ego hit one that stood, or hit one with
            its front, or was off the road when it was hit at the side; not if it stood or was hit
            from behind. `Collision.reason` has another definition.
        drivable_area: 0 if the footprint was deeper than 0.3 m outside; 1 where no road is known.
        making_progress: 0 below 20 % of the witness' way.
        ttc: 0 if the time to collision with one that is not behind was less than 0.95 s.
        progress: share of the witness' way.
        comfort: 0 if acceleration, jerk or turning was beyond what nuPlan calls comfortable.
    """

    no_at_fault_collision: float
    drivable_area: float
    making_progress: float
    ttc: float
    progress: float
    comfort: float

    @property
    def pdms(self) -> float:
        """NAVSIM's score."""
        weighted = np.average(
            [getattr(self, name) for name in WEIGHTS], weights=list(WEIGHTS.values())
        )
        return self.no_at_fault_collision * self.drivable_area * float(weighted)

    @property
    def nuplan(self) -> float:
        """NuPlan's closed-loop score, without driving direction and speed limit."""
        return self.making_progress * self.pdms


def terms(
    drive: Drive, hit: tuple[int, float] | None, margin: float, progress: float, ttc: float
) -> Terms:
    """Return the terms of a drive.

    Args:
        drive: what was driven.
        hit: with whom and when [s] the ego first met another, None if it did not.
        margin: least signed distance to the road's edge [m], NaN if no road is known.
        progress: share of the witness' way.
        ttc: least time to collision with one that is not behind [s].
    """
    return Terms(
        no_at_fault_collision=float(
            hit is None or not _at_fault(drive, *hit, off_road=margin < 0.0)
        ),
        drivable_area=float(not margin < -OUTSIDE),
        making_progress=float(progress >= LEAST_PROGRESS),
        ttc=float(ttc >= LEAST_TTC),
        progress=progress,
        comfort=float(comfortable(drive)),
    )


def not_behind(drive: Drive, other: int) -> Floats:
    """Return (T,) whether another is not behind the ego: within 150 degrees of its heading."""
    motion, ego = drive.motion, drive.ego
    ahead, left = ahead_and_left(
        motion.position[other] - motion.position[ego], motion.heading[ego]
    )
    return np.asarray(ahead >= math.cos(math.radians(BEHIND)) * np.hypot(ahead, left))


def _at_fault(drive: Drive, who: int, time: float, *, off_road: bool) -> bool:
    ego, other = state_at(drive, drive.ego, time), state_at(drive, who, time)
    if abs(ego.speed) <= STOPPED:
        return False
    if abs(other.speed) <= STOPPED:
        return True
    vehicles = drive.motion.vehicles
    if _touches_front(ego, vehicles[drive.ego], other, vehicles[who]):
        return True
    k = min(int(np.searchsorted(drive.motion.time, time)), len(drive.motion.time) - 1)
    return off_road and bool(not_behind(drive, who)[k])


def _touches_front(ego: VehicleState, own: Vehicle, other: VehicleState, its: Vehicle) -> bool:
    """Whether another touches the ego's front bumper."""
    front, _, _, right = corners(np.array([ego]), own.length, own.width)[0]
    body = shapely.Polygon(corners(np.array([other]), its.length, its.width)[0])
    return bool(shapely.dwithin(shapely.LineString([front, right]), body, 2.0 * BUMPER))


def comfortable(drive: Drive) -> bool:
    """Whether acceleration, jerk and turning stay within nuPlan's bounds at every instant."""
    step, ego = float(drive.motion.time[1]) if len(drive.motion.time) > 1 else 1.0, drive.ego
    yaw, speed = drive.motion.heading[ego], drive.motion.speed[ego]
    along = drive.accelerations.copy()
    along[0] = along[min(1, len(along) - 1)]  # the first instant has none yet
    rate = smoothed(yaw, step, DERIVED, 1)
    sideways = smoothed(speed * rate, step, SMOOTHED, 0)
    along = smoothed(along, step, SMOOTHED, 0)
    whole = np.asarray(np.hypot(along, sideways))
    return bool(
        along.max() <= SPEEDING_UP
        and along.min() >= -BRAKING
        and np.abs(sideways).max() <= SIDEWAYS
        and np.abs(smoothed(along, step, DERIVED, 1)).max() <= JERK_ALONG
        and np.abs(smoothed(whole, step, DERIVED, 1)).max() <= JERK
        and np.abs(rate).max() <= YAW_RATE
        and np.abs(smoothed(yaw, step, DERIVED, 2)).max() <= YAW_ACCELERATION
    )


def smoothed(values: Floats, step: float, side: float, derivative: int) -> Floats:
    """Return values (T,), or their first or second derivative, by a quadratic fitted to `side` seconds to each side of each.

    At the ends it is that of the last window, as in nuPlan. Source: Savitzky & Golay 1964.
    """
    if len(values) < 3:
        return np.zeros_like(values) if derivative else values.copy()
    window = min(2 * max(round(side / step), 1) + 1, (len(values) - 1) | 1)
    return np.asarray(savgol_filter(values, window, 2, deriv=derivative, delta=step))
