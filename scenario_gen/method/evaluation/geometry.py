# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Two oriented footprints at many instants: their distance and time to collision."""

from typing import NamedTuple

import numpy as np

from scenario_gen.numerics import Floats
from scenario_gen.numerics.boxes import Box, box_distance, time_to_touch
from scenario_gen.numerics.kernels import F, F1, F2, kernel, named, OUT1
from scenario_gen.numerics.plane import unit
from scenario_gen.types import Motion


def footprint_distance(motion: Motion, a: int, b: int) -> Floats:
    """Return the distance (T,) [m] between footprints a and b; 0 where they overlap."""
    return distance_and_ttc(motion, a, b)[0]


def time_to_collision(motion: Motion, a: int, b: int) -> Floats:
    """Return the time (T,) [s] until footprints a and b touch at constant velocity, or inf.

    Source: Hayward 1972.
    """
    return distance_and_ttc(motion, a, b)[1]


def distance_and_ttc(motion: Motion, a: int, b: int) -> tuple[Floats, Floats]:
    """Return the distance [m] of two footprints and the time to collision [s], (T,) each."""
    ahead = unit(motion.heading)
    first, second = (
        _Driven(motion.position[n], ahead[n], motion.speed[n], *motion.vehicles[n].half)
        for n in (a, b)
    )
    distance, time = np.empty_like(first.speed), np.empty_like(first.speed)
    _fill_nearness(first, second, distance, time)
    return distance, time


class _Driven(NamedTuple):
    """Positions (T, 2) [m], directions (T, 2), speeds (T,) [m/s], half length, half width [m]."""

    position: Floats
    ahead: Floats
    speed: Floats
    length: float
    width: float


_DRIVEN = named(_Driven, F2, F2, F1, F, F)


@kernel(inline=True)
def _box(driven: _Driven, t: int) -> Box:
    position, ahead = driven.position[t], driven.ahead[t]
    return Box(position[0], position[1], ahead[0], ahead[1], driven.length, driven.width)


@kernel(_DRIVEN, _DRIVEN, OUT1, OUT1)
def _fill_nearness(a: _Driven, b: _Driven, distance: Floats, time: Floats) -> None:
    """Fill `distance` (T,) [m] and `time` (T,) [s]."""
    for t in range(len(time)):
        first, second = _box(a, t), _box(b, t)
        distance[t] = box_distance(first, second)
        vx = b.speed[t] * second.cos - a.speed[t] * first.cos
        vy = b.speed[t] * second.sin - a.speed[t] * first.sin
        time[t] = time_to_touch(first, second, vx, vy)
