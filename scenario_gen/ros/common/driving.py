# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Between traffic and a planner under test: commands to the ego, arriving trials, messages of a drive."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
import json

import numpy as np

from msg_conventions import driving
from msg_conventions.autoware import (
    encode_kinematic_state,
    encode_predicted_objects,
    HORIZON_NS,
    OBJECTS,
    STEP_NS,
)
from msg_conventions.diagnostics import encode_diagnostics, Level, Status
from msg_conventions.ego import encode_state
from msg_conventions.frames import encode_frames
from msg_conventions.hashes import hash_of
from msg_conventions.odometry import decode_odometry, encode_odometry
from msg_conventions.paths import encode_path
from msg_conventions.pictures import vehicle_markers
from msg_conventions.roads import decode_map
from msg_conventions.topics import vehicle_topic
from scenario_gen.bags.recordings.arriving import ArrivingScenarios
from scenario_gen.base.errors import InputError, ScenarioGenError
from scenario_gen.closed_loop.ego import Command, Pose
from scenario_gen.closed_loop.local_map import local_map
from scenario_gen.closed_loop.origin import Trial
from scenario_gen.closed_loop.simulation import ClosedLoop, State
from scenario_gen.closed_loop.tracking import of_twist, Track
from scenario_gen.closed_loop.trials import Outcome, trial_of
from scenario_gen.numerics import Floats
from scenario_gen.types import Road

INPUTS = ("ego/cmd_vel", "ego/cmd_vel_stamped", "ego/trajectory", "ego/path", "ego/odom")
WAYS = ("ego/trajectory", "ego/path")  # their times say for when they are; they may be old
FIRST_STAMP = (
    1_000_000_000  # ns of a drive's clock at its start: a time of 0 means that none is known
)


@dataclass(frozen=True, eq=False)
class EgoCommand:
    """A message that commands the ego.

    Attributes:
        topic: where it came from.
        step: of the state that it answers: by its stamp, on the drive's clock, else the last one when it came.
        stamp_ns: its stamp [ns]; 0 if it has none.
        at: returns the command for a state.
        fault: why it does not count; "" if it does.
    """

    topic: str
    step: int
    stamp_ns: int
    at: Callable[[State], Command | Pose | None]
    fault: str = ""

    def fault_at(self, state: State, period: float, silence: float) -> str:
        """Return why it does not count now, "" if it does: its fault, or that it is older than `silence` [s].

        Args:
            state: the drive's last state.
            period: seconds of a step.
            silence: seconds after which a command is none.
        """
        if self.fault or self.topic in WAYS:
            return self.fault
        old = (state.step - self.step) * period
        if self.stamp_ns:
            old = max(old, stamp_of(state) * 1e-9 - self.stamp_ns * 1e-9)
        return f"{self.topic}: the last command is {old:.1f} s old" if old > silence else ""


def stamp_of(state: State) -> int:
    """Return a state's time on the drive's clock [ns]."""
    return FIRST_STAMP + round(state.time * 1e9)


def decode_command(topic: str, data: bytes, loop: ClosedLoop, child: str, step: int) -> EgoCommand:
    """Return the command of a message; a message that is damaged, or in another frame, has none, and a fault.

    Args:
        topic: one of `INPUTS`.
        data: its CDR bytes.
        loop: the drive.
        child: the ego's own frame.
        step: the drive's last step.
    """
    try:
        return _decoded(topic, data, loop, child, step)
    except ScenarioGenError as error:
        return EgoCommand(topic, step, 0, lambda _: None, str(error))


def _decoded(topic: str, data: bytes, loop: ClosedLoop, child: str, step: int) -> EgoCommand:
    period, frame, own = loop.config.step, loop.scenario.frame_id, (child, "base_link", "")

    def answered(stamp_ns: int) -> int:
        return (
            min(step, round((stamp_ns - FIRST_STAMP) * 1e-9 / period))
            if stamp_ns >= FIRST_STAMP
            else step
        )

    if topic.startswith("ego/cmd_vel"):
        stamp, given_frame, speed, rate = driving.decode_twist(
            data, topic, stamped=topic.endswith("stamped")
        )
        if given_frame not in own and given_frame != frame:
            raise InputError(
                f"{topic}: frame {given_frame!r} is not the ego's; {', '.join(map(repr, own[:2]))} are"
            )
        return EgoCommand(
            topic, answered(stamp), stamp, lambda state: of_twist(state.ego, speed, rate, period)
        )
    if topic in WAYS:
        decode = (
            driving.decode_trajectory if topic == "ego/trajectory" else driving.decode_timed_path
        )
        way = decode(data, topic)
        stamp, given_frame = 0, way.frame_id
        track = Track.of((way.time_ns - FIRST_STAMP) * 1e-9, way.poses)

        def command(state: State) -> Command | Pose | None:
            return track.command(state.ego, state.time, period)

    else:
        stamp, given_frame, _, state = decode_odometry(data, topic)
        pose = Pose(*state[:4].tolist())

        def command(state: State) -> Command | Pose | None:
            return pose

    if given_frame != frame:
        raise InputError(f"{topic}: frame {given_frame!r} is not that of the scenario, {frame!r}")
    return EgoCommand(topic, answered(stamp), stamp, command)


