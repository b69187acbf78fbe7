# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The ego's body: a kinematic bicycle with limits.

The reference point is the centre of the footprint, and the velocity points along the heading, as
in all scenarios, so the ego can drive every certified motion. The curvature of the path represents
the angle of the front wheels, κ = tan(δ) / wheelbase.
"""

from dataclasses import dataclass
import math
from typing import NamedTuple

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.numerics import angle_between
from scenario_gen.types import Dynamics


class EgoState(NamedTuple):
    """The state of the ego.

    Attributes:
        x: centre of the footprint [m].
        y: centre of the footprint [m].
        yaw: [rad].
        speed: at least 0 [m/s].
        curvature: positive to the left [1/m].
        acceleration: [m/s²].
    """

    x: float
    y: float
    yaw: float
    speed: float
    curvature: float = 0.0
    acceleration: float = 0.0


class Command(NamedTuple):
    """A planner's command for the next step.

    Attributes:
        acceleration: [m/s²].
        curvature: positive to the left [1/m].
    """

    acceleration: float
    curvature: float


class Pose(NamedTuple):
    """A pose at the end of the next step, from a planner that moves the ego itself.

    x, y [m], yaw [rad], speed [m/s].
    """

    x: float
    y: float
    yaw: float
    speed: float


@dataclass(frozen=True)
class Moved:
    """The ego after a step.

    Attributes:
        state: the new state.
        fault: description of an error in the command; "" if it was correct.
        jumped: whether no vehicle can reach the pose in one step.
    """

    state: EgoState
    fault: str = ""
    jumped: bool = False


MAX_POSE_M = 1e8  # greatest coordinate of a pose; also the bound of its yaw and speed
JUMP_TOLERANCE_M = 1.0  # a pose is a jump from so far beyond the distance at the highest speed


def move(
    ego: EgoState, asked: Command | Pose | None, config: ClosedLoopConfig, limits: Dynamics
) -> Moved:
    """Return the ego one step later.

    A command is limited to the body's limits. A command that is missing or not finite is a fault:
    the ego then brakes at its limit with an unchanged curvature. A pose that is not finite is a
    fault, too: the ego does not move. A pose farther away than the highest speed allows is a
    fault, but the ego moves there.

    Raises:
        InputError: the planner returned neither a command nor a pose, or not numbers.
    """
    if asked is not None and not isinstance(asked, Command | Pose):
        raise InputError(
            f"a planner's `act` returns Command, Pose or None; it returned {type(asked).__name__}"
        )
    try:
        finite = asked is not None and all(math.isfinite(float(value)) for value in asked)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(
            f"a planner's `act` returned a {type(asked).__name__} without numbers: {error}"
        ) from error
    if isinstance(asked, Pose):
        return _placed(ego, asked, config.step, limits)
    fault = ""
    if asked is None or not finite:
        fault = "no command" if asked is None else "command is not finite"
        asked = Command(-limits.max_deceleration, ego.curvature)
    return Moved(_driven(ego, asked, config, limits), fault)


def _placed(ego: EgoState, pose: Pose, step: float, limits: Dynamics) -> Moved:
    largest = np.abs(pose).max()
    if not largest <= MAX_POSE_M:
        fault = f"pose is {'out of range' if np.isfinite(largest) else 'not finite'}"
        state = EgoState(ego.x, ego.y, ego.yaw, 0.0, 0.0, -ego.speed / step)
        return Moved(state, fault, jumped=True)
    distance = np.hypot(pose.x - ego.x, pose.y - ego.y)
    far = distance > limits.max_speed * step + JUMP_TOLERANCE_M
    turn = angle_between(pose.yaw, ego.yaw)  # the yaw stays continuous
    curvature = 0.0 if far or distance < 0.01 else turn / distance
    acceleration = (pose.speed - ego.speed) / step
    state = EgoState(
        pose.x, pose.y, ego.yaw + turn, max(pose.speed, 0.0), float(curvature), acceleration
    )
    return Moved(state, f"jumped {distance:.1f} m" if far else "", jumped=bool(far))


def _driven(ego: EgoState, asked: Command, config: ClosedLoopConfig, limits: Dynamics) -> EgoState:
    """Return the ego one step later.

    It moves on an arc with constant acceleration until it stands.

    Source: kinematic bicycle, e.g. Rajamani 2012, section 2.2, with the reference point at the
    point without slip.
    """
    step, speed = config.step, ego.speed
    acceleration = min(
        max(float(asked.acceleration), -limits.max_deceleration),
        limits.max_acceleration,
        (limits.max_speed - speed) / step,
    )
    change = config.ego_curvature_rate * step
    curvature = min(max(float(asked.curvature), ego.curvature - change), ego.curvature + change)
    curvature = min(max(curvature, -limits.sharpest), limits.sharpest)
    end_speed = speed + acceleration * step
    distance = 0.5 * (speed + end_speed) * step
    if end_speed < 0.0:  # the ego stops before the end of the step
        end_speed = 0.0
        distance = 0.5 * speed * speed / -acceleration
    half_turn = 0.5 * curvature * distance
    chord = distance * math.sin(half_turn) / half_turn if half_turn else distance
    return EgoState(
        x=ego.x + chord * math.cos(ego.yaw + half_turn),
        y=ego.y + chord * math.sin(ego.yaw + half_turn),
        yaw=ego.yaw + 2.0 * half_turn,
        speed=end_speed,
        curvature=curvature,
        acceleration=(end_speed - speed) / step,
    )
