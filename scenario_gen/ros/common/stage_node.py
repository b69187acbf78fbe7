# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The base of all nodes with a stage: lifecycle, parameters, raw topics, a worker, diagnostics.

The latched inputs of a node are complete once all have the same stamp, and are those that the
documents among them name.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.task import Future

from msg_conventions import trajectory
from msg_conventions.cdr import stamp_of
from msg_conventions.diagnostics import Level
from msg_conventions.documents import DOCUMENTS, hash_of, head_of, LANES, PLAN
from msg_conventions.fits import decode_plan
from msg_conventions.roads import decode_description, decode_map
from msg_conventions.topics import LATCHED, topic_entry
from msg_conventions.tracks import decode_tracks
from scenario_gen.base.errors import InputError
from scenario_gen.base.worker import Job, Worker
from scenario_gen.ros.common.bond import Bond
from scenario_gen.ros.common.diagnostics import NodeDiagnostics
from scenario_gen.ros.common.ros_parameters import ConfigParameters
from scenario_gen.ros.common.topics import create_subscription, Outputs
from scenario_gen.situation import MAX_SAMPLES, refuse_too_large
from scenario_gen.types import Encounter, Quality

# A sample of a vehicle has at most 176 bytes in a `tracks` message, an instant 36.
MAX_TRACKS_BYTES = 200 * MAX_SAMPLES


def decode_checked_tracks(data: bytes) -> Encounter:
    """Return the encounter of a `tracks` message, if a node can process it.

    Raises:
        InputError: it is too large, damaged, or no encounter.
        RefusedError: it is too large, or its vehicles are too far apart.
    """
    if len(data) > MAX_TRACKS_BYTES:
        raise InputError(
            f"tracks: the message has {len(data)} bytes, at most {MAX_TRACKS_BYTES} are read; "
            "cut the encounter, or resample it (10 Hz is usual)"
        )
    encounter = decode_tracks(data)
    refuse_too_large(encounter)
    return encounter


DECODERS: dict[str, Callable[[bytes, str], object]] = {
    "tracks": lambda data, _: decode_checked_tracks(data),
    "map": lambda data, topic: decode_map(data, name=topic),
    LANES: decode_description,
    "changepoints": trajectory.decode,
    PLAN: decode_plan,
}


def refuse_damaged(topic: str, data: bytes) -> None:
    """Decode a latched input when it arrives, so that a damaged one replaces no valid one.

    Raises:
        InputError, RefusedError: it is damaged, or too large.
    """
    if decode := DECODERS.get(topic):
        decode(data, topic)


@dataclass(frozen=True)
class _Message:
    """A message with stamp and hash, and the hashes of its inputs by topic if it is a document."""

    data: bytes
    stamp: int
    hash: str
    inputs: Mapping[str, str]


class Inputs:
    """The newest message of each topic.

    Args:
        paired: topics that must have the same stamp.
        unpaired: topics with any stamp.
    """

    def __init__(self, paired: Iterable[str], unpaired: Iterable[str] = ()) -> None:
        self._paired = frozenset(paired)
        self._unpaired = frozenset(unpaired)
        self._newest: dict[str, _Message] = {}

    def clear(self) -> None:
        """Remove all messages."""
        self._newest.clear()

    def put(self, topic: str, data: bytes) -> None:
        """Store a message.

        Raises:
            InputError: it is damaged; the previous message stays.
        """
        if topic in DOCUMENTS:
            head = head_of(data, topic)
            stamp, inputs = head.stamp, head.inputs
        else:
            stamp, inputs = stamp_of(data, topic), {}
        self._newest[topic] = _Message(data, stamp, hash_of(topic, data), inputs)

    def get(self, topic: str) -> bytes | None:
        """Return the newest message of a topic."""
        message = self._newest.get(topic)
        return message.data if message else None

    def replaced(self, messages: Mapping[str, bytes]) -> bool:
        """Return whether one of these messages is no longer the newest of its topic."""
        return any(self.get(topic) != data for topic, data in messages.items())

    def missing(self) -> list[str]:
        """Return the topics without a message, or without one for the newest template and road."""
        silent = sorted((self._paired | self._unpaired) - set(self._newest))
        return silent + self._outdated() + self._unmatched()

    def _outdated(self) -> list[str]:
        """Return the paired topics without the stamp of the tracks, or without the newest one."""
        stamps = {topic: self._newest[topic].stamp for topic in self._paired & set(self._newest)}
        newest = stamps.get("tracks", max(stamps.values(), default=0))
        return sorted(topic for topic, stamp in stamps.items() if stamp != newest)

    def _unmatched(self) -> list[str]:
        """Return the documents of other messages than the newest, as "fit/info of this map"."""
        return [
            f"{document} of this {topic}"
            for document, message in self._newest.items()
            for topic, wanted in message.inputs.items()
            if topic not in self._newest or self._newest[topic].hash != wanted
        ]

    def complete(self) -> dict[str, bytes] | None:
        """Return all messages that belong together, or None if one is missing."""
        if self.missing():
            return None
        return {topic: message.data for topic, message in self._newest.items()}


