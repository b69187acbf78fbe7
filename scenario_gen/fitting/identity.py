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

"""The template's own frame: a map recorded in it, or a corridor drawn around it."""

import numpy as np

from scenario_gen.arrays import frozen
from scenario_gen.encounter import Encounter
from scenario_gen.fitting.config import FittingConfig
from scenario_gen.fitting.placement import farthest_repair, Placement, room
from scenario_gen.roads.own_paths import own_paths
from scenario_gen.roads.road import Road


def place_in_own_frame(encounter: Encounter, road: Road, config: FittingConfig) -> tuple[Placement, float]:
    """Leave the template where it was recorded (only pulled apart where the record has vehicles overlap).

    Returns:
        The placement, and the share of sampled footprints that have room as they are.

    Raises:
        RefusedError: a sampled pose is farther than `max_move` from the nearest with room.
    """
    separation = own_paths(encounter)
    shares = [float(room(road, track)) for track in separation.tracks]
    farthest_repair([t for t, share in zip(separation.tracks, shares, strict=True) if share < 1.0], road, config.max_move)
    n = len(separation.tracks)
    placement = Placement(
        tracks=separation.tracks,
        scale=frozen(np.ones(n)),
        manoeuvre=tuple("wait" if track.still else "own path" for track in separation.tracks),
        moved=separation.moved,
        notes=(f"placed on road {road.name} in the template's own frame", *separation.notes),
    )
    return placement, float(np.mean(shares))
