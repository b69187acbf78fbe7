# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Planners of our own: one that keeps its distance, one that ignores all others, and the reference drive."""

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
from scenario_gen.numerics.curve import Curve
from scenario_gen.numerics.plane import ahead_and_left, place

SPEED_GAIN = 1.0  # 1/s, acceleration per m/s that is missing


class RouteFollower:
    """Steers along the route towards a point ahead of the ego (pure pursuit, Coulter 1992)."""

    def reset(self, task: Task) -> None:
        """Take the route in."""
        self.task = task
        self.route = Curve.through(task.route[:, :2]) if len(task.route) > 2 else None
        self._near = 0.0

    def steer(self, ego: EgoState) -> tuple[float, float]:
        """Return the curvature to drive [1/m], and the ego's station on the route [m]."""
        if self.route is None:
            return 0.0, 0.0
        around = np.linspace(self._near - 2.0, self._near + 8.0, 41)
        poses = self.route.at(around)
        self._near = float(around[np.argmin(np.hypot(poses[:, 0] - ego.x, poses[:, 1] - ego.y))])
        ahead = min(max(0.8 * ego.speed, 3.0), 15.0)
        along, left = ahead_and_left(self.route.at(self._near + ahead)[:2] - ego[:2], ego.yaw)
        return float(2.0 * left / np.maximum(along * along + left * left, 1e-6)), self._near


@dataclass
class ConstantSpeed(RouteFollower):
    """Follows its route at one speed and looks at nobody: the bad one. `speed` [m/s], or that of the start if it is higher."""

    speed: float = 8.0

    def act(self, observation: Observation) -> Command:
        """Steer, and keep the speed."""
        ego = observation.ego
        curvature, _ = self.steer(ego)
        wanted = max(self.speed, float(self.task.start[3]))
        return Command(SPEED_GAIN * (wanted - ego.speed), curvature)


@dataclass
class IdmFollower(RouteFollower):
    """Follows its route and keeps its distance to whoever is on it, or will be if all go straight on (IDM).

    Source: intelligent driver model, Treiber, Hennecke & Helbing 2000. `speed` [m/s] is driven on
        a free and straight way.
    """

    speed: float = 10.0
    headway: float = 1.5  # s
    standstill: float = 3.0  # m
    acceleration: float = 1.5  # m/s²
    foresight: float = 4.0  # s, for which others are expected to go straight on
    room: float = 0.5  # m beside the ego that it keeps free

    def act(self, observation: Observation) -> Command:
        """Steer, and brake for the nearest."""
        ego = observation.ego
        curvature, station = self.steer(ego)
        wanted = 0.0  # without a way it is where it is to be
        if self.route is not None:
            stops = bool(self.task.goal[3] < STANDSTILL_MPS)  # the witness stands at its goal
            wanted = float(
                wanted_speeds(self.route, np.array([station]), self.speed, stops=stops)[0]
            )
        gap, ahead = self._nearest(observation, station)
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

    def _nearest(self, seen: Observation, station: float) -> tuple[float, float]:
        """Return gap [m] and speed along the route [m/s] of who is, or comes, next on the route; infinity and 0 if nobody does.

        One that comes from aside counts where it comes onto the route, as long as it does so
        before the ego has passed there.
        """
        if self.route is None or not len(seen.ids):
            return math.inf, 0.0
        own = 0.5 * self.task.vehicle.length
        when = np.arange(0.0, self.foresight + 0.01, 0.5)
        places = place(seen.others[:, None, :3], seen.others[:, 3:4] * when, 0.0)
        at, aside = self.route.project(places.reshape(-1, 2))
        turn = self.route.at(at)[:, 2].reshape(len(seen.ids), -1) - seen.others[:, 2:3]
        along, across = np.abs(np.cos(turn)), np.abs(np.sin(turn))
        length, width = 0.5 * seen.sizes[:, 0:1], 0.5 * seen.sizes[:, 1:2]
        gap = at.reshape(along.shape) - station - own - length * along - width * across
        beside = (
            np.abs(aside.reshape(along.shape))
            - 0.5 * self.task.vehicle.width
            - length * across
            - width * along
        )
        same_way = np.cos(turn[:, 0])
        comes = (when == 0.0) | (
            (same_way[:, None] < 0.7) & (seen.ego.speed * when < gap + 4.0 * own)
        )
        counts = (beside < self.room) & (gap > -own) & comes
        first = np.where(
            counts.any(axis=1), gap[np.arange(len(gap)), counts.argmax(axis=1)], math.inf
        )
        k = int(first.argmin())
        return max(float(first[k]), 0.0), float(seen.others[k, 3]) * max(float(same_way[k]), 0.0)


@dataclass
class NonReactive(IdmFollower):
    """The non-reactive baseline: `IdmFollower` at the reference drive's highest speed, ignoring all others."""

    def reset(self, task: Task) -> None:
        """Take route and speed in."""
        super().reset(task)
        self.speed, self.acceleration = task.speed, MAX_ACCELERATION_MPS2

    def act(self, observation: Observation) -> Command:
        """Drive as if nobody else were there."""
        return super().act(
            replace(
                observation, ids=(), others=observation.others[:0], sizes=observation.sizes[:0]
            )
        )


class ReferenceFollower:
    """Is where the certificate has the ego: proof that a test can be passed."""

    def __init__(self, loop: ClosedLoop) -> None:
        self.scenario, self.ego, self.begin = loop.scenario, loop.ego, loop.begin

    def reset(self, task: Task) -> None:
        """Begin."""
        self.step = task.step

    def act(self, observation: Observation) -> Pose:
        """Be where the reference drive is next."""
        s, n = self.scenario, self.ego
        k = min(
            round((self.begin + observation.time + self.step) / float(s.time[1])), len(s.time) - 1
        )
        x, y = s.position[n, k].tolist()
        return Pose(x, y, float(s.heading[n, k]), float(s.speed[n, k]))
