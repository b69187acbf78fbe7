# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""traffic: drives a scenario's vehicles around a planner's ego, and judges the planner.

It runs in real time or in lock-step.

Scenarios come from a bag, or live from `scenarios`, `scenarios/info`, `ego/witness` and `map`:
those of one `request`, or all that are sent after the start, without cancelled requests. The ego
replaces one vehicle. `ego/cmd_vel`, `ego/cmd_vel_stamped`, `ego/trajectory`, `ego/path` or
`ego/odom` steer it: the drive begins with the first command, and the latest command counts.
Services are `~/next`, `~/reset`, `~/pause`, `~/resume` and, in lock-step, `~/step`. Each step
waits for a command that arrived after the previous step, so a client that answers each step with
one command gets a repeatable drive. The next scenario begins by itself (parameter `follow_on`), in
lock-step after 0.5 s: a reply to the last state of a drive must not count for the next drive.
Topics, frames and units: msg_conventions/driving.py. Faults of the ego are on /diagnostics and in
the verdict.
"""

from collections.abc import Mapping
from functools import partial
import json
import math
from pathlib import Path
from time import monotonic, time_ns
from typing import Any, ClassVar

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from std_srvs.srv import Trigger

from msg_conventions.autoware import EGO, OBJECTS
from msg_conventions.diagnostics import Level
from msg_conventions.topics import vehicle_topic
from scenario_gen.bags.recordings.scenario_decoder import TOPICS
from scenario_gen.base.errors import InputError, ScenarioGenError
from scenario_gen.base.folders import check_replaceable, replaced_folder
from scenario_gen.closed_loop.ego import Command, Pose
from scenario_gen.closed_loop.origin import Trial
from scenario_gen.closed_loop.results import DRIVEN, Drives
from scenario_gen.closed_loop.simulation import ClosedLoop, State
from scenario_gen.closed_loop.trials import Outcome, read_trials
from scenario_gen.closed_loop.verdict import judge
from scenario_gen.ros.common.diagnostics import NodeDiagnostics
from scenario_gen.ros.common.driving import (
    ArrivingTrials,
    Config,
    decode_command,
    EgoCommand,
    encode_verdict,
    INPUTS,
    stamp_of,
    surroundings,
    task_messages,
)
from scenario_gen.ros.common.ros_parameters import ConfigParameters
from scenario_gen.ros.common.services import offer_trigger
from scenario_gen.ros.common.timers import create_steady_timer
from scenario_gen.ros.common.topics import (
    create_frames_publisher,
    create_publisher,
    create_subscription,
    publish,
    publishing_nodes,
)
from scenario_gen.ros.common.waits import POLL_S, Waits
from scenario_gen.types import tokens

OUTPUTS = ("/clock", "traffic/markers", "traffic/local_map", "verdicts", "ego/goal", "ego/route")
SOURCE_CHECK_STEPS = 10  # between two checks which nodes command the ego
FOLLOW_ON_S = 0.5  # real time from the end of a drive in lock-step to the next one


class Traffic(Node):  # type: ignore[misc]
    """Drives one scenario after the other."""

    is_local: ClassVar[bool] = False  # whether the planner's messages have the time of this clock

    def __init__(self, namespace: str | None = None, config: Config = Config()) -> None:
        self._callback_group = ReentrantCallbackGroup()
        super().__init__("traffic", namespace=namespace)
        self.parameters = ConfigParameters(self, config)
        self.diagnostics = NodeDiagnostics(self, self._report)
        self._trials: list[Trial] = []
        self._index = self.config.index
        self._loop: ClosedLoop | None = None
        self._states: list[State] = []
        self._received: EgoCommand | None = None
        self._reply_count = 0  # to the last state
        self._late_reply_count = 0  # to the state before it, which had an answer
        self._published: State | None = None  # the last state, when it has been published
        self._published_ns = 0  # time of its first odometry of the ego
        # Times are on the steady clock [s].
        self._last_reply_at = 0.0
        self._load_at = math.inf  # when the next scenario begins
        self.waits = Waits(self)
        create_steady_timer(self, POLL_S, self._begin_scheduled)
        self._paused = False
        self._sources: list[str] = []
        self.outcomes: list[Outcome] = []  # of finished drives
        self._arriving = ArrivingTrials(self.config.request, self._leave_out)
        self._verdict = ""
        self._out = {topic: create_publisher(self, topic) for topic in OUTPUTS}
        self._out["/tf"] = create_frames_publisher(self)
        self._autoware: tuple[str, ...] = ()
        for topic in INPUTS:
            create_subscription(self, topic, partial(self._receive_command, topic))
        offer_trigger(self, "~/next", self._next)
        offer_trigger(self, "~/reset", self._reset)
        offer_trigger(self, "~/pause", partial(self._pause, paused=True))
        offer_trigger(self, "~/resume", partial(self._pause, paused=False))
        self.create_service(Trigger, "~/step", self._serve_step)

    @property
    def default_callback_group(self) -> ReentrantCallbackGroup:
        """A reentrant one: ~/step waits for a command, which another callback receives."""
        return self._callback_group

    @property
    def config(self) -> Config:
        """The parameters in effect."""
        return self.parameters.config  # type: ignore[no-any-return]

    def autostart(self) -> None:
        """Read the bag, or subscribe to scenarios, and begin.

        Raises:
            InputError: the bag cannot be read, or has no such vehicle or scenario;
                autoware_perception_msgs is missing.
        """
        config = self.config
        if config.results:
            check_replaceable(Path(config.results), DRIVEN)  # an error must precede the drives
        if config.autoware:
            self._autoware = (OBJECTS, EGO)
            self._out |= {topic: create_publisher(self, topic) for topic in self._autoware}
        if config.bag:
            self._trials = read_trials(Path(config.bag), config.ego)
            if config.index >= len(self._trials):
                raise InputError(
                    f"parameter index is {config.index}; {config.bag} has {len(self._trials)} "
                    "scenarios, from 0"
                )
            self._load(config.index)
        else:
            for topic in ("map", *TOPICS):
                create_subscription(self, topic, partial(self._receive_scenario, topic))
        if not config.lock_step:
            period = config.drive.step / config.rate
            create_steady_timer(self, period, self._tick)

    # --- scenarios -----------------------------------------------------------------------------

    def _receive_scenario(self, topic: str, data: bytes, info: Mapping[str, Any]) -> None:
        """Receive a map or a message of a live scenario.

        Scenarios are driven in the order of their completion.
        """
        try:
            sent_ns = info["source_timestamp"]
            trial = self._arriving.receive(topic, data, sent_ns, self.config.ego)
            self._trials += [trial] if trial else []
            if self._loop is None and len(self._trials) > self._index:
                self._load(self._index)
            elif self._verdict and self._load_at == math.inf and self.config.follow_on:
                self._follow_on()
        except ScenarioGenError as error:
            self._report_status(Level.ERROR, str(error), topic)

    def _leave_out(self, request: str) -> None:
        """Leave out the scenarios of a cancelled request that were not driven to their end."""
        n_begun = self._index + (self._loop is not None)
        n_over = self._index + bool(self._verdict)
        if n_over < n_begun and self._trials[self._index].request == request:
            self._loop = None
            n_begun = n_over
        waiting = [trial for trial in self._trials[n_begun:] if trial.request != request]
        self._trials[n_begun:] = waiting
        if len(self._trials) <= self._index + 1:
            self._load_at = math.inf
        self.get_logger().info(f"request {request} was cancelled; its scenarios are left out")

    def _load(self, number: int) -> None:
        """Begin a scenario.

        Raises:
            InputError: it has no such vehicle.
        """
        trial = self._trials[number]
        self._loop = ClosedLoop(trial.scenario, trial.ego, trial.road, self.config.drive)
        self._index = number
        self._states = [self._loop.start()]
        self._received = None
        self._verdict = ""
        self._reply_count = self._late_reply_count = 0
        self._load_at = math.inf
        self._names = tokens(self._loop.scenario.ids)
        self._children = tuple(f"vehicle_{name}" for name in self._names)
        for name in self._names:
            topic = vehicle_topic(name, "odom")
            if topic not in self._out:
                self._out[topic] = create_publisher(self, topic)
        for topic, data in task_messages(self._loop, self._children[self._loop.ego]):
            self._publish(topic, data)
        self._publish_state()
        self._report()

    # --- the ego -------------------------------------------------------------------------------

    def _receive_command(self, topic: str, data: bytes, info: Mapping[str, Any]) -> None:
        """Store a command and report a damaged one, which commands nothing.

        Ignore commands after a drive. A local planner's command without a stamp, which it sent
        before the last state, answers the state before it.
        """
        if self._loop is None or self._load_at < math.inf:
            return
        state = self._states[-1]
        is_earlier = self.is_local and 0 < info["source_timestamp"] < self._published_ns
        if is_earlier and state.step == 0:
            return  # it answers the drive before this one
        step = state.step - is_earlier
        command = decode_command(topic, data, self._loop, self._children[self._loop.ego], step)
        self._last_reply_at = monotonic()
        self._reply_count += command.step == state.step
        self._late_reply_count += is_earlier and step > 0 and not command.stamp_ns
        if fault := command.fault or self._multiple_replies(state):
            self._report_status(Level.WARN, fault, "ego")
        if self._received is not None and command.step < self._received.step:
            return  # it answers an earlier state
        self._received = command
        self.waits.check()

    def _command(self, state: State) -> tuple[Command | Pose | None, str]:
        """Return the command to the ego for a state, and its fault or a note."""
        command = self._received
        if command is None:
            return None, ""
        if fault := command.fault_at(state, self.config.drive.step, self.config.silence):
            return None, fault
        if state.step % SOURCE_CHECK_STEPS == 0:
            self._sources = self.commanding_nodes()
        note = self._multiple_replies(state)
        if len(self._sources) > 1:
            note = f"several egos: {', '.join(self._sources)}; the latest command counts"
        return command.at(state), note

    def _multiple_replies(self, state: State) -> str:
        """Return a note if a state has several replies in lock-step.

        The first state is sent repeatedly and may have several.
        """
        if not self.config.lock_step or state.step == 0:
            return ""
        if self._late_reply_count:
            return "several replies to one state; the first one counts, send one"
        if self._reply_count < 2:
            return ""
        return f"{self._reply_count} replies to one state; the last one before the step counts"

    def commanding_nodes(self) -> list[str]:
        """Return the nodes that publish commands."""
        return sorted({name for topic in INPUTS for name in publishing_nodes(self, topic)})

    # --- steps ---------------------------------------------------------------------------------

    def _tick(self) -> None:
        if self._loop is not None and not (self._paused or self._waits_for_ego or self._verdict):
            self._advance(self._loop)

    @property
    def _waits_for_ego(self) -> bool:
        """Whether the drive waits for the ego's first command."""
        return self._received is None and (self.config.wait_for_ego or self.config.lock_step)

    def _advance(self, loop: ClosedLoop) -> None:
        requested, note = self._command(self._states[-1])
        self._reply_count = self._late_reply_count = 0
        self._states.append(loop.step(self._states[-1], requested, note))
        if fault := self._states[-1].fault:
            self._report_status(Level.WARN, fault, "ego")
        self._publish_state()
        if loop.over(self._states[-1]):
            self._conclude(loop)

    def _conclude(self, loop: ClosedLoop) -> None:
        """Publish the verdict, write the results, and continue."""
        drive = loop.record(self._states)
        verdict = judge(loop, drive)
        outcome = Outcome(self._trials[self._index].name, verdict, drive)
        self._verdict = verdict.sentence()
        self.outcomes.append(outcome)
        stamp_ns = stamp_of(self._states[-1])
        self._publish("verdicts", encode_verdict(self.get_name(), outcome, stamp_ns))
        self.get_logger().info(f"scenario {outcome.name}: {self._verdict}")
        if self.config.results:
            planner = f"{self.get_name()} over ROS 2"
            with replaced_folder(Path(self.config.results), DRIVEN) as folder:
                Drives(self.outcomes, planner, self.config.drive).write(folder)
        self._follow_on()

    def _follow_on(self) -> None:
        """Begin or schedule the next scenario, or log what it waits for."""
        if self._index + 1 < len(self._trials):
            if not self.config.follow_on:
                service = f"{self.get_fully_qualified_name()}/next"
                self.get_logger().info(f"the next scenario waits for a call of {service}")
            elif self.config.lock_step:
                self._load_at = monotonic() + FOLLOW_ON_S
            else:
                self._load(self._index + 1)
        elif self.config.bag:
            passed = sum(outcome.verdict.passed for outcome in self.outcomes)
            self.get_logger().info(
                f"that was the last scenario of {self.config.bag}: {passed} of "
                f"{len(self.outcomes)} drives passed"
            )

    async def _serve_step(
        self, _: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        """Step with a command for the last state, or after the patience without one."""
        loop = self._loop
        if loop is None or self._verdict or not self.config.lock_step:
            response.message = self._step_refusal()
            return response
        await self._step_once(loop)
        response.success = True
        time = self._states[-1].time
        answer = {"time": time, "over": bool(self._verdict), "verdict": self._verdict}
        response.message = json.dumps(answer)
        return response

    async def _step_once(self, loop: ClosedLoop) -> None:
        """Step when a command for the last state has arrived, or the patience is over."""
        state = self._states[-1]
        await self._wait_for_command(state, self.config.patience)
        if self._loop is loop and self._states[-1] is state:
            self._advance(loop)

    async def _wait_for_command(self, state: State, patience: float) -> None:
        """Return when a command for this state arrives, or after `patience` [s] of real time."""

        def is_answered() -> bool:
            is_last = self._states[-1] is state
            return not is_last or (
                self._received is not None and self._received.step >= state.step
            )

        await self.waits.until(is_answered, monotonic() + patience)

    def _begin_scheduled(self) -> None:
        """Begin a scheduled scenario, if it is time."""
        if monotonic() >= self._load_at:
            self._load(self._index + 1)

    def _step_refusal(self) -> str:
        if not self.config.lock_step:
            return "the parameter lock_step is false: the clock makes the steps"
        if self._loop is None:
            return "there is no scenario yet"
        remedy = "call ~/next or ~/reset"
        if self._load_at < math.inf:
            remedy = "the next one begins at once"
        return f"scenario {self._trials[self._index].name} is over: {self._verdict}; {remedy}"

    # --- services ------------------------------------------------------------------------------

    def _next(self) -> str:
        if self._index + 1 >= len(self._trials):
            raise InputError(
                f"there is no scenario after number {self._index}; there are {len(self._trials)}"
            )
        self._load(self._index + 1)
        return f"scenario {self._trials[self._index].name}"

    def _reset(self) -> str:
        if self._loop is None:
            raise InputError("there is no scenario yet")
        self._load(self._index)
        return f"scenario {self._trials[self._index].name}, from its start"

    def _pause(self, *, paused: bool) -> str:
        self._paused = paused
        return "paused" if paused else "driving"

    # --- outputs -------------------------------------------------------------------------------

    def _publish(self, topic: str, data: bytes) -> None:
        publish(self, self._out[topic], data)

    def _publish_state(self) -> None:
        """Publish the state of all vehicles, the ego's odometry last.

        Replies to it know the other vehicles.
        """
        if self._loop is None:
            return
        observed = [self._loop.perceive(state) for state in self._states[-2:]]
        messages = surroundings(
            self._loop, observed, self._names, self._autoware, self._has_subscribers
        )
        sent_ns = 0
        for topic, data in messages:
            sent_ns = time_ns()
            self._publish(topic, data)
        if self._published is not self._states[-1]:
            self._published, self._published_ns = self._states[-1], sent_ns

    def _has_subscribers(self, topic: str) -> bool:
        """Return whether a topic has subscribers; slowly encoded messages need some."""
        return int(self._out[topic].get_subscription_count()) > 0

    def _report_status(self, level: Level, message: str, subject: str) -> None:
        self.diagnostics.status(level, message, subject, {}, log=False)

    def _report(self) -> None:
        """Report the scenario and its progress, each second.

        Resolve a fault of the ego that is over.
        """
        if self._loop is None:
            message = "there is no scenario yet"
            if self._arriving.unmatched:
                message += f": {self._arriving.unmatched} messages wait for scenarios/info"
            self._report_status(Level.OK, message, "driving")
            return
        state = self._states[-1]
        message = (
            f"scenario {self._trials[self._index].name}, {state.time:.1f} s: {self._activity()}"
        )
        self._report_status(Level.OK, message, "driving")
        if self._waits_for_ego and not self._verdict:
            self._publish_state()  # for planners that started late
        if not state.fault and not (self._received and self._received.fault):
            self.diagnostics.resolve("ego")

    def _activity(self) -> str:
        if self._verdict:
            return f"{self._verdict}; ~/next begins the next scenario"
        if self._paused:
            return "paused"
        return "waiting for the ego" if self._waits_for_ego else "driving"
