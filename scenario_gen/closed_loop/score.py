# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The terms of nuPlan's and NAVSIM's scores, for one drive in closed loop.

Sources: nuPlan's closed-loop score (Karnchanachari et al. 2024, "Towards learning-based planning:
the nuPlan benchmark", and the metric configurations of nuplan-devkit 1.2); NAVSIM's predictive
driver model score, PDMS (Dauner et al. 2024, "NAVSIM: data-driven non-reactive autonomous vehicle
simulation and benchmarking"). Both multiply the conditions and a weighted mean of the rest::

    nuPlan:  no at-fault collision · drivable area · driving direction · making progress
             · (5 TTC + 5 progress + 4 speed limit + 2 comfort) / 16
    PDMS:    no at-fault collision · drivable area · (5 TTC + 5 progress + 2 comfort) / 12

The roads here have neither directions nor speed limits: those terms of nuPlan are left out, and
the sum is divided by 12. Progress is measured against the witness (nuPlan: the expert; PDMS: its
rule-based planner). Lanes are not known either: the ego is at fault in a contact at its side if it
was off the road, as in nuPlan, but not if it was in two lanes.
"""

from dataclasses import dataclass
import math

import numpy as np
import shapely

from scenario_gen.closed_loop.drive import Drive
from scenario_gen.closed_loop.fault import state_at, VehicleState
from scenario_gen.numerics import Floats
from scenario_gen.numerics.boxes import corners
from scenario_gen.numerics.plane import ahead_and_left
from scenario_gen.types import Vehicle

MAX_STOPPED_SPEED_MPS = 0.05  # nuPlan's `stopped_speed_threshold`
WEIGHTS = {"ttc": 5.0, "progress": 5.0, "comfort": 2.0}


@dataclass(frozen=True)
class Thresholds:
    """The thresholds of the metric configurations in nuplan-devkit 1.2.

    Attributes:
        ttc_s: `least_min_ttc` of time_to_collision_within_bound; PDMS has 1 s.
        progress: `min_progress_threshold` of ego_is_making_progress.
    """

    ttc_s: float = 0.95
    progress: float = 0.2


@dataclass(frozen=True)
class Comfort:
    """The limits of nuPlan's ego_is_comfortable, which PDMS uses, too.

    The windows are those of nuPlan's quadratic Savitzky-Golay filters (8 and 15 samples at 0.1 s),
    from the centre to each side.
    """

    acceleration_mps2: float = 2.40
    deceleration_mps2: float = 4.05
    lateral_acceleration_mps2: float = 4.89
    jerk_mps3: float = 8.37
    longitudinal_jerk_mps3: float = 4.13
    yaw_rate_radps: float = 0.95
    yaw_acceleration_radps2: float = 1.93
    value_window_s: float = 0.4
    derivative_window_s: float = 0.7


@dataclass(frozen=True)
class Terms:
    """The terms of the scores, each from 0 to 1.

    Attributes:
        no_at_fault_collision: 0 if, by nuPlan's definition, the ego hit a stationary vehicle, or
            hit a vehicle with its front, or was off the road when it was hit at its side; 1 if it
            stood or was hit from behind. `Collision.reason` has another definition.
        drivable_area: 0 if the ego left the road, as in `DriveVerdict.off_road` (nuPlan: by more
            than 0.3 m); 1 if no road is known.
        making_progress: 0 below 20 % of the witness' path.
        ttc: 0 if the time to collision with a vehicle that is not behind was less than 0.95 s.
        progress: share of the witness' path.
        comfort: 0 if acceleration, jerk or turning exceeded nuPlan's limits of comfort.
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
    drive: Drive, hit: tuple[int, float] | None, off_road: bool, progress: float, ttc: float
) -> Terms:
    """Return the terms of a drive.

    Args:
        drive: the drive.
        hit: index of the first vehicle that the ego touched, and the time [s]; None without one.
        off_road: whether the ego left the road.
        progress: share of the witness' path.
        ttc: least time to collision with a vehicle that is not behind [s].
    """
    at_fault = hit is not None and _at_fault(drive, *hit, off_road=off_road)
    thresholds = Thresholds()
    return Terms(
        no_at_fault_collision=float(not at_fault),
        drivable_area=float(not off_road),
        making_progress=float(progress >= thresholds.progress),
        ttc=float(ttc >= thresholds.ttc_s),
        progress=progress,
        comfort=float(comfortable(drive)),
    )


