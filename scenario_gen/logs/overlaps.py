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

"""Overlaps of recorded footprints: counted, never repaired."""

from itertools import combinations

import numpy as np
import shapely

from scenario_gen import exact
from scenario_gen.arrays import Floats
from scenario_gen.encounter import Encounter
from scenario_gen.logs.quality import Overlap


def footprints(encounter: Encounter, vehicle: int) -> Floats:
    """(T, 4, 2) corners of a vehicle's footprint, counter-clockwise from the rear right."""
    body = encounter.vehicles[vehicle]
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [body.length / 2.0, body.width / 2.0]
    cos, sin = exact.cos(encounter.heading[vehicle]), exact.sin(encounter.heading[vehicle])
    turn = np.stack([np.stack([cos, -sin], axis=-1), np.stack([sin, cos], axis=-1)], axis=-2)
    turned: Floats = exact.matmul(corners, np.swapaxes(turn, 1, 2)) + encounter.position[vehicle][:, None, :]
    return turned


def find_overlaps(encounter: Encounter) -> tuple[Overlap, ...]:
    """Return the pairs whose footprints overlap at some sample, with the share of samples and the largest area."""
    polygons = [shapely.polygons(footprints(encounter, n)) for n in range(len(encounter.vehicles))]
    found = []
    for a, b in combinations(range(len(polygons)), 2):
        area = shapely.area(shapely.intersection(polygons[a], polygons[b]))
        share = float((area > 0.0).mean())
        if share > 0.0:
            found.append(Overlap(encounter.vehicles[a].id, encounter.vehicles[b].id, share, float(area.max())))
    return tuple(found)
