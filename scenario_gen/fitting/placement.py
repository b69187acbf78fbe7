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

"""A template placed on a road: what every way of placing it answers, before changepoints come in."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scenario_gen.arrays import Floats
from scenario_gen.errors import RefusedError
from scenario_gen.fitting.config import FittingConfig
from scenario_gen.roads.clearance import footprint_fits
from scenario_gen.roads.repair import nearest_pose_with_room
from scenario_gen.roads.road import Road
from scenario_gen.roads.separation import separate
from scenario_gen.roads.tracks import Track


@dataclass(frozen=True, eq=False)
class Placement:
    """N vehicles' motion on the road. It knows nothing of changepoints, so the ends do not depend on them.

    Attributes:
        tracks: paths on the road, and the progress along them at each of the template's samples.
        scale: (N,) s of eq 9.
        manoeuvre: what each vehicle does on the road.
        moved: (N,) metres by which whole paths were shifted to keep vehicles apart.
        notes: what was decided, in sentences.
    """

    tracks: tuple[Track, ...]
    scale: Floats
    manoeuvre: tuple[str, ...]
    moved: Floats
    notes: tuple[str, ...]


def check_scale(scale: float, what: str, config: FittingConfig) -> None:
    """Raise RefusedError if a scale is too far from one."""
    if not config.scale_low <= scale <= config.scale_high:
        raise RefusedError(
            f"{what} would need scale {scale:.2f}; accepted is {config.scale_low:g} to {config.scale_high:g} "
            f"(scale shrinks gaps but not cars)"
        )


def kept_apart(placement: Placement, config: FittingConfig, *, sideways: float) -> Placement:
    """Shift vehicles that come too close on this road, as little as possible."""
    separation = separate(placement.tracks, config.clearance, config.max_move, sideways=sideways)
    return Placement(
        tracks=separation.tracks,
        scale=placement.scale,
        manoeuvre=placement.manoeuvre,
        moved=placement.moved + separation.moved,
        notes=(*placement.notes, *separation.notes),
    )


def room(road: Road, track: Track, every: int = 5) -> Floats:
    """Share of the track's samples (every n-th and the last) at which its footprint has room: a number from 0 to 1."""
    poses = np.concatenate((track.poses[:-1:every], track.poses[-1:]))
    return np.asarray(footprint_fits(road, poses, track.vehicle.length, track.vehicle.width).mean())


def farthest_repair(tracks: Sequence[Track], road: Road, max_move: float) -> float:
    """How far [m] the worst sampled footprint (twice a second, and the ends) is from a pose with room.

    Raises:
        RefusedError: one is farther than `max_move`; the message names vehicle, sample and place.
    """
    farthest = 0.0
    for track in tracks:
        poses = track.poses
        for t in sorted({0, len(poses) - 1, *range(0, len(poses), 5)}):
            answer = nearest_pose_with_room(road, poses[t], track.vehicle.length, track.vehicle.width, max_move)
            if answer is None:
                raise RefusedError(
                    f"vehicle {track.vehicle.id} is more than {max_move:g} m from any pose with room on road {road.name} "
                    f"at sample {t} (x {poses[t, 0]:.1f}, y {poses[t, 1]:.1f})"
                )
            farthest = max(farthest, answer[1])
    return farthest
