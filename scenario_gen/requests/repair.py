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

"""Repairs of an impossible request that need no search: room on the road, room beside the others, speeds within the limit."""

from collections.abc import Mapping

import numpy as np

from scenario_gen import exact
from scenario_gen.arrays import Floats
from scenario_gen.encounter import Vehicle
from scenario_gen.requests.chain import Chain
from scenario_gen.requests.request import ENDS, Request, State
from scenario_gen.roads import Road
from scenario_gen.roads.clearance import footprint_fits
from scenario_gen.roads.repair import nearest_pose_with_room
from scenario_gen.roads.separation import footprint_gap
from scenario_gen.sampling.ego import vehicle_index

FAR = 30.0  # m, how far a pose with room is looked for
_OFFSETS = (0.25 * np.arange(1, 121)).tolist()  # m, by which an overlapping footprint is moved along its heading
_MARGINS = (0.0, 0.01, 0.02, 0.05, 0.1, 0.2)  # m, beyond the nearest pose with room, until a pose in whole centimetres has it


def elements(request: Request) -> list[tuple[str, str]]:
    """Return (end, vehicle) of every state that is asked for."""
    return [(end, name) for end in ENDS for name in request.states(end)]


def with_state(request: Request, end: str, name: str, state: State) -> Request:
    """Return the request with another state of one vehicle at one end."""
    return request.with_states(end, request.states(end) | {name: state})


def moved(state: State, pose: Floats) -> State:
    """Return the state at another pose, in whole centimetres and tenths of a milliradian, its speed as it was."""
    return (*np.round(pose[:2], 2).tolist(), round(float(pose[2]), 4), *state[3:])


def repaired(chain: Chain, request: Request, base: Mapping[str, Floats]) -> Request:
    """Return the request with each state moved as little as it takes; `base` has the fitting's own states (N, 4) by end."""
    for end, name in elements(request):
        vehicle = chain.encounter.vehicles[vehicle_index(chain.encounter, name, end)]
        state = request.states(end)[name]
        pose = np.array(state[:3])
        answer = nearest_pose_with_room(chain.road, pose, vehicle.length, vehicle.width, FAR)
        if answer is not None and answer[1] > 0.0:
            state = _with_room(chain.road, vehicle, answer[0], pose) + state[3:]
        if len(state) == 4:
            state = (*state[:3], min(state[3], chain.sampling.max_speed))
        request = with_state(request, end, name, state)
    for end, name in elements(request):
        request = _apart(chain, request, base, end, name)
    return request


def _with_room(road: Road, vehicle: Vehicle, pose: Floats, asked: Floats) -> State:
    """The pose in whole centimetres, as little beyond the nearest one as its footprint then needs."""
    away = (pose - asked)[:2] / exact.hypot(*(pose - asked)[:2])
    for margin in _MARGINS:
        tried = np.array([*np.round(pose[:2] + margin * away, 2), asked[2]])
        if footprint_fits(road, tried[None], vehicle.length, vehicle.width)[0]:
            return tuple(tried.tolist())
    return tuple(pose.tolist())


def _apart(chain: Chain, request: Request, base: Mapping[str, Floats], end: str, name: str) -> Request:
    """Move a footprint that overlaps another one along its heading until it no longer does; as it was, if nowhere is room."""
    vehicles = chain.encounter.vehicles
    n = vehicle_index(chain.encounter, name, end)
    rows = request.rows(end, chain.encounter)[:, :3]
    if base:
        rows = np.where(np.isnan(rows), base[end][:, :3], rows)
    others = [m for m in range(len(rows)) if m != n and not np.isnan(rows[m, 0])]

    def gap(pose: Floats) -> float:
        gaps = [footprint_gap(vehicles[n], pose[None], vehicles[m], rows[[m]])[0][0] for m in others]
        return float(min(gaps, default=np.inf))

    state = request.states(end)[name]
    if gap(np.array(state[:3])) > 0.0:
        return request
    ahead = np.array([exact.cos(state[2]), exact.sin(state[2]), 0.0])
    for offset in (sign * step for step in _OFFSETS for sign in (1.0, -1.0)):
        tried = moved(state, np.array(state[:3]) + offset * ahead)
        pose = np.array(tried[:3])
        fits = footprint_fits(chain.road, pose[None], vehicles[n].length, vehicles[n].width)[0]
        if fits and gap(pose) >= chain.fitting.clearance:
            return with_state(request, end, name, tried)
    return request
