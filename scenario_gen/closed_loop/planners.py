# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Built-in planners: an IDM follower, a non-reactive baseline, and the reference drive."""

from dataclasses import dataclass, replace
import math

import numpy as np

from scenario_gen.closed_loop.ego import Command, EgoState, Pose
from scenario_gen.closed_loop.simulation import ClosedLoop, Observation, Task
from scenario_gen.method.evaluation import (
    free_acceleration,
    MAX_ACCELERATION_MPS2,
    MAX_BRAKING_MPS2,
    STANDSTILL_MPS,
    wanted_speeds,
)
from scenario_gen.numerics import ahead_and_left, Floats, place
from scenario_gen.numerics.curve import Curve
from scenario_gen.types import SignalState

BUILT_IN = ("ConstantSpeed", "IdmFollower", "NonReactive", "ReferenceFollower")
"""The planners that a user names without a module."""
NEAR_STATIONS = np.linspace(-2.0, 8.0, 41)
"""Distances [m] along the route from the last nearest place to candidates for the next one."""


class RouteFollower:
    """Steers along the route towards a point ahead of the ego (pure pursuit, Coulter 1992)."""

    def reset(self, task: Task) -> None:
        """Begin a new drive."""
        self.task = task
        self.route = Curve.through(task.route[:, :2]) if len(task.route) > 2 else None
        self._near = 0.0

    def steer(self, ego: EgoState) -> tuple[float, float]:
        """Return the curvature to drive [1/m], and the ego's station on the route [m]."""
        if self.route is None:
            return 0.0, 0.0
        around = self._near + NEAR_STATIONS
        offset = self.route.at(around)[:, :2] - ego[:2]
        self._near = float(around[np.argmin(np.hypot(offset[:, 0], offset[:, 1]))])
        ahead = min(max(0.8 * ego.speed, 3.0), 15.0)
        along, left = ahead_and_left(self.route.at(self._near + ahead)[:2] - ego[:2], ego.yaw)
        return float(2.0 * left / np.maximum(along * along + left * left, 1e-6)), self._near


@dataclass
class ConstantSpeed(RouteFollower):
    """Follows its route at a constant speed and ignores all others: a bad planner.

    The speed is `speed` [m/s], or that at the start if it is higher.
    """

    speed: float = 8.0

    def act(self, observation: Observation) -> Command:
        """Return the command along the route at the speed."""
        ego = observation.ego
        curvature, _ = self.steer(ego)
        wanted = max(self.speed, float(self.task.start[3]))
        return Command(wanted - ego.speed, curvature)  # 1 m/s² per m/s


