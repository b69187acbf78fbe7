# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The ego's body: a kinematic bicycle with limits.

Its reference point is the centre of the footprint, and its velocity points along its heading, as
everywhere in this suite: so what was certified can be driven by it. The curvature of its way
stands for the angle of its front wheels, κ = tan(δ) / wheelbase.
"""

from dataclasses import dataclass
import math
from typing import NamedTuple

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.numerics.plane import angle_between
from scenario_gen.types import Dynamics


class EgoState(NamedTuple):
    """Centre of the footprint x, y [m], yaw [rad], speed [m/s, >= 0], curvature [1/m, left positive], acceleration [m/s²]."""

    x: float
    y: float
    yaw: float
    speed: float
    curvature: float = 0.0
    acceleration: float = 0.0


class Command(NamedTuple):
    """What a planner asks of the body for the next step: acceleration [m/s²] and curvature [1/m, left positive]."""

    acceleration: float
    curvature: float


class Pose(NamedTuple):
    """Where an ego that is moved from outside is at the end of the next step: x, y [m], yaw [rad], speed [m/s]."""

    x: float
    y: float
    yaw: float
    speed: float


@dataclass(frozen=True)
class Moved:
    """The ego after a step, and what was wrong with what was asked of it ("" if nothing)."""

    state: EgoState
    fault: str = ""
    jumped: bool = False  # no body can take the pose after one step


FARTHEST = 1e8  # metres, and rad and m/s: beyond that a pose given from outside is no place in any road's frame
JUMP = 1.0  # metres beyond what the highest speed covers in one step, from which on a pose given from outside is called a jump


def move(
    ego: EgoState, asked: Command | Pose | None, config: ClosedLoopConfig, limits: Dynamics
) -> Moved:
    """Return the ego one step later.

    A command is cut to the body's limits. Nothing asked, or something that is not finite, is a
    fault: the ego then brakes at its limit and keeps its curvature; one that is moved from outside
    stays where it is. A pose that is farther away than the highest speed allows is a fault, too,
    but is taken, for whoever gives poses answers for them.

    Raises:
        InputError: what is asked is neither a command nor a pose, or not of numbers.
    """
    if asked is not None and not isinstance(asked, Command | Pose):
        raise InputError(
            f"a planner's `act` returns Command, Pose or None; it returned {type(asked).__name__}"
        )
    try:
        finite = asked is not None and np.isfinite(np.array(asked, dtype=np.float64)).all()
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(
            f"a planner's `act` returned a {type(asked).__name__} that is not of numbers: {error}"
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
    if not largest <= FARTHEST:
        fault = f"pose is {'out of range' if np.isfinite(largest) else 'not finite'}"
        state = EgoState(ego.x, ego.y, ego.yaw, 0.0, 0.0, -ego.speed / step)
        return Moved(state, fault, jumped=True)
    way = np.hypot(pose.x - ego.x, pose.y - ego.y)
    far = way > limits.max_speed * step + JUMP
    turn = angle_between(pose.yaw, ego.yaw)  # the yaw stays continuous
    curvature = 0.0 if far or way < 0.01 else turn / way
    acceleration = (pose.speed - ego.speed) / step
    state = EgoState(
        pose.x, pose.y, ego.yaw + turn, max(pose.speed, 0.0), float(curvature), acceleration
    )
    return Moved(state, f"jumped {way:.1f} m" if far else "", jumped=bool(far))


def _driven(ego: EgoState, asked: Command, config: ClosedLoopConfig, limits: Dynamics) -> EgoState:
    """Return the ego one step later; its way is an arc, along which its speed changes evenly until it stands.

    Source: kinematic bicycle, e.g. Rajamani 2012, section 2.2, with the reference point where
        there is no slip.
    """
    step, speed, change = config.step, ego.speed, config.ego_curvature_rate * config.step
    a = min(
        max(float(asked.acceleration), -limits.max_deceleration),
        limits.max_acceleration,
        (limits.max_speed - speed) / step,
    )
    k = min(max(float(asked.curvature), ego.curvature - change), ego.curvature + change)
    k = min(max(k, -limits.sharpest), limits.sharpest)
    end = speed + a * step
    way = 0.5 * (speed + end) * step
    if end < 0.0:  # it stands before the step is over
        end, way = 0.0, 0.5 * speed * speed / -a
    half = 0.5 * k * way
    chord, middle = way * float(np.sinc(half / np.pi)), ego.yaw + half
    x, y = ego.x + chord * math.cos(middle), ego.y + chord * math.sin(middle)
    return EgoState(x, y, ego.yaw + 2.0 * half, end, k, (end - speed) / step)