Result = TypeVar("Result")


class StageNode(LifecycleNode):  # type: ignore[misc]
    """A lifecycle node around a stage.

    A subclass lists its inputs in `INPUTS` and receives them in `received`; it works in jobs given
    to `work`. Inputs are subscribed while the node is active. They are latched, so they arrive
    again after a deactivation or a restart.

    Attributes:
        INPUTS: topics.
        OUTPUTS: topics that are advertised while configuring, before the first message.
        THREADS: jobs that run at a time.
        STAGES: packages of scenario_gen whose kernels are compiled before the node is configured.
    """

    INPUTS: tuple[str, ...] = ()
    OUTPUTS: tuple[str, ...] = ()
    THREADS = 1
    STAGES: tuple[str, ...] = ()

    def __init__(self, name: str, config: Any, namespace: str | None = None) -> None:
        self._callback_group = ReentrantCallbackGroup()
        super().__init__(name, namespace=namespace)
        self.outputs = Outputs(self)
        self.diagnostics = NodeDiagnostics(self, self.update_diagnostics, enabled=False)
        self.diagnostics.state("unconfigured")
        self._subscribed: dict[str, Any] = {}
        self._latched: dict[str, tuple[bytes, Any]] = {}
        self._worker: Worker | None = None
        self.parameters = ConfigParameters(self, config)
        self.declare_parameter("autostart", True)
        self._bond = Bond(self)

    @property
    def default_callback_group(self) -> ReentrantCallbackGroup:
        """A reentrant group.

        In rclpy's default group a service that awaits its answer blocks all other callbacks.
        """
        return self._callback_group

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
        if (
            self.get_parameter("autostart").value
            and self.trigger_configure() is TransitionCallbackReturn.SUCCESS
        ):
            self.trigger_activate()

    # --- for subclasses ------------------------------------------------------------------------

    def received(self, topic: str, data: bytes) -> None:
        """Process an input, on the executor's thread; long work belongs into `work`."""

    def started(self) -> None:
        """Start work that needs no input; called at activation."""

    def stopped(self) -> None:
        """Forget the inputs; called at deactivation, when no job runs any more."""

    def listen(self, topic: str, quality: Quality | None = None) -> None:
        """Subscribe `received` to one of the suite's topics, raw, with any quality."""
        if topic not in self._subscribed:
            receive = self._receive_latched if topic_entry(topic)[1] == LATCHED else self._receive
            self._subscribed[topic] = create_subscription(
                self, topic, lambda data: receive(topic, data), quality
            )

    def ignore(self, topic: str) -> None:
        """End a subscription."""
        if topic in self._subscribed:
            self.destroy_subscription(self._subscribed.pop(topic))
            self._latched.pop(topic, None)
            self.diagnostics.resolve(topic)

    def work(self, name: str, job: Job) -> None:
        """Run a job off the executor's thread.

        A waiting one with its name is replaced, a running one cancelled.
        """
        if self._worker is not None:
            self._worker.submit(name, lambda cancelled: None if cancelled() else job(cancelled))

    async def result_of(
        self,
        name: str,
        job: Callable[[Callable[[], bool]], Result],
        failed: Callable[[BaseException], Result],
    ) -> Result:
        """Run a job off the executor's thread for a service; return its result.

        A job that is cancelled before its turn runs, too.

        Args:
            name: of the job.
            job: called with a function that returns whether it has been cancelled.
            failed: returns the result of a job that raises; the error is also reported on
                /diagnostics.
        """
        answer = Future()
        executor = self.executor

        def run(cancelled: Callable[[], bool]) -> None:
            try:
                answer.set_result(job(cancelled))
            except BaseException as error:  # also CancelledError: the caller waits
                answer.set_result(failed(error))
                raise
            finally:
                executor.wake()

        if self._worker is not None:
            self._worker.submit(name, run)
        result: Result = await answer
        return result

    def cancel(self, only: str | None = None) -> list[str]:
        """Cancel all jobs, or those with one name; return their names."""
        return self._worker.cancel(only) if self._worker is not None else []

    def status(
        self, level: Level, message: str, subject: str = "status", stamp_ns: int = 0, **values: str
    ) -> None:
        """Report one status on /diagnostics and log it.

        An abandoned job ends here, before it is logged.
        """
        self.diagnostics.status(level, message, subject, values, stamp_ns)

    def update_diagnostics(self) -> None:
        """Report the progress of the work; called each second."""
        if self._worker is not None:
            self.diagnostics.state("active", **self._worker.status())

    # --- lifecycle -----------------------------------------------------------------------------

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Advertise the outputs."""
        for topic in self.OUTPUTS:
            self.outputs.advertise(topic)
        self.diagnostics.state("inactive")
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Subscribe to the inputs."""
        self._worker = Worker(
            self.diagnostics.failed, self.get_name(), self.diagnostics.resolve, self.THREADS
        )
        self.outputs.activate()
        self.diagnostics.enable(True)
        self.diagnostics.state("active")
        for topic in self.INPUTS:
            self.listen(topic)
        self.started()
        self._bond.start()
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Cancel the work and forget the inputs; published messages stay for late subscribers."""
        self._stop()
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Destroy the publishers."""
        self.outputs.destroy()
        self.diagnostics.state("unconfigured")
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """End the work."""
        self._stop()
        return super().on_shutdown(state)

    def _stop(self) -> None:
        self._bond.stop()
        self.outputs.deactivate()
        self.diagnostics.enable(False)
        for topic in list(self._subscribed):
            self.ignore(topic)
        if self._worker is not None:
            self._worker.close()
            self._worker = None
            self.stopped()
            self.diagnostics.state("inactive")

    def destroy_node(self) -> None:
        """End the work, then the node."""
        self._stop()
        super().destroy_node()

    def _receive_latched(self, topic: str, data: bytes) -> None:
        """Ignore a repetition of the last message, unless the parameters changed.

        A publisher that restarted repeats it.
        """
        if self._latched.get(topic) != (data, self.config):
            self._latched[topic] = (data, self.config)
            self._receive(topic, data)

    def _receive(self, topic: str, data: bytes) -> None:
        """Process an input; the node survives any error."""
        try:
            refuse_damaged(topic, data)
            self.received(topic, data)
            self.diagnostics.resolve(topic)
        except Exception as error:
            self.diagnostics.failed(topic, error)


class TemplateNode(StageNode):
    """A stage node whose inputs belong to one template; `pair_map` says whether the map does."""

    def __init__(self, name: str, config: Any, namespace: str | None = None) -> None:
        super().__init__(name, config, namespace)
        if self.config.pair_map:
            self.inputs = Inputs(self.INPUTS)
        else:  # any server's map, without lanes, which may be those of another map
            self.INPUTS = tuple(topic for topic in self.INPUTS if topic != LANES)
            self.inputs = Inputs({*self.INPUTS} - {"map"}, unpaired=("map",))

    def stopped(self) -> None:
        """Forget the inputs, which are latched and arrive again."""
        self.inputs.clear()
