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

"""The ego slot: one vehicle is left out of what is published, and its template track on the road is given instead."""

from itertools import pairwise

import numpy as np

from scenario_gen import exact
from scenario_gen.types.encounter import Encounter
from scenario_gen.types.route import Route
from scenario_gen.types.scenario import BoundaryStates, Scenario
from scenario_gen.types.segmentation import Segmentation


def ego_track(
    encounter: Encounter, segmentation: Segmentation, route: Route, asked: BoundaryStates, ego: int, frame_id: str
) -> Scenario:
    """Return how vehicle `ego` drove in the template, along its planned route: a scenario of one vehicle on the template's clock.

    Between two anchors the share of the way is the template's at every sample, so a stand stays one, and the speed is the
    template's times the ratio of the two lengths. Start and end have the asked states.
    """
    speed, steps = encounter.speed[ego], encounter.speed.shape[1]
    driven = np.concatenate([[0.0], np.cumsum(0.5 * encounter.dt * (speed[1:] + speed[:-1]))])
    way = np.concatenate([[0.0], np.cumsum(exact.hypot(*np.diff(route.points[:, :2], axis=0).T))])  # as a message's reader has it
    index = [0, *segmentation.changepoints.tolist(), steps - 1]
    at, pace = np.empty(steps), np.empty(steps)
    for (first, last), (a, b) in zip(pairwise(index), pairwise(way[route.anchor].tolist()), strict=True):
        piece = slice(first, last + 1)
        length = driven[last] - driven[first]
        if length > 1e-3:
            at[piece] = a + (b - a) / length * (driven[piece] - driven[first])
            pace[piece] = (b - a) / length * speed[piece]
        else:  # where the template stands, the route hardly moves
            at[piece] = np.linspace(a, b, last + 1 - first)
            pace[piece] = (b - a) / (encounter.time[last] - encounter.time[first])
    state = np.column_stack([np.interp(at, way, route.points[:, c]) for c in range(3)])
    state[0], state[-1] = route.points[0], route.points[-1]
    pace[0], pace[-1] = asked.start[ego, 3], asked.end[ego, 3]
    return Scenario(
        vehicles=(encounter.vehicles[ego],),
        time=encounter.time,
        position=state[None, :, :2],
        heading=state[None, :, 2],
        speed=pace[None],
        acceleration=np.gradient(pace, encounter.dt)[None],
        frame_id=frame_id,
    )
