# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What all nodes with a stage have in common: lifecycle, parameters, raw topics, a worker, diagnostics, a clean end.

Their latched inputs belong together: complete once all bear the same stamp and `road/info` and `fit/info` agree.
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
from msg_conventions.fits import decode_fit
from msg_conventions.hashes import decode_hashes, hash_of, INFOS
from msg_conventions.lanes import decode_lanes
from msg_conventions.lanes import TOPIC as LANES
from msg_conventions.paths import decode_path
from msg_conventions.roads import decode_map, decode_poses
from msg_conventions.topics import LATCHED, topic_entry
from msg_conventions.tracks import decode_tracks
from scenario_gen.base.errors import InputError
from scenario_gen.base.worker import Job, Worker
from scenario_gen.ros.common.diagnostics import NodeDiagnostics
from scenario_gen.ros.common.ros_parameters import ConfigParameters
from scenario_gen.ros.common.topics import create_subscription, Outputs
from scenario_gen.situation import MAX_SAMPLES, refuse_too_large
from scenario_gen.types import Encounter, Quality

MOST_BYTES = (
    200 * MAX_SAMPLES
)  # of tracks: a sample of a vehicle takes 176 at most, and an instant 36


def take_tracks(data: bytes) -> Encounter:
    """Return the encounter of a `tracks` message that a node can work on; what is too large is refused before it is read.

    Raises:
        InputError: it is too large, damaged, or no encounter.
        RefusedError: it is too large, or its vehicles are not where they can be.
    """
    if len(data) > MOST_BYTES:
        raise InputError(
            f"tracks: the message has {len(data)} bytes, at most {MOST_BYTES} are read; cut the encounter, or resample it "
            "(10 Hz is usual)"
        )
    encounter = decode_tracks(data)
    refuse_too_large(encounter)
    return encounter


DECODERS: dict[str, Callable[[bytes, str], object]] = {
    "tracks": lambda data, _: take_tracks(data),
    "map": lambda data, what: decode_map(data, name=what),
    "road/entries": decode_poses,
    "road/exits": decode_poses,
    LANES: decode_lanes,
    "changepoints": trajectory.decode,
    "fit": decode_fit,
    "route": decode_path,
    **dict.fromkeys(INFOS, decode_hashes),
}


def refuse_damaged(topic: str, data: bytes) -> None:
    """Read a latched input as it arrives, so that what is damaged is named and does not take the place of what was there.

    Raises:
        InputError, RefusedError: it is damaged, or too large.
    """
    if decode := DECODERS.get("route" if topic.endswith("/route") else topic):
        decode(data, topic)


@dataclass(frozen=True)
class _Message:
    """A message with its stamp and hash; if it is an info, the hashes of those that belong together, by topic."""

    data: bytes
    stamp: int
    hash: str
    together: Mapping[str, str]


class Inputs:
    """The newest message of each topic.

    Args:
        paired: topics that must bear the same stamp.
        unpaired: topics whose newest message counts, whatever its stamp.
        if_named: topics that count only where an info names them, and are waited for there.
    """

    def __init__(
        self, paired: Iterable[str], unpaired: Iterable[str] = (), if_named: Iterable[str] = ()
    ) -> None:
        self._paired = set(paired)
        self._unpaired = set(unpaired)
        self._if_named = set(if_named)
        self._newest: dict[str, _Message] = {}

    def expect(self, topics: Iterable[str]) -> None:
        """Add topics to the paired ones, e.g. the routes of the vehicles of the tracks."""
        self._paired |= set(topics)

    def forget(self, topics: Iterable[str]) -> None:
        """Remove topics and their messages."""
        for topic in topics:
            self._paired.discard(topic)
            self._newest.pop(topic, None)

    def clear(self) -> None:
        """Forget all messages."""
        self._newest.clear()

    def put(self, topic: str, data: bytes) -> None:
        """Take a message in.

        Raises:
            InputError: it is damaged; what was there stays.
        """
        together = decode_hashes(data, topic) if topic in INFOS else {}
        self._newest[topic] = _Message(data, stamp_of(data, topic), hash_of(topic, data), together)

    def get(self, topic: str) -> bytes | None:
        """Return the newest message of a topic."""
        message = self._newest.get(topic)
        return message.data if message else None

    def named(self, info: str, topic: str) -> bool:
        """Say whether an info names a message of the topic as one that belongs to the others."""
        return info in self._newest and topic in self._newest[info].together

    def replaced(self, messages: Mapping[str, bytes]) -> bool:
        """Say whether one of these messages is no longer the newest of its topic."""
        return any(self.get(topic) != data for topic, data in messages.items())

    def missing(self) -> list[str]:
        """Return the topics from which nothing came yet, or nothing that belongs to the newest template and road."""
        silent = [
            topic for topic in sorted(self._paired | self._unpaired) if topic not in self._newest
        ]
        held = dict(self._newest)
        stamps = {topic: held[topic].stamp for topic in self._paired if topic in held}
        newest = stamps.get("tracks", max(stamps.values(), default=0))
        old = sorted(topic for topic, stamp in stamps.items() if stamp != newest)
        others = [
            f"{info} of this {topic}"
            for info in INFOS
            for topic, named in (held[info].together.items() if info in held else ())
            if (topic in held and held[topic].hash != named)
            or (topic in self._if_named and topic not in held)
        ]
        if not any(
            info in held for info in INFOS
        ):  # it may name them: what is done without would be done again
            others += [
                f"road/info of this {topic}" for topic in sorted(self._if_named & set(held))
            ]
        return silent + old + others

    def complete(self) -> dict[str, bytes] | None:
        """Return all messages if none is missing and all belong together."""
        if self.missing():
            return None
        return {
            topic: message.data
            for topic, message in self._newest.items()
            if topic not in self._if_named or any(self.named(info, topic) for info in INFOS)
        }


