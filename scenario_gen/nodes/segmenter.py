"""segmenter: `tracks` in, `changepoints` and `posterior` out; `~/segment` does it again."""

import sys
from dataclasses import dataclass, field

from std_srvs.srv import Trigger

from msg_conventions.changepoints import encode_changepoints, encode_posterior
from msg_conventions.tracks import decode_tracks
from scenario_gen.bags.run import segmentation_status
from scenario_gen.nodes.base import StageNode, run_nodes
from scenario_gen.parameters import check, parameter
from scenario_gen.segmentation import SegmentationConfig, segment


@dataclass(frozen=True)
class Config:
    """The segmenter's parameters."""

    segmentation: SegmentationConfig = field(default_factory=SegmentationConfig)
    seed: int = parameter(0, "seed of the sampler", low=0)

    def __post_init__(self) -> None:
        check(self)


class Segmenter(StageNode):
    """Finds the driving primitives of every encounter it hears."""

    INPUTS = ("tracks",)
    STAGES = ("segmentation",)
    OUTPUTS = ("changepoints", "posterior")

    def __init__(self, namespace: str | None = None) -> None:
        super().__init__("segmenter", Config(), namespace)
        self._tracks: bytes | None = None
        self.serve(Trigger, "~/segment", self._segment_again)

    def received(self, topic: str, data: bytes) -> None:
        """Segment the newest encounter."""
        self._tracks = data
        self.work("segment", lambda cancelled: None if cancelled() else self._segment(data))

    def _segment(self, data: bytes) -> None:
        encounter = decode_tracks(data)
        segmentation = segment(encounter, self.config.segmentation, self.config.seed)
        self.send("changepoints", encode_changepoints(encounter, segmentation))
        self.send("posterior", encode_posterior(encounter, segmentation))
        status = segmentation_status(segmentation, self.get_fully_qualified_name())
        self.get_logger().info(status.message)
        self.report(status, stamp_ns=encounter.start_ns)

    def _segment_again(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = self.active and self._tracks is not None
        response.message = "started" if response.success else "no tracks yet, or the node is not active"
        if response.success:
            self.received("tracks", self._tracks or b"")
        return response


def main() -> None:
    """Run the node."""
    sys.exit(run_nodes(Segmenter))
