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

"""Scenario ⇄ `scenarios` (conventions: trajectory.py).

Frame: the road's. Stamp: the template's, so that the bytes depend on nothing but what was asked; a scenario's SHA-256 joins it
with its `scenarios/info`, which also holds seed and index. QoS: reliable, transient_local, depth 1000.
"""

import hashlib

import numpy as np

from msg_conventions import trajectory
from msg_conventions.cdr import NANOSECONDS
from msg_conventions.trajectory import Trajectory
from scenario_gen.errors import InputError
from scenario_gen.types.scenario import Scenario


def encode_scenario(scenario: Scenario, stamp_ns: int) -> bytes:
    """Return the scenario as CDR bytes."""
    return trajectory.encode(
        Trajectory(
            stamp_ns=stamp_ns,
            frame_id=scenario.frame_id,
            vehicles=scenario.vehicles,
            time_ns=np.rint(scenario.time * NANOSECONDS).astype(np.int64),
            position=scenario.position,
            heading=scenario.heading,
            speed=scenario.speed,
            acceleration=scenario.acceleration,
        )
    )


def decode_scenario(data: bytes, *, seed: int = 0, index: int = 0, what: str = "scenarios") -> tuple[int, Scenario]:
    """Return the stamp [ns] and the scenario; seed and index are in its `scenarios/info`.

    Raises:
        InputError: the message is damaged or its times do not increase from 0.
    """
    message = trajectory.decode(data, what)
    if len(message.time_ns) < 2:
        raise InputError(f"{what}: {len(message.time_ns)} point(s); at least 2 are needed")
    if message.time_ns[0] != 0 or (np.diff(message.time_ns) <= 0).any():
        begin = (
            f"it begins at {message.time_ns[0] * 1e-9:g} s" if message.time_ns[0] else "a point is not later than the one before"
        )
        raise InputError(f"{what}: {begin}; time_from_start must increase from 0")
    if message.time_ns[-1] > trajectory.LONGEST_NS:
        raise InputError(
            f"{what}: it lasts {message.time_ns[-1] * 1e-9:g} s; at most {trajectory.LONGEST_NS * 1e-9:g} s are read"
        )
    scenario = Scenario(
        vehicles=message.vehicles,
        time=message.time_ns / NANOSECONDS,
        position=message.position,
        heading=message.heading,
        speed=message.speed,
        acceleration=message.acceleration,
        seed=seed,
        index=index,
        frame_id=message.frame_id,
    )
    return message.stamp_ns, scenario


def digest(data: bytes) -> str:
    """Return the SHA-256 of a scenario's CDR bytes, in hexadecimal."""
    return hashlib.sha256(data).hexdigest()