class ArrivingTrials:
    """Makes trials of scenarios that arrive live, each on the road that its entry names."""

    def __init__(self) -> None:
        self._roads: dict[str, Road] = {}  # by the hash of their map
        self._scenarios = ArrivingScenarios()

    @property
    def unmatched(self) -> int:
        """The number of messages that wait for their entry."""
        return self._scenarios.unmatched

    def take(self, topic: str, data: bytes, ego: str) -> Iterator[Trial]:
        """Take a map, or a message of a scenario; yield the trials that are complete by it, driven in the place of `ego`.

        Raises:
            ScenarioGenError: the message is damaged, or the scenario has no such vehicle.
        """
        if topic == "map":
            self._roads[hash_of("map", data)] = decode_map(data)[1]
            return
        for entry, _, scenario in self._scenarios.take(topic, data):
            name, road = f"{entry.request} {entry.index}", self._roads.get(entry.map_hash or "")
            yield trial_of(name, scenario, entry, road, ego, f"scenario {name}")


def task_messages(loop: ClosedLoop, child: str) -> Iterator[tuple[str, bytes]]:
    """Yield the ego's goal and route as CDR bytes, by topic; `child` is the ego's own frame."""
    task, frame = loop.task(), loop.scenario.frame_id
    stamps = np.full(len(task.route), FIRST_STAMP, dtype=np.int64)
    yield "ego/goal", encode_state(task.goal, child, frame, FIRST_STAMP)
    yield "ego/route", encode_path(task.route, stamps, frame, FIRST_STAMP)


GRID_EVERY = 0.2  # seconds of the drive between two local maps


def encode_odometries(
    states: Sequence[State], children: Sequence[str], period: float, frame: str
) -> Iterator[tuple[int, bytes]]:
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
        yield (
            i,
            encode_odometry(
                state.vehicles[i], float(turned[i]), children[i], frame, stamp_of(state)
            ),
        )


def encode_predictions(loop: ClosedLoop, states: Sequence[State]) -> bytes:
    """Return the others that are there as the CDR bytes of PredictedObjects.

    Each one's predicted path is what it does if nothing changes: on its certified path, its clock at its present rate.

    Args:
        loop: the drive.
        states: its last two, or its first alone.
    """
    state, known = states[-1], loop.world
    others = [i for i in np.flatnonzero(state.here).tolist() if i != loop.ego]
    ahead = np.arange(0.0, HORIZON_NS + 1.0, STEP_NS) * 1e-9
    paths = []
    for i in others:
        at = np.minimum(state.clock[i] + state.rate[i] * ahead, known.spans[i, 1])
        paths.append(loop.scenario.at(at).poses[i])
    objects = [loop.scenario.vehicles[i] for i in others]
    return encode_predicted_objects(
        objects, _rates(loop, states)[others], paths, loop.scenario.frame_id, stamp_of(state)
    )


def encode_ego(loop: ClosedLoop, states: Sequence[State]) -> bytes:
    """Return the CDR bytes of the ego's Odometry as Autoware takes it, at its rear axle; arguments as above."""
    vehicle = loop.scenario.vehicles[loop.ego]
    return encode_kinematic_state(
        vehicle, _rates(loop, states)[loop.ego], loop.scenario.frame_id, stamp_of(states[-1])
    )


def _rates(loop: ClosedLoop, states: Sequence[State]) -> Floats:
    """Return (N, 6) x, y [m], yaw [rad], speed [m/s], acceleration [m/s²], yaw rate [rad/s] of all."""
    before, now = states[0].vehicles, states[-1].vehicles
    return np.column_stack(
        [
            now,
            (now[:, 3] - before[:, 3]) / loop.config.step,
            (now[:, 2] - before[:, 2]) / loop.config.step,
        ]
    )


def encode_verdict(node: str, outcome: Outcome, stamp_ns: int) -> bytes:
    """Return the CDR bytes of a verdict, with the first things that were wrong with the ego."""
    verdict = outcome.verdict
    values = {key: json.dumps(value) for key, value in verdict.document().items()}
    if outcome.drive.faults:
        values["first_faults"] = json.dumps(outcome.drive.faults[:5])
    level = Level.OK if verdict.passed else Level.ERROR
    return encode_diagnostics(
        [Status(f"{node}: scenario {outcome.name}", level, verdict.sentence(), values)], stamp_ns
    )


def surroundings(
    loop: ClosedLoop,
    states: Sequence[State],
    names: Sequence[str],
    autoware: Sequence[str],
    heard: Callable[[str], bool],
) -> Iterator[tuple[str, bytes]]:
    """Yield the messages of the last state, by topic; the ego's odometry comes last.

    Args:
        loop: the drive.
        states: the last state, and the one before it if there is one.
        names: tokens of the vehicles.
        autoware: Autoware's topics to publish.
        heard: whether a topic has subscribers.
    """
    state, frame = states[-1], loop.scenario.frame_id
    stamp, children = stamp_of(state), tuple(f"vehicle_{name}" for name in names)
    yield "/clock", driving.encode_clock(stamp)
    odometries = dict(encode_odometries(states, children, loop.config.step, frame))
    own = odometries.pop(loop.ego)
    for i, data in odometries.items():
        yield vehicle_topic(names[i], "odom"), data
    here = np.flatnonzero(state.here)
    yield (
        "/tf",
        encode_frames(
            state.vehicles[here, :3], [children[i] for i in here.tolist()], frame, stamp
        ),
    )
    if heard("traffic/markers"):
        vehicles = loop.scenario.vehicles
        yield (
            "traffic/markers",
            vehicle_markers(vehicles, state.vehicles, state.here, loop.ego, frame, stamp),
        )
    every = max(round(GRID_EVERY / loop.config.step), 1)
    if state.step % every == 0 and loop.road is not None and heard("traffic/local_map"):
        grid = local_map(loop, state)
        yield (
            "traffic/local_map",
            driving.encode_local_map(grid.blocked, grid.resolution, grid.origin, frame, stamp),
        )
    for topic in autoware:
        yield topic, (encode_predictions if topic == OBJECTS else encode_ego)(loop, states)
    yield vehicle_topic(names[loop.ego], "odom"), own
