# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Road users side by side: in one direction, with overlapping lengths."""

from itertools import combinations
import math
from typing import Final, NamedTuple

import numpy as np
from scipy.spatial import KDTree

from scenario_gen.numerics import ahead_and_left, Bools, Floats, wrap_angle
from scenario_gen.situation.tracks import Track

MIN_SIDE_BY_SIDE_S: Final = 1.0  # shorter encounters are not compared
MAX_CLEARANCE_CHANGE_M: Final = 0.3  # of two road users side by side in one lane
SAME_DIRECTION_RAD: Final = math.radians(30.0)
_PARALLEL_RAD = math.radians(10.0)
_PARALLEL_M = 1.0  # of path on which a distance to the side is known
MAX_SIDE_OFFSET_M: Final = 6.0  # between centres
_MIN_SIDE_OFFSET_M = 1.0
_ONE_LANE_OFFSET_M = 3.0  # two centres in one lane are nearer
_MIN_LENGTH_M = 5.0  # of a shared lane


class Abreast(NamedTuple):
    """Two road users that share a lane side by side.

    Attributes:
        pair: their rows.
        offset: [m, left positive] of the second from the first.
        clearance: [m] between their sides.
        samples: (T,) when the second drives beside the path of the first.
        spans: (2, 2) [m] from where to where on each path.
    """

    pair: tuple[int, int]
    offset: float
    clearance: float
    samples: Bools
    spans: Floats

    def offset_on(self, poses: Floats, other: Floats) -> float:
        """Return how far [m, left positive] poses (K, 3) of the second are beside a path (M, 3).

        It is the median beside the inner part of the path; NaN if they hardly share a lane.
        """
        nearest = KDTree(poses[:, :2]).query(other[:, :2])[1]
        _, left = ahead_and_left((other - poses[nearest])[:, :2], poses[nearest, 2])
        turned = np.abs(wrap_angle(other[:, 2] - poses[nearest, 2]))
        inside = (nearest > 0) & (nearest < len(poses) - 1) & (turned < _PARALLEL_RAD)
        near = inside & (np.abs(left) < MAX_SIDE_OFFSET_M)
        driven = np.hypot(*np.diff(other[near, :2], axis=0).T).sum()
        return float(np.median(left[near])) if driven > _PARALLEL_M else math.nan


def side_offsets(track: Track, other: Track, max_offset: float = MAX_SIDE_OFFSET_M) -> Floats:
    """Return (T,) how far [m, left positive] another vehicle is beside one; NaN: it is not."""
    reach = (track.vehicle.length + other.vehicle.length) / 2.0
    ahead, left = ahead_and_left((other.poses - track.poses)[:, :2], track.poses[:, 2])
    alike = np.abs(wrap_angle(other.poses[:, 2] - track.poses[:, 2])) < SAME_DIRECTION_RAD
    offset = np.abs(left)
    near = (np.abs(ahead) < reach) & (offset > _MIN_SIDE_OFFSET_M) & (offset < max_offset)
    both = track.is_present & other.is_present
    return np.where(alike & near & both, left, np.nan)


def abreast_in_lane(tracks: tuple[Track, ...]) -> list[Abreast]:
    """Return the pairs with paths side by side in one lane, one of the two on two wheels."""
    drivers = [
        n for n, track in enumerate(tracks) if not (track.vehicle.kind.walks or track.still)
    ]
    pairs = []
    for a, b in combinations(drivers, 2):
        first, second = tracks[a], tracks[b]
        if not (first.vehicle.is_narrow or second.vehicle.is_narrow):
            continue
        offsets = path_offsets(first, second)
        samples = np.abs(offsets) < _ONE_LANE_OFFSET_M
        driven = second.progress[samples]
        if not _is_long(driven):
            continue
        offset = float(np.median(offsets[samples]))
        if abs(offset) > _MIN_SIDE_OFFSET_M:
            on_first, _ = first.curve.project(second.poses[samples, :2])
            spans = np.array([[each.min(), each.max()] for each in (on_first, driven)])
            clearance = abs(offset) - (first.vehicle.width + second.vehicle.width) / 2.0
            pairs.append(Abreast((a, b), offset, clearance, samples, spans))
    return pairs


def _is_long(driven: Floats) -> bool:
    """Return whether progress (K,) [m] is that of a shared lane rather than of a crossing."""
    return bool(len(driven) and np.ptp(driven) > _MIN_LENGTH_M)


def path_offsets(track: Track, other: Track) -> Floats:
    """Return (T,) how far [m, left positive] another vehicle is beside the path of one.

    NaN where it is beyond the ends of this path, absent, or drives in another direction.
    """
    station, offset = track.curve.project(other.poses[:, :2])
    turned = wrap_angle(other.poses[:, 2] - track.curve.at(station)[:, 2])
    on_path = (station > 0.0) & (station < track.travelled)
    alongside = on_path & other.is_present & (np.abs(turned) < SAME_DIRECTION_RAD)
    return np.where(alongside, offset, np.nan)
