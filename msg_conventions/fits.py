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

"""Fit ⇄ `fit`: the changepoints on the road (conventions: trajectory.py).

Points are the anchors (start, changepoints, end) in the road's frame, at the template's times; the first and last are the
states asked of every scenario, speed included. Speeds in between are the template's, scaled, for whoever wants them.
What the fitting decided travels as sentences in diagnostics. QoS: reliable, transient_local, depth 1.
"""

from typing import TYPE_CHECKING

import numpy as np

from msg_conventions import trajectory
from msg_conventions.trajectory import Trajectory, TYPE
from scenario_gen.arrays import Floats, Ints
from scenario_gen.encounter import Encounter
from scenario_gen.errors import InputError
from scenario_gen.scenario import BoundaryStates

if TYPE_CHECKING:
    from scenario_gen.fitting.result import Fit

__all__ = ["TYPE", "anchor_stamps", "decode_fit", "encode_fit"]


def anchor_stamps(encounter: Encounter, changepoints: Ints) -> list[int]:
    """Return the K + 2 stamps [ns] of start, changepoints and end on the template's clock."""
    index = [0, *changepoints.tolist(), encounter.speed.shape[1] - 1]
    return [encounter.start_ns + k * encounter.dt_ns for k in index]


def encode_fit(encounter: Encounter, fit: "Fit", frame_id: str) -> bytes:
    """Return the anchors as CDR bytes; `frame_id` is the road's."""
    poses = np.stack([vehicle.anchors for vehicle in fit.fitted])
    speed = encounter.speed[:, fit.anchor_index] * np.array([[vehicle.scale] for vehicle in fit.fitted])
    for k, state in ((0, fit.asked.start), (-1, fit.asked.end)):
        poses[:, k], speed[:, k] = state[:, :3], state[:, 3]
    return trajectory.encode(
        Trajectory(
            stamp_ns=encounter.start_ns,
            frame_id=frame_id,
            vehicles=fit.vehicles,
            time_ns=fit.anchor_index * encounter.dt_ns,
            position=poses[..., :2],
            heading=poses[..., 2],
            speed=speed,
            acceleration=np.zeros_like(speed),
        )
    )


def decode_fit(data: bytes, what: str = "fit") -> tuple[int, str, BoundaryStates, Floats]:
    """Return stamp [ns], frame, the asked states, and the anchors (N, K + 2, 3) x, y, yaw.

    Raises:
        InputError: the message is damaged or has no start and end.
    """
    message = trajectory.decode(data, what)
    if len(message.time_ns) < 2:
        raise InputError(f"{what}: {len(message.time_ns)} point(s); a start and an end are needed")
    state = np.concatenate([message.position, message.heading[..., None], message.speed[..., None]], axis=-1)
    return message.stamp_ns, message.frame_id, BoundaryStates(start=state[:, 0], end=state[:, -1]), state[..., :3]
