# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What a body is to do so that it drives as others ask: at a speed and a yaw rate, or along poses with times."""

from dataclasses import dataclass

import numpy as np

from scenario_gen.closed_loop.ego import Command, EgoState
from scenario_gen.numerics import Floats
from scenario_gen.numerics.plane import ahead_and_left, angle_between

SLOWEST = 0.5  # m/s below which a yaw rate is taken as that of this speed: a car does not turn on the spot
CATCH_UP = 0.5  # 1/s, speed per metre that the ego is behind
LOOK_AHEAD = 0.6  # s


def of_twist(ego: EgoState, speed: float, yaw_rate: float, step: float) -> Command:
    """Return what reaches a speed [m/s] by the end of the step [s], as far as the body can, and turns at a yaw rate [rad/s]."""
    return Command((speed - ego.speed) / step, yaw_rate / max(ego.speed, SLOWEST))


@dataclass(frozen=True, eq=False)
class Track:
    """Poses with times: (T,) seconds, ascending, and (T, 3) x, y [m], yaw [rad], continuous."""

    time: Floats
    poses: Floats

    @classmethod
    def of(cls, time: Floats, poses: Floats) -> "Track":
        """Take times (T,) [s] and poses (T, 3) whose yaw need not be continuous."""
        return cls(time, np.column_stack([poses[:, :2], np.unwrap(poses[:, 2])]))

    def at(self, time: float) -> Floats:
        """Return the pose (3,) at a time [s]; before the first and after the last it stays there."""
        return np.array([np.interp(time, self.time, column) for column in self.poses.T])

    def command(self, ego: EgoState, now: float, step: float) -> Command:
        """Return what keeps the ego on the track: its speed with what it is behind, and a turn towards where it is to be soon."""
        place = np.array(ego[:2])
        pose, soon, target = (self.at(now + step + later) for later in (0.0, 0.1, LOOK_AHEAD))
        pace, _ = ahead_and_left(soon[:2] - pose[:2], pose[2])
        behind, _ = ahead_and_left(pose[:2] - place, pose[2])
        wanted = max(float(10.0 * pace + CATCH_UP * (behind - ego.speed * step)), 0.0)
        ahead, left = ahead_and_left(target[:2] - place, ego.yaw)
        square = ahead * ahead + left * left
        turn = angle_between(target[2], ego.yaw) / max(
            ego.speed * LOOK_AHEAD, 1.0
        )  # where it is too near to aim at
        return Command(
            (wanted - ego.speed) / step, float(2.0 * left / square if square > 1.0 else turn)
        )
