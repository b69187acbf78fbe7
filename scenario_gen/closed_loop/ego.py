# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The ego's body: a kinematic bicycle with limits.

Its reference point is the centre of the footprint, and its velocity points along its heading, as everywhere in this suite: so
what was certified can be driven by it. The curvature of its way stands for the angle of its front wheels, κ = tan(δ) / wheelbase.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.numerics import Floats
from scenario_gen.numerics.kernels import F, F1, kernel, OUT1


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


FARTHEST = 1e8  # metres, and rad and m/s: beyond that a pose given from outside is no place in any road's frame
JUMP = 1.0  # metres beyond what the highest speed covers in one step, from which on a pose given from outside is called a jump


JUMPED, NO_PLACE = "jumped", "pose is"  # how the faults of poses begin


def misplaced(fault: str) -> bool:
    """Whether a fault is that of a pose which no body can take after one step."""
    return fault.startswith((JUMPED, NO_PLACE))


def move(ego: EgoState, asked: Command | Pose | None, config: ClosedLoopConfig) -> Moved:
    """Return the ego one step later.

    A command is cut to the body's limits. Nothing asked, or something that is not finite, is a fault: the ego then brakes at its
    limit and keeps its curvature; one that is moved from outside stays where it is. A pose that is farther away than the highest
    speed allows is a fault, too, but is taken, for whoever gives poses answers for them.

    Raises:
        InputError: what is asked is neither a command nor a pose, or not of numbers.
    """
    if asked is not None and not isinstance(asked, Command | Pose):
        raise InputError(f"a planner's `act` returns Command, Pose or None; it returned {type(asked).__name__}")
    try:
        finite = asked is not None and np.isfinite(np.array(asked, dtype=np.float64)).all()
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"a planner's `act` returned a {type(asked).__name__} that is not of numbers: {error}") from error
    if isinstance(asked, Pose):
        return _placed(ego, asked, config)
    fault = ""
    if asked is None or not finite:
        fault = "no command" if asked is None else "command is not finite"
        asked = Command(-config.ego_braking, ego.curvature)
    out = np.empty(6)
    limits = np.array(
        (config.ego_acceleration, config.ego_braking, config.ego_speed, config.ego_curvature, config.ego_curvature_rate)
    )
    bicycle(np.array(ego), asked.acceleration, asked.curvature, config.step, limits, out)
    return Moved(EgoState(*out.tolist()), fault)


def _placed(ego: EgoState, pose: Pose, config: ClosedLoopConfig) -> Moved:
    largest = np.abs(pose).max()
    if not largest <= FARTHEST:
        fault = f"{NO_PLACE} {'out of range' if np.isfinite(largest) else 'not finite'}"
        return Moved(EgoState(ego.x, ego.y, ego.yaw, 0.0, 0.0, -ego.speed / config.step), fault)
    way = np.hypot(pose.x - ego.x, pose.y - ego.y)
    far = way > config.ego_speed * config.step + JUMP
    turn = (pose.yaw - ego.yaw + np.pi) % (2.0 * np.pi) - np.pi  # the yaw stays continuous
    curvature = 0.0 if far or way < 0.01 else turn / way
    acceleration = (pose.speed - ego.speed) / config.step
    state = EgoState(pose.x, pose.y, ego.yaw + turn, max(pose.speed, 0.0), float(curvature), acceleration)
    return Moved(state, f"{JUMPED} {way:.1f} m" if far else "")


@kernel(F1, F, F, F, F1, OUT1)
def bicycle(ego: Floats, acceleration: float, curvature: float, step: float, limits: Floats, out: Floats) -> None:
    """Write the ego one step later; its way is an arc, along which its speed changes evenly until it stands.

    Source: kinematic bicycle, e.g. Rajamani 2012, section 2.2, with the reference point where there is no slip.

    Args:
        ego: (6,) as in `EgoState`, SI units.
        acceleration: asked for, m/s².
        curvature: asked for, 1/m.
        step: s.
        limits: (5,) acceleration, braking, speed, curvature, its rate, as in `ClosedLoopConfig`.
        out: (6,) likewise.
    """
    speed = ego[3]
    a = min(max(acceleration, -limits[1]), limits[0])
    a = min(a, (limits[2] - speed) / step)
    change = limits[4] * step
    k = min(max(curvature, ego[4] - change), ego[4] + change)
    k = min(max(k, -limits[3]), limits[3])
    end = speed + a * step
    way = 0.5 * (speed + end) * step
    if end < 0.0:  # it stands before the step is over
        end = 0.0
        way = 0.5 * speed * speed / -a
    turn = k * way
    middle = ego[2] + 0.5 * turn
    half = 0.5 * turn
    chord = way * (np.sin(half) / half if abs(half) > 1e-6 else 1.0 - half * half / 6.0)
    out[0], out[1] = ego[0] + chord * np.cos(middle), ego[1] + chord * np.sin(middle)
    out[2], out[3], out[4], out[5] = ego[2] + turn, end, k, (end - speed) / step
