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

"""What traffic says of a drive, as messages: where everyone is, and the verdict."""

from collections.abc import Iterator, Sequence
import json

import numpy as np

from msg_conventions import driving
from msg_conventions.diagnostics import encode_diagnostics, Level, Status
from msg_conventions.frames import encode_frames
from scenario_gen.arrays import Floats
from scenario_gen.closed_loop.local_map import local_map
from scenario_gen.closed_loop.simulation import ClosedLoop, State
from scenario_gen.closed_loop.trials import Outcome
from scenario_gen.nodes.ego_commands import stamp_of


def encode_odometries(states: Sequence[State], children: Sequence[str], period: float, frame: str) -> Iterator[tuple[int, bytes]]:
    """Yield index and CDR bytes of the odometry of each vehicle that is there.

    Args:
        states: the drive's last two, or its first alone.
        children: the vehicles' own frames.
        period: seconds between the two states.
        frame: of the scenario.
    """
    before, state = states[0], states[-1]
    turned = (state.vehicles[:, 2] - before.vehicles[:, 2]) / period
    for i in np.flatnonzero(state.here).tolist():
        yield i, driving.encode_odometry(state.vehicles[i], float(turned[i]), children[i], frame, stamp_of(state))


def encode_poses(state: State, children: Sequence[str], frame: str) -> bytes:
    """Return the CDR bytes of the frames of all vehicles that are there; `children` has everyone's."""
    here = np.flatnonzero(state.here).tolist()
    poses: Floats = state.vehicles[here, :3]
    return encode_frames(poses, [children[i] for i in here], frame, stamp_of(state))


def encode_surroundings(loop: ClosedLoop, state: State) -> bytes:
    """Return the CDR bytes of the local map about the ego."""
    grid, frame = local_map(loop, state), loop.scenario.frame_id
    return driving.encode_local_map(grid.blocked, grid.resolution, grid.origin, frame, stamp_of(state))


def encode_verdict(node: str, outcome: Outcome, stamp_ns: int) -> bytes:
    """Return the CDR bytes of a verdict, with the first things that were wrong with the ego."""
    verdict = outcome.verdict
    values = {key: json.dumps(value) for key, value in verdict.document().items()}
    if outcome.drive.faults:
        values["first_faults"] = json.dumps(outcome.drive.faults[:5])
    level = Level.OK if verdict.passed else Level.ERROR
    return encode_diagnostics([Status(f"{node}: scenario {outcome.name}", level, verdict.sentence(), values)], stamp_ns)