@dataclass
class IdmFollower(RouteFollower):
    """Follows its route at a safe distance from the vehicles on it (IDM), and stops at red.

    It also lets vehicles pass, and merge, that will be on the route if they drive straight on,
    unless it clears their way `margin` [s] before them. `speed` [m/s] is its speed on a free and
    straight road.

    Source: intelligent driver model, Treiber, Hennecke & Helbing 2000.
    """

    speed: float = 10.0
    headway: float = 1.5  # s
    standstill: float = 3.0  # m
    acceleration: float = 2.0  # m/s²
    foresight: float = 6.0  # s, horizon of the prediction that others drive straight on
    margin: float = 1.5  # s
    merge_margin: float = 0.7  # s, ahead of a vehicle that follows then
    room: float = 0.5  # m, lateral clearance

    def act(self, observation: Observation) -> Command:
        """Return the command along the route that brakes for the next vehicle."""
        ego = observation.ego
        curvature, station = self.steer(ego)
        wanted = 0.0  # without a route it is at its goal
        if self.route is not None:
            stops = bool(self.task.goal[3] < STANDSTILL_MPS)  # the witness stands at its goal
            wanted = float(
                wanted_speeds(self.route, np.array([station]), self.speed, stops=stops)[0]
            )
        gap, ahead = self._nearest(observation, station)
        line = self._stop_line(observation, station)
        if line < gap:
            gap, ahead = line, 0.0
        closing = (
            ego.speed
            * (ego.speed - ahead)
            / (2.0 * math.sqrt(self.acceleration * MAX_BRAKING_MPS2))
        )
        share = (self.standstill + max(0.0, ego.speed * self.headway + closing)) / max(gap, 0.1)
        acceleration = (
            free_acceleration(ego.speed, wanted, self.acceleration)
            - self.acceleration * share * share
        )
        return Command(max(acceleration, -self.task.limits.max_deceleration), curvature)

    def _stop_line(self, seen: Observation, station: float) -> float:
        """Return the gap [m] to the next stop line at red, or at yellow if it can stop; else inf.

        A line counts if it crosses the route in the direction of its traffic.
        """
        nearest = math.inf
        if self.route is None:
            return nearest
        for light in seen.lights:
            is_yellow = light.state is SignalState.YELLOW
            if not (light.state.stops or is_yellow):
                continue
            places, offset = self.route.project(light.line.mean(axis=0)[None])
            half_width = 0.5 * float(np.hypot(*(light.line[1] - light.line[0])))
            turn = float(self.route.at(places)[0, 2]) - light.yaw
            gap = float(places[0]) - station - self.task.vehicle.half[0]
            stopping_way = seen.ego.speed**2 / (2.0 * MAX_BRAKING_MPS2)
            crosses = abs(float(offset[0])) < half_width and math.cos(turn) > 0.5
            if crosses and gap > (stopping_way if is_yellow else -0.5):
                nearest = min(nearest, gap)
        return nearest

    def _nearest(self, seen: Observation, station: float) -> tuple[float, float]:
        """Return the gap [m] to the next vehicle on the route, and its speed along it [m/s].

        A vehicle that enters the route later counts, unless the ego clears it before. Where the
        ego can no longer stop, it need not be so early. One that merges ahead of the ego counts as
        if it were on the route already, all others at the place of their entry, as if they stood.
        Infinity and 0 if the route is free.
        """
        if self.route is None or not seen.ids:
            return math.inf, 0.0
        half_length, half_width = self.task.vehicle.half
        times = np.arange(0.0, self.foresight + 0.01, 0.5)
        shape = (len(seen.ids), len(times))
        places = place(seen.others[:, None, :3], seen.others[:, 3:4] * times, 0.0)
        stations, offset = self.route.project(places.reshape(-1, 2))
        turn = self.route.at(stations)[:, 2].reshape(shape) - seen.others[:, 2:3]
        along, across = np.abs(np.cos(turn)), np.abs(np.sin(turn))
        length, width = 0.5 * seen.sizes[:, 0:1], 0.5 * seen.sizes[:, 1:2]
        extent = half_length + length * along + width * across
        gap = stations.reshape(shape) - station - extent
        lateral_reach = half_width + length * across + width * along
        is_near = np.abs(offset.reshape(shape)) - lateral_reach < self.room
        clear = gap + 2.0 * extent
        can_stop = gap > seen.ego.speed**2 / (2.0 * MAX_BRAKING_MPS2)
        merges = np.cos(turn) >= 0.7
        margin = np.where(merges, self.merge_margin, self.margin)
        is_close = self._driven(seen.ego.speed, times - margin) < clear
        is_first = self._driven(seen.ego.speed, times) < clear
        before_ego = is_first | (is_close & can_stop)
        follows = is_near[:, :1] & (gap[:, :1] <= -half_length) & merges[:, :1]
        on_route = is_near & (gap > -half_length)
        counts = on_route & ((times == 0.0) | (before_ego & ~follows))
        rows, entry = np.arange(len(gap)), counts.argmax(axis=1)
        direction = np.cos(turn[rows, entry])
        speeds = seen.others[:, 3] * np.maximum(direction, 0.0)
        entry_gap = gap[rows, entry]
        now = entry_gap - speeds * times[entry]
        enters_ahead = self._driven(seen.ego.speed, times[entry] + 0.5) < entry_gap
        leads = (entry == 0) | (merges[rows, entry] & (enters_ahead | (now > 0.0)))
        first_gap = np.where(leads & ~enters_ahead, now, entry_gap)
        first_gap = np.where(counts.any(axis=1), first_gap, math.inf)
        k = int(first_gap.argmin())
        return max(float(first_gap[k]), 0.0), float(speeds[k] * leads[k])

    def _driven(self, speed: float, times: Floats) -> Floats:
        """Return the ways (T,) [m] after times (T,) [s] of an ego that accelerates freely."""
        times = np.maximum(times, 0.0)
        speeding = np.minimum(times, max(self.speed - speed, 0.0) / self.acceleration)
        return speed * times + self.acceleration * speeding * (times - 0.5 * speeding)


@dataclass
class NonReactive(IdmFollower):
    """The non-reactive baseline: ignores all others, and lights.

    It drives as an `IdmFollower` with the highest speed of the reference drive.
    """

    def reset(self, task: Task) -> None:
        """Begin a new drive."""
        super().reset(task)
        self.speed, self.acceleration = task.speed, MAX_ACCELERATION_MPS2

    def act(self, observation: Observation) -> Command:
        """Return the command of the follower on an empty road."""
        others, sizes = observation.others[:0], observation.sizes[:0]
        empty = replace(observation, ids=(), others=others, sizes=sizes, types=(), lights=())
        return super().act(empty)


class ReferenceFollower:
    """Repeats the certified motion of the ego: proof that an ego can pass the test."""

    def __init__(self, loop: ClosedLoop) -> None:
        self.scenario, self.ego, self.begin = loop.scenario, loop.ego, loop.begin

    def reset(self, task: Task) -> None:
        """Begin a new drive."""
        self.step = task.step

    def act(self, observation: Observation) -> Pose:
        """Return the next pose of the reference drive."""
        scenario = self.scenario
        time = self.begin + observation.time + self.step
        k = min(round(time / float(scenario.time[1])), len(scenario.time) - 1)
        x, y, yaw = scenario.poses[self.ego, k].tolist()
        return Pose(x, y, yaw, float(scenario.speed[self.ego, k]))
