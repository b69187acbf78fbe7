# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Messages between traffic and a planner under test.

Parameters, commands to the ego, live trials, states of a drive.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
import json
from time import time_ns

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
from msg_conventions.documents import hash_of
from msg_conventions.ego import encode_state
from msg_conventions.paths import encode_path
from msg_conventions.pictures import vehicle_markers
from msg_conventions.poses import decode_odometry, encode_frames, encode_odometry
from msg_conventions.roads import decode_map
from msg_conventions.scenario_info import Info, ScenarioEntry
from msg_conventions.topics import vehicle_topic
from scenario_gen.bags.recordings.read import ego_of
from scenario_gen.bags.recordings.scenario_decoder import ScenarioDecoder
from scenario_gen.base.errors import InputError, ScenarioGenError
from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.ego import Command, Pose
from scenario_gen.closed_loop.local_map import local_map
from scenario_gen.closed_loop.origin import Trial
from scenario_gen.closed_loop.simulation import ClosedLoop, State
from scenario_gen.closed_loop.tracking import of_twist, Track
from scenario_gen.closed_loop.trials import Outcome
from scenario_gen.numerics import Floats
from scenario_gen.types import join_ego, Road

INPUTS = ("ego/cmd_vel", "ego/cmd_vel_stamped", "ego/trajectory", "ego/path", "ego/odom")
TIMED_INPUTS = ("ego/trajectory", "ego/path")  # their points have times, so they may be old
FIRST_STAMP_NS = 1_000_000_000  # a drive's clock at its start; ROS regards a time of 0 as unknown
MAP_PERIOD_S = 0.2  # time of the drive between two local maps


@dataclass(frozen=True)
class Config(Parameters):
    """The parameters of traffic; those of a drive are `drive.step`, `drive.policy`, …."""

    bag: str = parameter(
        "",
        "bag with scenarios; empty: they arrive live on `scenarios`, `scenarios/info` and `map`",
        fixed=True,
    )
    ego: str = parameter(
        "",
        "id of the vehicle that the ego replaces; empty: the scenario's ego slot, or its first "
        "vehicle",
    )
    request: str = parameter(
        "",
        "request whose live scenarios are driven; empty: all that are sent after the start",
        fixed=True,
    )
    index: int = parameter(0, "index of the first scenario in the bag, from 0", low=0, fixed=True)
    rate: float = parameter(
        1.0, "speed as a multiple of real time", low=0.01, high=1000.0, fixed=True
    )
    lock_step: bool = parameter(
        False, "step with each call of ~/step instead of a clock", fixed=True
    )
    wait_for_ego: bool = parameter(
        True, "begin a drive with the ego's first command; false: the ego brakes until one arrives"
    )
    silence: float = parameter(
        0.5, "age after which a command is ignored, and the ego brakes", unit="s", low=0.01
    )
    patience: float = parameter(
        5.0, "longest wait for a command in lock-step, in real time", unit="s", low=0.01
    )
    follow_on: bool = parameter(True, "continue with the next scenario; false: wait for ~/next")
    autoware: bool = parameter(
        False,
        "publish predicted objects and the ego's state for Autoware's planners; needs "
        "autoware_perception_msgs",
        fixed=True,
    )
    results: str = parameter(
        "",
        "folder for drives.json and junit.xml, replaced after each drive; empty: none",
        fixed=True,
    )
    drive: ClosedLoopConfig = field(default_factory=ClosedLoopConfig)


@dataclass(frozen=True, eq=False)
class EgoCommand:
    """A message that commands the ego.

    Attributes:
        topic: one of `INPUTS`.
        step: the step of the state that it answers, by its stamp, or the last one at its arrival.
        stamp_ns: its stamp on the drive's clock [ns]; 0 without one.
        at: returns the command for a state.
        fault: why it is ignored, "" if it is not.
    """

    topic: str
    step: int
    stamp_ns: int
    at: Callable[[State], Command | Pose | None]
    fault: str = ""

    def fault_at(self, state: State, period: float, silence: float) -> str:
        """Return why it is ignored in a state, "" if it is not: its fault, or its age.

        Args:
            state: the drive's last state.
            period: duration of a step [s].
            silence: largest age of a command [s].
        """
        if self.fault or self.topic in TIMED_INPUTS:
            return self.fault
        age = (state.step - self.step) * period
        if self.stamp_ns:
            age = max(age, stamp_of(state) * 1e-9 - self.stamp_ns * 1e-9)
        return f"{self.topic}: the last command is {age:.1f} s old" if age > silence else ""


def stamp_of(state: State) -> int:
    """Return a state's time on the drive's clock [ns]."""
    return FIRST_STAMP_NS + round(state.time * 1e9)


def decode_command(topic: str, data: bytes, loop: ClosedLoop, child: str, step: int) -> EgoCommand:
    """Return the command in a message.

    A damaged message, or one in another frame, has a fault instead.

    Args:
        topic: one of `INPUTS`.
        data: its CDR bytes.
        loop: the drive.
        child: the ego's own frame.
        step: the drive's last step.
    """
    try:
        if topic.startswith("ego/cmd_vel"):
            return _decode_twist(topic, data, loop, child, step)
        return _decode_motion(topic, data, loop, step)
    except ScenarioGenError as error:
        return EgoCommand(topic, step, 0, lambda _: None, str(error))


