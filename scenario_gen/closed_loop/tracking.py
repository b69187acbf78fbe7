# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Commands that follow a twist (speed and yaw rate) or a trajectory of poses with times."""

from dataclasses import dataclass

import numpy as np

from scenario_gen.closed_loop.ego import Command, EgoState
from scenario_gen.numerics import ahead_and_left, angle_between, Floats

LOOK_AHEAD_S = 0.6


def of_twist(ego: EgoState, speed: float, yaw_rate: float, step: float) -> Command:
    """Return the command for a speed [m/s] at the end of the step [s] and a yaw rate [rad/s].

    Below 0.5 m/s the curvature is that at 0.5 m/s, because a car does not turn on the spot.
    """
    return Command((speed - ego.speed) / step, yaw_rate / max(ego.speed, 0.5))


@dataclass(frozen=True, eq=False)
class Track:
    """A trajectory: (T,) times [s], ascending, and (T, 3) x, y [m], continuous yaw [rad]."""

    time: Floats
    poses: Floats

    @classmethod
    def of(cls, time: Floats, poses: Floats) -> "Track":
        """Return a track with times (T,) [s] and poses (T, 3); yaw may jump by 2π."""
        return cls(time, np.column_stack([poses[:, :2], np.unwrap(poses[:, 2])]))

    def at(self, time: float) -> Floats:
        """Return the pose (3,) at a time [s], limited to the times of the track."""
        return np.array([np.interp(time, self.time, column) for column in self.poses.T])

    def command(self, ego: EgoState, now: float, step: float) -> Command:
        """Return the command that follows the track.

        The speed is that of the track plus 0.5 m/s per metre that the ego is behind. The curvature
        leads to the pose LOOK_AHEAD_S ahead (pure pursuit, Coulter 1992).
        """
        position = np.array(ego[:2])
        pose, target = self.at(now + step), self.at(now + step + LOOK_AHEAD_S)
        tenth, _ = ahead_and_left(self.at(now + step + 0.1)[:2] - pose[:2], pose[2])
        behind, _ = ahead_and_left(pose[:2] - position, pose[2])
        speed = max(float(10.0 * tenth + 0.5 * (behind - ego.speed * step)), 0.0)
        ahead, left = ahead_and_left(target[:2] - position, ego.yaw)
        square = ahead * ahead + left * left
        if square > 1.0:
            curvature = 2.0 * float(left / square)
        else:  # the target is too near for pure pursuit
            turn = angle_between(target[2], ego.yaw)
            curvature = turn / max(ego.speed * LOOK_AHEAD_S, 1.0)
        return Command((speed - ego.speed) / step, curvature)