Result = TypeVar("Result")


class StageNode(LifecycleNode):  # type: ignore[misc]
    """A lifecycle node around a stage.

    A subclass names its inputs in `INPUTS` and takes them in `received`; it does its work in jobs given to `work`. Inputs
    are subscribed while the node is active; being latched, they come again after a deactivation or a restart.
    """

    INPUTS: tuple[str, ...] = ()
    OUTPUTS: tuple[
        str, ...
    ] = ()  # advertised while configuring, so that listeners are there before the first message
    THREADS = 1  # jobs that run at a time
    STAGES: tuple[
        str, ...
    ] = ()  # packages of scenario_gen whose kernels are compiled before it is configured

    def __init__(self, name: str, config: Any, namespace: str | None = None) -> None:
        self._together = ReentrantCallbackGroup()
        super().__init__(name, namespace=namespace)
        self.outputs = Outputs(self)
        self.diagnostics = NodeDiagnostics(self, self.update_diagnostics, enabled=False)
        self.diagnostics.state("unconfigured")
        self._listening: dict[str, Any] = {}
        self._latched: dict[str, tuple[bytes, Any]] = {}
        self._worker: Worker | None = None
        self.parameters = ConfigParameters(self, config)
        self.declare_parameter("autostart", True)

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
        if (
            self.get_parameter("autostart").value
            and self.trigger_configure() is TransitionCallbackReturn.SUCCESS
        ):
            self.trigger_activate()

    # --- for subclasses ---------------------------------------------------------------------------------------

    def received(self, topic: str, data: bytes) -> None:
        """Take an input in; called on the executor's thread, so anything long goes to `work`."""

    def started(self) -> None:
        """Begin what needs no input; called at activation."""

    def stopped(self) -> None:
        """End what was begun and forget what was received; called at deactivation, when no work runs any more."""

    def listen(self, topic: str, quality: Quality | None = None) -> None:
        """Subscribe to a topic of the suite, raw; `received` gets its messages. `quality`: another one than the suite's."""
        if topic not in self._listening:
            take = self._receive_latched if topic_entry(topic)[1] == LATCHED else self._receive
            self._listening[topic] = create_subscription(
                self, topic, lambda data: take(topic, data), quality
            )

    def ignore(self, topic: str) -> None:
        """End a subscription."""
        if topic in self._listening:
            self.destroy_subscription(self._listening.pop(topic))
            self._latched.pop(topic, None)
            self.diagnostics.resolve(topic)

    def work(self, name: str, job: Job) -> None:
        """Run a job off the executor's thread; a waiting one of the same name is replaced, a running one cancelled."""
        if self._worker is not None:
            self._worker.submit(name, lambda cancelled: None if cancelled() else job(cancelled))

    async def result_of(
        self,
        name: str,
        job: Callable[[Callable[[], bool]], Result],
        failed: Callable[[BaseException], Result],
    ) -> Result:
        """Run a job off the executor's thread for a service, also if it is cancelled before its turn; return its result.

        Args:
            name: of the job.
            job: called with a function that says whether it has been cancelled.
            failed: returns the result of a job that raises; the error is reported on /diagnostics all the same.
        """
        answer, executor = Future(), self.executor

        def run(cancelled: Callable[[], bool]) -> None:
            try:
                answer.set_result(job(cancelled))
            except BaseException as error:  # CancelledError, too: somebody waits
                answer.set_result(failed(error))
                raise
            finally:
                executor.wake()

        if self._worker is not None:
            self._worker.submit(name, run)
        result: Result = await answer
        return result

    def cancel(self, only: str | None = None) -> list[str]:
        """Cancel all jobs, or those of one name; return their names."""
        return self._worker.cancel(only) if self._worker is not None else []

    def status(
        self, level: Level, message: str, subject: str = "status", stamp_ns: int = 0, **values: str
    ) -> None:
        """Report one status on /diagnostics and log it; an abandoned job ends here, before it is logged."""
        self.diagnostics.status(level, message, subject, values, stamp_ns)

    def update_diagnostics(self) -> None:
        """Bring up to date, each second, what /diagnostics reports of the work that goes on."""
        if self._worker is not None:
            self.diagnostics.state("active", **self._worker.account())

    # --- lifecycle --------------------------------------------------------------------------------------------

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Advertise the outputs; the kernels are ready by then."""
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
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Cancel the work and forget the inputs; what was published stays for late joiners."""
        self._stop()
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Withdraw what was published."""
        self.outputs.destroy()
        self.diagnostics.state("unconfigured")
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """End the work."""
        self._stop()
        return super().on_shutdown(state)

    def _stop(self) -> None:
        self.outputs.deactivate()
        self.diagnostics.enable(False)
        for topic in list(self._listening):
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
        """Take an input in, unless it is the last one word for word and the parameters are, too: then its node was restarted."""
        if self._latched.get(topic) != (data, self.config):
            self._latched[topic] = (data, self.config)
            self._receive(topic, data)

    def _receive(self, topic: str, data: bytes) -> None:
        """Take an input in; whatever is wrong with it, the node lives on."""
        try:
            refuse_damaged(topic, data)
            self.received(topic, data)
            self.diagnostics.resolve(topic)
        except Exception as error:
            self.diagnostics.failed(topic, error)