def not_behind(drive: Drive, other: int) -> Floats:
    """Return (T,) whether another vehicle is not behind the ego, as nuPlan's `is_agent_behind`.

    Its centre is then within 150 degrees of the ego's heading.
    """
    motion, ego = drive.motion, drive.ego
    ahead, left = ahead_and_left(
        motion.position[other] - motion.position[ego], motion.heading[ego]
    )
    return np.asarray(ahead >= math.cos(math.radians(150.0)) * np.hypot(ahead, left))


def _at_fault(drive: Drive, other_index: int, time: float, *, off_road: bool) -> bool:
    ego, other = state_at(drive, drive.ego, time), state_at(drive, other_index, time)
    if abs(ego.speed) <= MAX_STOPPED_SPEED_MPS:
        return False
    if abs(other.speed) <= MAX_STOPPED_SPEED_MPS:
        return True
    vehicles = drive.motion.vehicles
    if _touches_front(ego, vehicles[drive.ego], other, vehicles[other_index]):
        return True
    k = min(int(np.searchsorted(drive.motion.time, time)), len(drive.motion.time) - 1)
    return off_road and bool(not_behind(drive, other_index)[k])


def _touches_front(
    ego_state: VehicleState, ego: Vehicle, other_state: VehicleState, other: Vehicle
) -> bool:
    """Whether another vehicle is within 0.1 m of the ego's front bumper."""
    left, _, _, right = corners(np.array([ego_state]), ego.length, ego.width)[0]
    body = shapely.Polygon(corners(np.array([other_state]), other.length, other.width)[0])
    return bool(shapely.dwithin(shapely.LineString([left, right]), body, 0.1))


def comfortable(drive: Drive) -> bool:
    """Whether acceleration, jerk and turning stay within nuPlan's bounds at every instant."""
    step = float(drive.motion.time[1]) if len(drive.motion.time) > 1 else 1.0
    yaw, speed = drive.motion.heading[drive.ego], drive.motion.speed[drive.ego]
    limits = Comfort()

    def smooth(values: Floats) -> Floats:
        return smoothed(values, step, limits.value_window_s, 0)

    def derivative(values: Floats, order: int = 1) -> Floats:
        return smoothed(values, step, limits.derivative_window_s, order)

    acceleration = drive.accelerations.copy()
    acceleration[0] = acceleration[min(1, len(acceleration) - 1)]  # the first one is not known
    acceleration = smooth(acceleration)
    yaw_rate = derivative(yaw)
    lateral = smooth(speed * yaw_rate)
    magnitude = np.asarray(np.hypot(acceleration, lateral))
    upper_bounds = (
        (acceleration, limits.acceleration_mps2),
        (-acceleration, limits.deceleration_mps2),
        (np.abs(lateral), limits.lateral_acceleration_mps2),
        (np.abs(derivative(acceleration)), limits.longitudinal_jerk_mps3),
        (np.abs(derivative(magnitude)), limits.jerk_mps3),
        (np.abs(yaw_rate), limits.yaw_rate_radps),
        (np.abs(derivative(yaw, 2)), limits.yaw_acceleration_radps2),
    )
    return all(bool(values.max() <= bound) for values, bound in upper_bounds)


def smoothed(values: Floats, step: float, side: float, derivative: int) -> Floats:
    """Return values (T,), or their first or second derivative, by local quadratic fits.

    Each fit covers `side` seconds to each side of a value. At the ends it is the fit of the last
    window, as in nuPlan. Source: Savitzky & Golay 1964.
    """
    if len(values) < 3:
        return np.zeros_like(values) if derivative else values.copy()
    from scipy.signal import savgol_filter  # slow to import

    window = min(2 * max(round(side / step), 1) + 1, (len(values) - 1) | 1)
    return np.asarray(savgol_filter(values, window, 2, derivative, step))
