# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""segmenter: `tracks` or streams in; `changepoints`, `posterior` out.

`~/segment` repeats the segmentation.

The messages on `vehicle_<id>/fix` and `vehicle_<id>/speed` are buffered. At the end of the
streams, or on `~/segment`, they are read like a log and published as `tracks`, for this node and
all others; the part that a stage requests on `tracks/part` replaces them.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

from msg_conventions.changepoints import (
    encode_changepoints,
    encode_posterior,
    segmentation_status,
)
from msg_conventions.diagnostics import Level
from msg_conventions.tracks import decode_tracks, encode_tracks
from scenario_gen.base.cancelling import stop_if_cancelled
from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.logs import encounters_of, LogConfig, RawLog
from scenario_gen.method.continuation import driven_on
from scenario_gen.method.segmentation import segment, SegmentationConfig
from scenario_gen.ros.common.live_streams import LiveConfig, LiveStreams
from scenario_gen.ros.common.recording_part import send_part
from scenario_gen.ros.common.recording_part import TOPIC as PART
from scenario_gen.ros.common.services import offer_trigger
from scenario_gen.ros.common.stage_node import StageNode
from scenario_gen.types import Encounter


@dataclass(frozen=True)
class Config(Parameters):
    """The segmenter's parameters.

    `live` and `log` concern streams and apply from the next activation.
    """

    segmentation: SegmentationConfig = field(default_factory=SegmentationConfig)
    seed: int = parameter(0, "seed of the sampler", low=0)
    live: LiveConfig = field(default_factory=LiveConfig)
    log: LogConfig = field(default_factory=LogConfig)


class Segmenter(StageNode):
    """Segments every received encounter into driving primitives."""

    INPUTS = ("tracks", PART)
    STAGES = ("method.segmentation",)
    OUTPUTS = ("changepoints", "posterior")

    def __init__(self, namespace: str | None = None) -> None:
        super().__init__("segmenter", Config(), namespace)
        self._tracks: bytes | None = None
        self._live: LiveStreams | None = None
        self._encounter_count = 0
        self._sent: Encounter | None = None
        offer_trigger(self, "~/segment", self._segment_again)

    def started(self) -> None:
        """Start to look for streams."""
        config = self.config
        if config.live.listen:
            self._live = LiveStreams(self, config.live, config.log, self._ended)

    def stopped(self) -> None:
        """Stop looking for streams."""
        if self._live is not None:
            self._live.close()
            self._live = None

    def received(self, topic: str, data: bytes) -> None:
        """Segment an encounter, or add a message to its stream."""
        if topic == "tracks":
            self._tracks = data
            self.work("segment", lambda _: self._segment(data))
        elif topic == PART:
            send_part(self, self._sent, data)
        elif self._live is not None:
            self._live.received(topic, data)

    def _segment(self, data: bytes) -> None:
        encounter = decode_tracks(data)
        segmentation = segment(encounter, self.config.segmentation, self.config.seed)
        stop_if_cancelled()
        self.outputs.send("changepoints", encode_changepoints(encounter, segmentation))
        self.outputs.send("posterior", encode_posterior(encounter, segmentation))
        node = self.get_fully_qualified_name()
        status = segmentation_status(segmentation, node, encounter.duration)
        self.get_logger().info(status.message)
        self.diagnostics.report(status, stamp_ns=encounter.start_ns)

    def _ended(self, log: RawLog, config: LogConfig) -> None:
        """Read the buffered log as encounters, off the executor's thread."""
        self._encounter_count += 1

        def job(_: Callable[[], bool]) -> None:
            result = encounters_of(log, config)
            encounter = max(result.encounters, key=lambda e: e.speed.size)
            encounter, driven = driven_on(encounter)
            remarks = (*result.quality.lines(), *map(str, driven))
            notes = {f"note.{k}": note for k, note in enumerate(remarks)}
            n, samples = encounter.speed.shape
            message = (
                f"streams of {n} vehicles, {samples} samples; the largest of "
                f"{len(result.encounters)} encounter(s)"
            )
            self.status(Level.OK, message, "encounter", encounter.start_ns, **notes)
            self._sent = encounter
            self.outputs.send("tracks", encode_tracks(encounter))

        self.work(f"encounter {self._encounter_count}", job)

    def _segment_again(self) -> str:
        if self._live is not None and self._live.end():
            return "started with the messages of the streams so far"
        if self._tracks is None or not self.active:
            raise InputError("no tracks yet, or the node is not active")
        self.received("tracks", self._tracks)
        return "started"
