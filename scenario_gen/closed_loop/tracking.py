# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What a body is to do so that it drives as others ask: at a speed and a yaw rate, or along poses with times."""

from dataclasses import dataclass

import numpy as np

from scenario_gen.closed_loop.ego import Command, EgoState
from scenario_gen.numerics import Floats

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

    def at(self, time: float) -> tuple[float, float, float]:
        """Return the pose at a time [s]; before the first and after the last it stays there."""
        x, y, yaw = (float(np.interp(time, self.time, column)) for column in self.poses.T)
        return x, y, yaw

    def command(self, ego: EgoState, now: float, step: float) -> Command:
        """Return what keeps the ego on the track: its speed with what it is behind, and a turn towards where it is to be soon."""
        x, y, yaw = self.at(now + step)
        ahead = self.at(now + step + 0.1)
        c, s = float(np.cos(yaw)), float(np.sin(yaw))
        pace = (ahead[0] - x) * c * 10.0 + (ahead[1] - y) * s * 10.0
        behind = (x - ego.x) * c + (y - ego.y) * s - ego.speed * step
        wanted = max(pace + CATCH_UP * behind, 0.0)
        tx, ty, tyaw = self.at(now + step + LOOK_AHEAD)
        c, s = float(np.cos(ego.yaw)), float(np.sin(ego.yaw))
        dx, dy = (tx - ego.x) * c + (ty - ego.y) * s, (ty - ego.y) * c - (tx - ego.x) * s
        square = dx * dx + dy * dy
        if square > 1.0:
            curvature = 2.0 * dy / square
        else:  # too near to aim at
            turn = (tyaw - ego.yaw + np.pi) % (2.0 * np.pi) - np.pi
            curvature = turn / max(ego.speed * LOOK_AHEAD, 1.0)
        return Command((wanted - ego.speed) / step, float(curvature))
