# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The band's first guess between two poses: a direct curve where it is free, else the planner's path, moved to its side."""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from scenario_gen import exact
from scenario_gen.arrays import Bools, Floats
from scenario_gen.roads.clearance import clearance_field, segments_free
from scenario_gen.routing.smooth import Guess, resampled
from scenario_gen.types.road import Road

SPACING = 0.5  # [m]
LANE = 3.5  # [m]
VIEW = 12.0  # [m] how far to look sideways for the road's edge
RAMP = 8.0  # [m] over which a path leaves its ends for its side
DIRECT_HOLD, PATH_HOLD = 0.3, 0.3


def direct(road: Road, start: Floats, end: Floats, radius: float, limit: float) -> Guess | None:
    """A cubic Hermite curve between two poses (3,), if a disc can follow it and its curvature stays within the limit."""
    chord = float(exact.hypot(*(end - start)[:2]))
    count = max(int(np.ceil(chord / SPACING)) + 1, 8)
    t = np.linspace(0.0, 1.0, count)[:, None]
    ahead, arrive = (np.array([exact.cos(pose[2]), exact.sin(pose[2])]) for pose in (start, end))
    for stretch in (1.0, 1.3, 0.8, 1.6):
        a, b = stretch * chord * ahead, stretch * chord * arrive
        p = (
            start[:2] * (1 + 2 * t) * np.square(1 - t)
            + a * t * np.square(1 - t)
            + end[:2] * np.square(t) * (3 - 2 * t)
            + b * np.square(t) * (t - 1)
        )
        first, second = np.gradient(p, axis=0), np.gradient(np.gradient(p, axis=0), axis=0)
        bend = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / exact.power(
            np.maximum(exact.hypot(*first.T), 1e-9), 3
        )
        onward = ((p[1:-1] - p[:-2]) * (p[2:] - p[1:-1])).sum(axis=1) > 0.0  # no cusp
        if onward.all() and bend[1:-1].max() <= limit and segments_free(road, p[:-1], p[1:], radius).all():
            return Guess(p, np.full(count, DIRECT_HOLD))
    return None


def keep_to_side(road: Road, path: Floats, radius: float, side: str) -> Guess:
    """Move a planner's path (P, 2) [m] to its side of the road where the road has two, to the middle where it has one.

    Where no ray meets an edge (in a junction) the path is left as it is, and held weakly.
    """
    guess = resampled(Guess(path, np.full(len(path), PATH_HOLD)), SPACING)
    tangent = np.gradient(guess.points, axis=0)
    tangent /= np.maximum(exact.hypot(*tangent.T), 1e-9)[:, None]
    outward = np.column_stack((tangent[:, 1], -tangent[:, 0])) * (1.0 if side == "right" else -1.0)
    near, far = (ray_cast(road, guess.points, sign * outward) for sign in (1.0, -1.0))
    width = near + far
    seen = (near < VIEW) & (far < VIEW)
    wanted = np.where(width >= 1.6 * LANE, np.minimum(0.25 * width, 0.5 * LANE), 0.5 * width)
    shift = np.where(seen, near - np.maximum(wanted, np.minimum(radius, 0.5 * width)), 0.0)
    along = np.arange(len(shift)) * SPACING  # the ends stay where they are
    shift = _averaged(shift, seen) * np.minimum(np.minimum(along, along[::-1]) / RAMP, 1.0)
    moved = guess.points + shift[:, None] * outward
    hold = np.where(seen, PATH_HOLD, 0.1 * PATH_HOLD)
    return Guess(moved, hold)


def ray_cast(road: Road, points: Floats, direction: Floats) -> Floats:
    """How far (P,) [m] it is from each point (P, 2) along its direction (P, 2) to the edge of the road, VIEW at most."""
    field = clearance_field(road)
    gone = np.zeros(len(points))
    active = np.ones(len(points), dtype=bool)
    for _ in range(int(2 * VIEW / road.resolution)):
        row, column, inside = road.cells(points + gone[:, None] * direction)
        room = np.where(inside, field[row, column], 0.0)
        active &= (room > 0.0) & (gone < VIEW)
        if not active.any():
            break
        gone += np.where(active, np.maximum(room, 0.5 * road.resolution), 0.0)
    return np.minimum(gone, VIEW)


def _averaged(values: Floats, valid: Bools, reach: int = 8) -> Floats:
    """Mean of the valid values within `reach` neighbours, 0 where there is none."""
    padded = np.pad(np.where(valid, values, 0.0), reach, mode="edge")
    weight = np.pad(valid.astype(float), reach, mode="edge")
    total, count = (sliding_window_view(each, 2 * reach + 1).sum(axis=1) for each in (padded, weight))
    return np.asarray(total / np.maximum(count, 1.0))
