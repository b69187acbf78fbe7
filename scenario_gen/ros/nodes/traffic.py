# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""traffic: drives the vehicles of a scenario around a planner's ego, in real time or in lock-step, and judges the planner.

Scenarios come from a bag, or, without one, live from `scenarios`, `scenarios/info`, `ego/witness` and `map`. The ego takes the
place of one vehicle and is steered by `ego/cmd_vel`, `ego/cmd_vel_stamped`, `ego/trajectory`, `ego/path` or `ego/odom`; what
came last counts. The drive begins with the first of them. `~/next`, `~/reset`, `~/pause`, `~/resume`, and `~/step` in
lock-step: one step for each call, which waits for a command that came after the step before, so that a client that answers each
step with one command gets the same drive again. The next scenario begins by itself (parameter `follow_on`); in lock-step 0.5 s
later, so that an answer to the last state of a drive is not taken for one to the first state of the next.
Topics, frames and units: msg_conventions/driving.py. What is wrong with the ego stands on /diagnostics and in the verdict.
"""

from functools import partial
import json
import math
from pathlib import Path
from time import monotonic

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future
from std_srvs.srv import Trigger

from msg_conventions.autoware import EGO, OBJECTS
from msg_conventions.diagnostics import Level
from msg_conventions.topics import vehicle_topic
from scenario_gen.bags.recordings.arriving import TOPICS
from scenario_gen.base.errors import InputError, of_system, ScenarioGenError
from scenario_gen.closed_loop.ego import Command, Pose
from scenario_gen.closed_loop.origin import Trial
from scenario_gen.closed_loop.results import Drives
from scenario_gen.closed_loop.simulation import ClosedLoop, State
from scenario_gen.closed_loop.trials import Outcome, read_trials
from scenario_gen.closed_loop.verdict import judge
from scenario_gen.ros.common.diagnostics import NodeDiagnostics
from scenario_gen.ros.common.driving import (
    ArrivingTrials,
    decode_command,
    EgoCommand,
    encode_verdict,
    INPUTS,
    stamp_of,
    surroundings,
    task_messages,
)
from scenario_gen.ros.common.node_parameters import TrafficParameters as Config
from scenario_gen.ros.common.ros_parameters import ConfigParameters
from scenario_gen.ros.common.services import offer_trigger
from scenario_gen.ros.common.topics import (
    create_frames_publisher,
    create_publisher,
    create_subscription,
    publish,
)
from scenario_gen.types import tokens

OUTPUTS = ("/clock", "traffic/markers", "traffic/local_map", "verdicts", "ego/goal", "ego/route")
LOOK_AROUND = 10  # steps between two looks at who commands the ego
FOLLOWS_ON_S = 0.5  # seconds of real time from the end of a drive in lock-step to the next one
POLL_S = 0.05  # seconds of real time between two looks at whether a wait is at its end


class Traffic(Node):  # type: ignore[misc]
    """Drives one scenario after the other."""

    def __init__(self, namespace: str | None = None, config: Config = Config()) -> None:
        self._together = (
            ReentrantCallbackGroup()
        )  # a call of ~/step waits for a command, which another callback takes
        super().__init__("traffic", namespace=namespace)
        self.parameters = ConfigParameters(self, config)
        self.diagnostics = NodeDiagnostics(self, self._report)
        self._trials: list[Trial] = []
        self._at = self.config.index
        self._loop: ClosedLoop | None = None
        self._states: list[State] = []
        self._received: EgoCommand | None = None
        self._replies = 0  # to the last state
        self._heard_at = 0.0  # when the last reply came, on the steady clock [s]
        self._waiting: Future | None = None
        self._until = 0.0  # when that ends, on the steady clock [s]
        self._load_at = math.inf  # when the next scenario begins, on the steady clock [s]
        self.create_timer(POLL_S, self._end_waiting, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._paused = False
        self._sources: list[str] = []
        self.outcomes: list[Outcome] = []  # of the drives that are over
        self._arriving = ArrivingTrials()
        self._verdict = ""
        self._out = {topic: create_publisher(self, topic) for topic in OUTPUTS}
        self._out["/tf"] = create_frames_publisher(self)
        self._autoware: tuple[str, ...] = ()
        for topic in INPUTS:
            create_subscription(
                self, topic, lambda data, topic=topic: self._receive_command(topic, data)
            )
        pause, resume = partial(self._pause, paused=True), partial(self._pause, paused=False)
        for name, action in (
            ("next", self._next),
            ("reset", self._reset),
            ("pause", pause),
            ("resume", resume),
        ):
            offer_trigger(self, f"~/{name}", action)
        self.create_service(Trigger, "~/step", self._serve_step)

    @property
    def default_callback_group(self) -> ReentrantCallbackGroup:
        """Reentrant; see above."""
        return self._together

    @property
    def config(self) -> Config:
        """The parameters in effect."""
        return self.parameters.config  # type: ignore[no-any-return]

    def autostart(self) -> None:
        """Read the bag, or listen for scenarios, and begin.

        Raises:
            InputError: the bag cannot be read, or has no such vehicle or scenario; autoware_perception_msgs is not there.
        """
        config = self.config
        if config.results:  # else the first drive's verdict would be lost
            try:
                Path(config.results).mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise of_system(
                    error, f"parameter results is {config.results}", "; name another folder"
                ) from error
        if config.autoware:
            self._autoware = (OBJECTS, EGO)
            self._out |= {topic: create_publisher(self, topic) for topic in self._autoware}
        if config.bag:
            self._trials = read_trials(Path(config.bag), config.ego)
            if config.index >= len(self._trials):
                raise InputError(
                    f"parameter index is {config.index}; {config.bag} has {len(self._trials)} scenarios, from 0"
                )
            self._load(config.index)
        else:
            for topic in ("map", *TOPICS):
                create_subscription(self, topic, lambda data, topic=topic: self._take(topic, data))
        if not config.lock_step:
            period = config.drive.step / config.rate
            self.create_timer(period, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))

    # --- scenarios --------------------------------------------------------------------------------------------

    def _take(self, topic: str, data: bytes) -> None:
        """Take a map or a message of a live scenario; complete scenarios are driven in the order in which they arrive."""
        try:
            self._trials += self._arriving.take(topic, data, self.config.ego)
            if self._loop is None and len(self._trials) > self._at:
                self._load(self._at)
        except ScenarioGenError as error:
            self._report_status(Level.ERROR, str(error), topic)

    def _load(self, number: int) -> None:
        """Begin a scenario.

        Raises:
            InputError: it has no such vehicle.
        """
        trial = self._trials[number]
        self._loop = ClosedLoop(trial.scenario, trial.ego, trial.road, self.config.drive)
        self._at, self._states, self._received, self._verdict = (
            number,
            [self._loop.start()],
            None,
            "",
        )
        self._replies = 0
        self._load_at = math.inf
        self._names = tokens(vehicle.id for vehicle in self._loop.scenario.vehicles)
        self._children = tuple(f"vehicle_{name}" for name in self._names)
        for name in self._names:
            topic = vehicle_topic(name, "odom")
            if topic not in self._out:
                self._out[topic] = create_publisher(self, topic)
        for topic, data in task_messages(self._loop, self._children[self._loop.ego]):
            self._publish(topic, data)
        self._publish_state()
        self._report()

    # --- the ego ----------------------------------------------------------------------------------------------

    def _receive_command(self, topic: str, data: bytes) -> None:
        """Keep a command; a damaged one is reported and counts as none. After the end of a drive none counts."""
        if self._loop is None or self._load_at < math.inf:
            return
        state = self._states[-1]
        command = decode_command(
            topic, data, self._loop, self._children[self._loop.ego], state.step
        )
        self._heard_at = monotonic()
        self._replies += command.step == state.step
        if fault := command.fault or self._doubled(state):
            self._report_status(Level.WARN, fault, "ego")
        if self._received is not None and command.step < self._received.step:
            return  # it answers an earlier state
        self._received = command
        if command.step == state.step and self._waiting is not None and not self._waiting.done():
            self._waiting.set_result(None)

    def _command(self, state: State) -> tuple[Command | Pose | None, str]:
        """Return the command to the ego for this state, and its fault or a note."""
        command = self._received
        if command is None:
            return None, ""
        if fault := command.fault_at(state, self.config.drive.step, self.config.silence):
            return None, fault
        if state.step % LOOK_AROUND == 0:
            self._sources = self.commanding()
        several = (
            f"several egos: {', '.join(self._sources)}; what came last counts"
            if len(self._sources) > 1
            else ""
        )
        return command.at(state), several or self._doubled(state)

    def _doubled(self, state: State) -> str:
        """Say that a state has several replies in lock-step, but of the first one, which is sent until somebody replies."""
        if not self.config.lock_step or self._replies < 2 or state.step == 0:
            return ""
        return f"{self._replies} replies to one state; the last one before the step counts"

    def commanding(self) -> list[str]:
        """Return the nodes that publish commands."""
        found = [info for topic in INPUTS for info in self.get_publishers_info_by_topic(topic)]
        return sorted({f"{info.node_namespace.rstrip('/')}/{info.node_name}" for info in found})

    # --- steps ------------------------------------------------------------------------------------------------

    def _tick(self) -> None:
        if self._loop is not None and not (self._paused or self._waits_for_ego or self._verdict):
            self._advance(self._loop)

    @property
    def _waits_for_ego(self) -> bool:
        """Whether the drive begins with the ego's first command, and none has come."""
        return self._received is None and (self.config.wait_for_ego or self.config.lock_step)

    def _advance(self, loop: ClosedLoop) -> None:
        requested, note = self._command(self._states[-1])
        self._replies = 0
        self._states.append(loop.step(self._states[-1], requested, note))
        if fault := self._states[-1].fault:
            self._report_status(Level.WARN, fault, "ego")
        self._publish_state()
        if loop.over(self._states[-1]):
            self._conclude(loop)

    def _conclude(self, loop: ClosedLoop) -> None:
        """Publish the verdict, and go on with the next scenario, or say what that waits for."""
        drive = loop.record(self._states)
        verdict, trial = judge(loop, drive), self._trials[self._at]
        self._verdict = verdict.sentence()
        self.outcomes.append(Outcome(trial.name, verdict, drive))
        self._publish(
            "verdicts",
            encode_verdict(self.get_name(), self.outcomes[-1], stamp_of(self._states[-1])),
        )
        self.get_logger().info(f"scenario {trial.name}: {self._verdict}")
        if self.config.results:
            Path(self.config.results).mkdir(parents=True, exist_ok=True)
            Drives(self.outcomes, f"{self.get_name()} over ROS 2", self.config.drive).write(
                Path(self.config.results)
            )
        if self._at + 1 < len(self._trials):
            if not self.config.follow_on:
                self.get_logger().info(
                    f"the next scenario waits for a call of {self.get_fully_qualified_name()}/next"
                )
            elif self.config.lock_step:
                self._load_at = monotonic() + FOLLOWS_ON_S
            else:
                self._load(self._at + 1)
        elif self.config.bag:
            passed = len([outcome for outcome in self.outcomes if outcome.verdict.passed])
            self.get_logger().info(
                f"that was the last scenario of {self.config.bag}: {passed} of {len(self.outcomes)} drives passed"
            )

    async def _serve_step(
        self, _: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        """Go one step, with a command that came after the one before; after the patience, without one."""
        loop = self._loop
        if loop is None or self._verdict or not self.config.lock_step:
            response.message = self._why_no_step()
            return response
        await self._step_once(loop)
        response.success = True
        response.message = json.dumps(
            {"time": self._states[-1].time, "over": bool(self._verdict), "verdict": self._verdict}
        )
        return response

    async def _step_once(self, loop: ClosedLoop) -> None:
        """Go one step of a drive when a command that answers its last one is there, or patience is at its end."""
        state = self._states[-1]
        await self._wait_for_command(state, self.config.patience)
        if self._loop is loop and self._states[-1] is state:
            self._advance(loop)

    async def _wait_for_command(self, state: State, patience: float) -> None:
        """Return when a command has come since this state was published, or after `patience` [s] of real time."""
        if self._received is not None and self._received.step >= state.step:
            return
        await self._next_command(monotonic() + patience)

    async def _next_command(self, until: float) -> None:
        """Return when a command comes, or at `until` [s] on the steady clock."""
        self._until, self._waiting = until, Future(executor=self.executor)
        await self._waiting

    def _end_waiting(self) -> None:
        """End a wait for a command that has come to the end of its patience; begin the scenario that follows on."""
        if monotonic() >= self._load_at:
            self._load(self._at + 1)
        if self._waiting is not None and not self._waiting.done() and monotonic() > self._until:
            self._waiting.set_result(None)

    def _why_no_step(self) -> str:
        if not self.config.lock_step:
            return "the parameter lock_step is false: the clock makes the steps"
        if self._loop is None:
            return "there is no scenario yet"
        after = (
            "the next one begins at once" if self._load_at < math.inf else "call ~/next or ~/reset"
        )
        return f"scenario {self._trials[self._at].name} is over: {self._verdict}; {after}"

    # --- services ---------------------------------------------------------------------------------------------

    def _next(self) -> str:
        if self._at + 1 >= len(self._trials):
            raise InputError(
                f"there is no scenario after number {self._at}; there are {len(self._trials)}"
            )
        self._load(self._at + 1)
        return f"scenario {self._trials[self._at].name}"

    def _reset(self) -> str:
        if self._loop is None:
            raise InputError("there is no scenario yet")
        self._load(self._at)
        return f"scenario {self._trials[self._at].name}, from its start"

    def _pause(self, *, paused: bool) -> str:
        self._paused = paused
        return "paused" if paused else "driving"

    # --- what is published ------------------------------------------------------------------------------------

    def _publish(self, topic: str, data: bytes) -> None:
        publish(self, self._out[topic], data)

    def _publish_state(self) -> None:
        """Publish the state of all vehicles; the ego's odometry last, so that a reply to it knows the others."""
        if self._loop is not None:
            for topic, data in surroundings(
                self._loop, self._states[-2:], self._names, self._autoware, self._has_subscribers
            ):
                self._publish(topic, data)

    def _has_subscribers(self, topic: str) -> bool:
        """Whether the topic has subscribers; messages that are slow to encode are left out without."""
        return int(self._out[topic].get_subscription_count()) > 0

    def _report_status(self, level: Level, message: str, subject: str) -> None:
        self.diagnostics.status(level, message, subject, {}, log=False)

    def _report(self) -> None:
        """Report each second which scenario is driven; clear a fault of the ego that is over."""
        if self._loop is None:
            waiting = (
                f": {self._arriving.unmatched} messages wait for scenarios/info"
                if self._arriving.unmatched
                else ""
            )
            self._report_status(Level.WARN, f"there is no scenario yet{waiting}", "driving")
            return
        state, trial = self._states[-1], self._trials[self._at]
        over = f"{self._verdict}; ~/next begins the next scenario" if self._verdict else ""
        doing = over or (
            "paused"
            if self._paused
            else "waiting for the ego"
            if self._waits_for_ego
            else "driving"
        )
        self._report_status(
            Level.OK, f"scenario {trial.name}, {state.time:.1f} s: {doing}", "driving"
        )
        if self._waits_for_ego and not self._verdict:
            self._publish_state()  # for planners that started late
        if not state.fault and not (self._received and self._received.fault):
            self.diagnostics.resolve("ego")
