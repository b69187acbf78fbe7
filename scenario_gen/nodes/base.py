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

"""What all nodes with a stage have in common: lifecycle, parameters, raw topics, a worker, diagnostics, a clean end."""

from collections.abc import Callable
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.qos import QoSProfile

from msg_conventions.diagnostics import Level, Status
from msg_conventions.topics import LATCHED, Quality, topic_entry
from scenario_gen.nodes.compiling import kernels_ready
from scenario_gen.nodes.health import Health
from scenario_gen.nodes.inputs import refuse_damaged
from scenario_gen.nodes.message_classes import message_class
from scenario_gen.nodes.ros_parameters import ConfigParameters
from scenario_gen.nodes.spinning import run_nodes
from scenario_gen.nodes.voice import qos, Voice
from scenario_gen.nodes.worker import Job, Worker

__all__ = ["REQUESTS", "StageNode", "run_nodes"]
REQUESTS = QoSProfile(depth=1000)  # ROS's own 10 would drop the oldest of many requests that come at once


class StageNode(LifecycleNode):  # type: ignore[misc]
    """A lifecycle node around a stage.

    A subclass names its inputs in `INPUTS` and takes them in `received`; it does its work in jobs given to `work`. Inputs
    are subscribed while the node is active; being latched, they come again after a deactivation or a restart.
    """

    INPUTS: tuple[str, ...] = ()
    OUTPUTS: tuple[str, ...] = ()  # announced while configuring, so that listeners are there before the first message
    STAGES: tuple[str, ...] = ()  # packages of scenario_gen whose kernels are compiled while configuring

    def __init__(self, name: str, config: Any, namespace: str | None = None) -> None:
        self._together = ReentrantCallbackGroup()
        super().__init__(name, namespace=namespace)
        self.voice = Voice(self)
        self.health = Health(self, self.ticked, listening=False)
        self.health.state("unconfigured")
        self._inputs: dict[str, Any] = {}
        self._heard: dict[str, tuple[bytes, Any]] = {}
        self._worker: Worker | None = None
        self.parameters = ConfigParameters(self, config)
        self.declare_parameter("autostart", True)
        self.parameters.log()

    @property
    def default_callback_group(self) -> ReentrantCallbackGroup:
        """Reentrant: in rclpy's own, a service that awaits its answer keeps all other callbacks of the node from running."""
        return self._together

    @property
    def config(self) -> Any:
        """The configuration in effect."""
        return self.parameters.config

    @property
    def active(self) -> bool:
        """True between activation and deactivation."""
        return self._worker is not None

    def autostart(self) -> None:
        """Configure and activate, unless the parameter `autostart` is false."""
        if self.get_parameter("autostart").value and self.trigger_configure() is TransitionCallbackReturn.SUCCESS:
            self.trigger_activate()

    # --- for subclasses ---------------------------------------------------------------------------------------

    def received(self, topic: str, data: bytes) -> None:
        """Take an input in; called on the executor's thread, so anything long goes to `work`."""

    def started(self) -> None:
        """Begin what needs no input; called at activation."""

    def stopped(self) -> None:
        """End what was begun and forget what was heard; called at deactivation, when no work runs any more."""

    def listen(self, topic: str, quality: Quality | None = None) -> None:
        """Subscribe to a topic of the suite, raw; `received` gets its messages. `quality`: another one than the suite's."""
        if topic not in self._inputs:
            kind, own = topic_entry(topic)
            take = self._receive_latched if own == LATCHED else self._receive
            self._inputs[topic] = self.create_subscription(
                message_class(kind), topic, lambda data: take(topic, data), qos(quality or own), raw=True
            )

    def ignore(self, topic: str) -> None:
        """End a subscription."""
        if topic in self._inputs:
            self.destroy_subscription(self._inputs.pop(topic))
            self._heard.pop(topic, None)
            self.health.settle(topic)

    def send(self, topic: str, data: bytes) -> None:
        """Publish the CDR bytes of a topic of the suite, if the node is active."""
        self.voice.send(topic, data)

    def serve(self, kind: Any, name: str, callback: Callable[[Any, Any], Any]) -> None:
        """Offer a service; whatever goes wrong in it, the caller gets an answer and the node lives on."""

        def guarded(request: Any, response: Any) -> Any:
            try:
                return callback(request, response)
            except Exception as error:
                self.failed(name, error)
                self.health.settle(name)
                return response

        self.create_service(kind, name, guarded, qos_profile=REQUESTS)

    def work(self, name: str, job: Job) -> None:
        """Run a job off the executor's thread; a waiting one of the same name is replaced, a running one cancelled."""
        if self._worker is not None:
            self._worker.submit(name, job)

    def cancel(self, only: str | None = None) -> list[str]:
        """Cancel all jobs, or those of one name; return their names."""
        return self._worker.cancel(only) if self._worker is not None else []

    def report(self, *statuses: Status, stamp_ns: int = 0) -> None:
        """Say statuses on /diagnostics, until others about the same are said."""
        self.health.report(*statuses, stamp_ns=stamp_ns)

    def status(self, level: Level, message: str, subject: str = "status", stamp_ns: int = 0, **values: str) -> None:
        """Say one status on /diagnostics and log it; a job that was left behind ends here, before it is logged."""
        self.health.say(level, message, subject, values, stamp_ns)

    def failed(self, name: str, error: BaseException) -> None:
        """Say on /diagnostics that something went wrong; the node lives on."""
        self.health.failed(name, error)

    def ticked(self) -> None:
        """Bring up to date, each second, what /diagnostics says of the work that goes on."""
        if self._worker is not None:
            self.health.state("active", **self._worker.account())

    # --- lifecycle --------------------------------------------------------------------------------------------

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Announce the outputs; `run_nodes` has made the kernels ready."""
        kernels_ready(self.STAGES)
        for topic in self.OUTPUTS:
            self.voice.announce(topic)
        self.health.state("inactive")
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Subscribe to the inputs."""
        self._worker = Worker(self.failed, self.get_name(), self.health.settle)
        self.voice.begin()
        self.health.listen(to_work=True)
        self.health.state("active")
        for topic in self.INPUTS:
            self.listen(topic)
        self.started()
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Cancel the work and forget the inputs; what was published stays for late joiners."""
        self._stop()
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Withdraw what was published."""
        self.voice.withdraw()
        self.health.state("unconfigured")
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """End the work."""
        self._stop()
        return super().on_shutdown(state)

    def _stop(self) -> None:
        self.voice.silence()
        self.health.listen(to_work=False)
        for topic in list(self._inputs):
            self.ignore(topic)
        if self._worker is not None:
            self._worker.close()
            self._worker = None
            self.stopped()
            self.health.state("inactive")

    def destroy_node(self) -> None:
        """End the work, then the node."""
        self._stop()
        super().destroy_node()

    def _receive_latched(self, topic: str, data: bytes) -> None:
        """Take an input in, unless it is the last one word for word and the parameters are, too: then its node was restarted."""
        if self._heard.get(topic) != (data, self.config):
            self._heard[topic] = (data, self.config)
            self._receive(topic, data)

    def _receive(self, topic: str, data: bytes) -> None:
        """Take an input in; whatever is wrong with it, the node lives on."""
        try:
            refuse_damaged(topic, data)
            self.received(topic, data)
            self.health.settle(topic)
        except Exception as error:
            self.failed(topic, error)