def _answered_step(stamp_ns: int, step: int, period: float) -> int:
    """Return the step that a stamp refers to, at most the last one; `step` without a stamp."""
    if stamp_ns < FIRST_STAMP_NS:
        return step
    return min(step, round((stamp_ns - FIRST_STAMP_NS) * 1e-9 / period))


def _decode_twist(topic: str, data: bytes, loop: ClosedLoop, child: str, step: int) -> EgoCommand:
    """Decode a Twist in the ego's frame or in that of the scenario."""
    period = loop.config.step
    stamped = topic == "ego/cmd_vel_stamped"
    stamp, frame, speed, rate = driving.decode_twist(data, topic, stamped=stamped)
    if frame not in (child, "base_link", "", loop.scenario.frame_id):
        raise InputError(f"{topic}: frame {frame!r} is not the ego's; {child!r}, 'base_link' are")
    return EgoCommand(
        topic,
        _answered_step(stamp, step, period),
        stamp,
        lambda state: of_twist(state.ego, speed, rate, period),
    )


def _decode_motion(topic: str, data: bytes, loop: ClosedLoop, step: int) -> EgoCommand:
    """Decode timed poses, or the ego's pose, in the frame of the scenario."""
    period = loop.config.step
    stamp = 0
    command: Callable[[State], Command | Pose | None]
    if topic in TIMED_INPUTS:
        decode = driving.decode_timed_path
        if topic == "ego/trajectory":
            decode = driving.decode_trajectory
        motion = decode(data, topic)
        frame = motion.frame_id
        track = Track.of((motion.time_ns - FIRST_STAMP_NS) * 1e-9, motion.poses)

        def command(state: State) -> Command | Pose | None:
            return track.command(state.ego, state.time, period)

    else:
        stamp, frame, _, values = decode_odometry(data, topic)
        pose = Pose(*values[:4].tolist())

        def command(state: State) -> Command | Pose | None:
            return pose

    if frame != loop.scenario.frame_id:
        raise InputError(
            f"{topic}: frame {frame!r} is not that of the scenario, {loop.scenario.frame_id!r}"
        )
    return EgoCommand(topic, _answered_step(stamp, step, period), stamp, command)


class ArrivingTrials:
    """Makes trials from live scenarios, each on the road that its entry names."""

    def __init__(self, request: str, cancelled: Callable[[str], None]) -> None:
        """Begin now.

        Args:
            request: whose scenarios are driven; "": all that are sent from now on.
            cancelled: called with a request that was ended early; later trials leave it out.
        """
        self._request = request
        self._started_ns = time_ns()
        self._cancelled = cancelled
        self._left_out: set[str] = set()  # cancelled requests
        self._roads: dict[str, Road] = {}  # by the hashes of their maps
        self._scenarios = ScenarioDecoder(self._accepts)

    @property
    def unmatched(self) -> int:
        """The number of messages that wait for their entry."""
        return self._scenarios.unmatched

    def receive(self, topic: str, data: bytes, sent_ns: int, ego: str) -> Trial | None:
        """Receive a map, or a message of a scenario; return the trial that it completes, if any.

        Args:
            topic: of the message.
            data: its CDR bytes.
            sent_ns: when it was sent; latched messages may be old. 0 if it is not known.
            ego: id of the vehicle that the ego replaces.

        Raises:
            ScenarioGenError: the message is damaged, or the scenario has no such vehicle.
        """
        if topic == "map":
            self._roads[hash_of("map", data)] = decode_map(data)[1]
            return None
        if not self._request and 0 < sent_ns < self._started_ns:
            return None
        decoded = self._scenarios.add(topic, data)
        if decoded is None or decoded[0].request in self._left_out:
            return None
        entry, _, scenario = decoded
        name = f"{entry.request} {entry.index}"
        road = self._roads.get(entry.map_hash or "")
        who = ego_of(scenario, entry, ego, f"scenario {name}")
        return Trial(name, join_ego(scenario), who, road, request=entry.request)

    def _accepts(self, info: Info) -> bool:
        """Return whether an entry or a summary concerns the scenarios to be driven."""
        if self._request not in ("", info.request):
            return False
        if isinstance(info, ScenarioEntry):
            self._left_out.discard(info.request)  # a restarted sampler counts from 1 again
        elif info.cancelled:
            self._left_out.add(info.request)
            self._cancelled(info.request)
        return True


def task_messages(loop: ClosedLoop, child: str) -> Iterator[tuple[str, bytes]]:
    """Yield the ego's goal and route as CDR bytes, by topic; `child` is the ego's frame."""
    task = loop.task()
    frame = loop.scenario.frame_id
    stamps = np.full(len(task.route), FIRST_STAMP_NS, dtype=np.int64)
    yield "ego/goal", encode_state(task.goal, child, frame, FIRST_STAMP_NS)
    yield "ego/route", encode_path(task.route, stamps, frame, FIRST_STAMP_NS)


