# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How near vehicles come to each other: distances, time to collision, encroachment, order."""

from dataclasses import dataclass
from itertools import combinations
import math
from typing import NamedTuple

import numpy as np

from scenario_gen.numerics import Floats
from scenario_gen.numerics.boxes import Box, box_distance, time_to_touch
from scenario_gen.numerics.kernels import B, F, F1, F2, kernel, named, OUT1
from scenario_gen.numerics.plane import unit
from scenario_gen.situation import encroachment, find_conflicts
from scenario_gen.types import Motion


def footprint_distance(motion: Motion, a: int, b: int) -> Floats:
    """Return the distance (T,) [m] between footprints a and b; 0 where they overlap."""
    return distance_and_ttc(motion, a, b)[0]


def distance_and_ttc(motion: Motion, a: int, b: int) -> tuple[Floats, Floats]:
    """Return the distance [m] of two footprints and the time to collision [s], (T,) each."""
    distance, time = np.empty_like(motion.time), np.empty_like(motion.time)
    rows = slice(None)
    _fill_nearness(_driven(motion, a, rows), _driven(motion, b, rows), False, distance, time)
    return distance, time


def least_distance_and_ttc(motion: Motion, a: int, b: int) -> tuple[float, float]:
    """Return the least distance [m] and time to collision [s] while both vehicles are present."""
    both = motion.present_slice(a, b)
    distance, time = np.empty_like(motion.time[both]), np.empty_like(motion.time[both])
    _fill_nearness(_driven(motion, a, both), _driven(motion, b, both), True, distance, time)
    return float(distance.min()), float(time.min())


class _Driven(NamedTuple):
    """Positions (T, 2) [m], directions (T, 2), speeds (T,) [m/s], half length, half width [m]."""

    position: Floats
    ahead: Floats
    speed: Floats
    length: float
    width: float


def _driven(motion: Motion, n: int, rows: slice) -> _Driven:
    """Return the motion of one vehicle at some samples."""
    heading, half = motion.heading[n, rows], motion.vehicles[n].half
    return _Driven(motion.position[n, rows], unit(heading), motion.speed[n, rows], *half)


_DRIVEN = named(_Driven, F2, F2, F1, F, F)


@kernel(inline=True)
def _box(driven: _Driven, t: int) -> Box:
    position, ahead = driven.position[t], driven.ahead[t]
    return Box(position[0], position[1], ahead[0], ahead[1], driven.length, driven.width)


@kernel(_DRIVEN, _DRIVEN, B, OUT1, OUT1)
def _fill_nearness(a: _Driven, b: _Driven, least: bool, distance: Floats, time: Floats) -> None:
    """Fill `distance` (T,) [m] and `time` (T,) [s].

    With `least`, values that cannot be the least ones of all samples may be infinite.
    """
    reach = np.hypot(a.length, a.width) + np.hypot(b.length, b.width)
    nearest, soonest = np.inf, np.inf
    for t in range(len(time)):
        first, second = _box(a, t), _box(b, t)
        dx, dy = second.x - first.x, second.y - first.y
        room = np.hypot(dx, dy) - reach
        distance[t] = np.inf
        if not least or room <= nearest:
            distance[t] = box_distance(first, second)
            nearest = min(nearest, distance[t])
        vx = b.speed[t] * second.cos - a.speed[t] * first.cos
        vy = b.speed[t] * second.sin - a.speed[t] * first.sin
        speed = np.hypot(vx, vy)
        recedes = dx * vx + dy * vy >= 0.0 or abs(dx * vy - dy * vx) > reach * speed
        time[t] = np.inf
        if room <= 0.0 or not (recedes or room > soonest * speed):
            time[t] = time_to_touch(first, second, vx, vy)
            soonest = min(soonest, time[t])


@dataclass(frozen=True)
class Criticality:
    """What one motion came to.

    Source: time to collision, Hayward 1972; post-encroachment time, Allen, Shin & Cooper 1978.

    Attributes:
        min_distance: least distance between two footprints [m]; NaN with one vehicle.
        min_ttc: least time to collision [s], at most the horizon; likewise.
        pet: least post-encroachment time [s] of two vehicles that cross or merge; NaN without
            such a pair, see `encroachment`.
        order: (pair, which of them went first) of every conflict, by vehicle index.
    """

    min_distance: float
    min_ttc: float
    pet: float
    order: tuple[tuple[tuple[int, int], int], ...]

    def keeps_order_of(self, template: "Criticality") -> float:
        """Return the share of the template's conflicts found here that have the same order."""
        mine = dict(self.order)
        same = [mine[pair] == first for pair, first in template.order if pair in mine]
        return float(np.mean(same)) if same else math.nan


def criticality(motion: Motion, horizon: float) -> Criticality:
    """Measure one motion; a time to collision above `horizon` [s] counts as the horizon."""
    distances, times = [], [horizon]
    for a, b in combinations(range(len(motion.vehicles)), 2):
        both = motion.present_slice(a, b)
        if both.stop > both.start:
            distance, ttc = least_distance_and_ttc(motion, a, b)
            distances.append(distance)
            times.append(ttc)
    conflicts = find_conflicts(motion)
    encroachments = [encroachment(motion, conflict) for conflict in conflicts]
    return Criticality(
        min_distance=min(distances, default=math.nan),
        min_ttc=min(times) if distances else math.nan,
        pet=float(np.fmin.reduce(encroachments, initial=math.nan)),
        order=tuple((conflict.pair, conflict.first) for conflict in conflicts),
    )
