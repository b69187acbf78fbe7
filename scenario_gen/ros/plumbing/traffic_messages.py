# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What traffic says of a drive, as messages: where everyone is, and the verdict."""

from collections.abc import Callable, Iterator, Sequence
import json

import numpy as np

from msg_conventions import driving
from msg_conventions.autoware import encode_kinematic_state, encode_predicted_objects, HORIZON_NS, OBJECTS, STEP_NS
from msg_conventions.diagnostics import encode_diagnostics, Level, Status
from msg_conventions.frames import encode_frames
from msg_conventions.odometry import encode_odometry
from msg_conventions.pictures import vehicle_markers
from msg_conventions.topics import vehicle_topic
from scenario_gen.closed_loop.local_map import local_map
from scenario_gen.closed_loop.simulation import ClosedLoop, State
from scenario_gen.closed_loop.trials import Outcome
from scenario_gen.numerics import Floats
from scenario_gen.ros.plumbing.ego_commands import stamp_of

GRID_EVERY = 0.2  # seconds of the drive between two local maps


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
        yield i, encode_odometry(state.vehicles[i], float(turned[i]), children[i], frame, stamp_of(state))


def encode_poses(state: State, children: Sequence[str], frame: str) -> bytes:
    """Return the CDR bytes of the frames of all vehicles that are there; `children` has everyone's."""
    here = np.flatnonzero(state.here).tolist()
    poses: Floats = state.vehicles[here, :3]
    return encode_frames(poses, [children[i] for i in here], frame, stamp_of(state))


def encode_surroundings(loop: ClosedLoop, state: State) -> bytes:
    """Return the CDR bytes of the local map about the ego."""
    grid, frame = local_map(loop, state), loop.scenario.frame_id
    return driving.encode_local_map(grid.blocked, grid.resolution, grid.origin, frame, stamp_of(state))


def encode_predictions(loop: ClosedLoop, states: Sequence[State]) -> bytes:
    """Return the others that are there as the CDR bytes of PredictedObjects.

    Each one's predicted path is what it does if nothing changes: on its certified path, its clock at its present rate.

    Args:
        loop: the drive.
        states: its last two, or its first alone.
    """
    state, known = states[-1], loop.certified
    others = [i for i in np.flatnonzero(state.here).tolist() if i != loop.ego]
    ahead = np.arange(0.0, HORIZON_NS + 1.0, STEP_NS) * 1e-9
    time = known.scenario.time
    paths = []
    for i in others:
        at = np.minimum(state.clock[i] + state.rate[i] * ahead, known.spans[i, 1])
        paths.append(np.column_stack([np.interp(at, time, known.motion[i, :, c]) for c in range(3)]))
    objects = [known.scenario.vehicles[i] for i in others]
    return encode_predicted_objects(objects, _rates(loop, states)[others], paths, known.scenario.frame_id, stamp_of(state))


def encode_ego(loop: ClosedLoop, states: Sequence[State]) -> bytes:
    """Return the CDR bytes of the ego's Odometry as Autoware takes it, at its rear axle; arguments as above."""
    vehicle = loop.scenario.vehicles[loop.ego]
    return encode_kinematic_state(vehicle, _rates(loop, states)[loop.ego], loop.scenario.frame_id, stamp_of(states[-1]))


def _rates(loop: ClosedLoop, states: Sequence[State]) -> Floats:
    """Return (N, 6) x, y [m], yaw [rad], speed [m/s], acceleration [m/s²], yaw rate [rad/s] of all."""
    before, now = states[0].vehicles, states[-1].vehicles
    return np.column_stack([now, (now[:, 3] - before[:, 3]) / loop.config.step, (now[:, 2] - before[:, 2]) / loop.config.step])


def encode_verdict(node: str, outcome: Outcome, stamp_ns: int) -> bytes:
    """Return the CDR bytes of a verdict, with the first things that were wrong with the ego."""
    verdict = outcome.verdict
    values = {key: json.dumps(value) for key, value in verdict.document().items()}
    if outcome.drive.faults:
        values["first_faults"] = json.dumps(outcome.drive.faults[:5])
    level = Level.OK if verdict.passed else Level.ERROR
    return encode_diagnostics([Status(f"{node}: scenario {outcome.name}", level, verdict.sentence(), values)], stamp_ns)


def surroundings(
    loop: ClosedLoop, states: Sequence[State], names: Sequence[str], autoware: Sequence[str], is_heard: Callable[[str], bool]
) -> Iterator[tuple[str, bytes]]:
    """Yield the messages that tell of the last state, by topic; the ego's odometry comes last.

    Args:
        loop: the drive.
        states: the last state, and the one before it if there is one.
        names: tokens of the vehicles.
        autoware: those of Autoware's topics that are wanted.
        is_heard: whether somebody listens to a topic.
    """
    state, frame = states[-1], loop.scenario.frame_id
    stamp, children = stamp_of(state), tuple(f"vehicle_{name}" for name in names)
    yield "/clock", driving.encode_clock(stamp)
    odometries = dict(encode_odometries(states, children, loop.config.step, frame))
    own = odometries.pop(loop.ego)
    for i, data in odometries.items():
        yield vehicle_topic(names[i], "odom"), data
    yield "/tf", encode_poses(state, children, frame)
    if is_heard("traffic/markers"):
        vehicles = loop.scenario.vehicles
        yield "traffic/markers", vehicle_markers(vehicles, state.vehicles, state.here, loop.ego, frame, stamp)
    every = max(round(GRID_EVERY / loop.config.step), 1)
    if state.step % every == 0 and loop.road is not None and is_heard("traffic/local_map"):
        yield "traffic/local_map", encode_surroundings(loop, state)
    for topic in autoware:
        yield topic, (encode_predictions if topic == OBJECTS else encode_ego)(loop, states)
    yield vehicle_topic(names[loop.ego], "odom"), own