def encode_odometries(
    states: Sequence[State], children: Sequence[str], period: float, frame: str
) -> Iterator[tuple[int, bytes]]:
    """Yield index and CDR bytes of the odometry of each present vehicle.

    Args:
        states: the drive's last two, or its first alone.
        children: the vehicles' frames.
        period: time between the two states [s].
        frame: of the scenario.
    """
    before, state = states[0], states[-1]
    yaw_rate = (state.vehicles[:, 2] - before.vehicles[:, 2]) / period
    stamp = stamp_of(state)
    for i in np.flatnonzero(state.present).tolist():
        rate = float(yaw_rate[i])
        yield i, encode_odometry(state.vehicles[i], rate, children[i], frame, stamp)


def encode_predictions(loop: ClosedLoop, states: Sequence[State]) -> bytes:
    """Return the present other vehicles as the CDR bytes of PredictedObjects.

    A predicted path continues the certified path with the clock at its present rate.

    Args:
        loop: the drive.
        states: its last two, or its first alone.
    """
    state = states[-1]
    world = loop.world
    others = [i for i in np.flatnonzero(state.present).tolist() if i != loop.ego]
    horizon = np.arange(0.0, HORIZON_NS + 1.0, STEP_NS) * 1e-9
    paths = []
    for i in others:
        time = np.minimum(state.clock[i] + state.rate[i] * horizon, world.spans[i, 1])
        paths.append(loop.scenario.at(time).poses[i])
    objects = [loop.scenario.vehicles[i] for i in others]
    values = _with_rates(loop, states)[others]
    return encode_predicted_objects(
        objects, values, paths, loop.scenario.frame_id, stamp_of(state)
    )


def encode_ego(loop: ClosedLoop, states: Sequence[State]) -> bytes:
    """Return the CDR bytes of the ego's Odometry for Autoware, at its rear axle.

    Arguments as above.
    """
    vehicle = loop.scenario.vehicles[loop.ego]
    values = _with_rates(loop, states)[loop.ego]
    return encode_kinematic_state(vehicle, values, loop.scenario.frame_id, stamp_of(states[-1]))


def _with_rates(loop: ClosedLoop, states: Sequence[State]) -> Floats:
    """Return (N, 6) x, y, yaw, speed, acceleration, yaw rate of all vehicles [SI units]."""
    before = states[0].vehicles
    now = states[-1].vehicles
    acceleration = (now[:, 3] - before[:, 3]) / loop.config.step
    yaw_rate = (now[:, 2] - before[:, 2]) / loop.config.step
    return np.column_stack([now, acceleration, yaw_rate])


def encode_verdict(node: str, outcome: Outcome, stamp_ns: int) -> bytes:
    """Return the CDR bytes of a verdict with the ego's first faults."""
    verdict = outcome.verdict
    values = {key: json.dumps(value) for key, value in verdict.document().items()}
    if outcome.drive.faults:
        values["first_faults"] = json.dumps(outcome.drive.faults[:5])
    level = Level.OK if verdict.passed else Level.ERROR
    status = Status(f"{node}: scenario {outcome.name}", level, verdict.sentence(), values)
    return encode_diagnostics([status], stamp_ns)


def surroundings(
    loop: ClosedLoop,
    states: Sequence[State],
    names: Sequence[str],
    autoware: Sequence[str],
    has_subscribers: Callable[[str], bool],
) -> Iterator[tuple[str, bytes]]:
    """Yield the messages of the last state, by topic; the ego's odometry comes last.

    Args:
        loop: the drive.
        states: the last state, and the previous one if there is one.
        names: tokens of the vehicles.
        autoware: Autoware's topics to publish.
        has_subscribers: returns whether a topic has any.
    """
    state = states[-1]
    frame = loop.scenario.frame_id
    stamp = stamp_of(state)
    children = tuple(f"vehicle_{name}" for name in names)
    yield "/clock", driving.encode_clock(stamp)

    odometries = dict(encode_odometries(states, children, loop.config.step, frame))
    ego_odometry = odometries.pop(loop.ego)
    for i, data in odometries.items():
        yield vehicle_topic(names[i], "odom"), data

    present = np.flatnonzero(state.present)
    frames = [children[i] for i in present.tolist()]
    yield "/tf", encode_frames(state.vehicles[present, :3], frames, frame, stamp)

    if has_subscribers("traffic/markers"):
        vehicles = loop.scenario.vehicles
        markers = vehicle_markers(vehicles, state.vehicles, state.present, loop.ego, frame, stamp)
        yield "traffic/markers", markers

    map_steps = max(round(MAP_PERIOD_S / loop.config.step), 1)
    road = loop.road if state.step % map_steps == 0 else None
    if road is not None and has_subscribers("traffic/local_map"):
        blocked, origin = local_map(loop, road, state)
        data = driving.encode_local_map(blocked, road.resolution, origin, frame, stamp)
        yield "traffic/local_map", data

    for topic in autoware:
        encode = encode_predictions if topic == OBJECTS else encode_ego
        yield topic, encode(loop, states)
    yield vehicle_topic(names[loop.ego], "odom"), ego_odometry
