"""planner: `map`, `tracks` and `changepoints` of one template in; `fit` and a `vehicle_<id>/route` each out."""

import sys
from dataclasses import dataclass, field

from msg_conventions.changepoints import decode_changepoints
from msg_conventions.diagnostics import fit_statuses
from msg_conventions.fits import anchor_stamps, encode_fit
from msg_conventions.names import tokens
from msg_conventions.paths import encode_route
from msg_conventions.roads import decode_map
from msg_conventions.topics import vehicle_topic
from msg_conventions.tracks import decode_tracks
from scenario_gen.fitting import FittingConfig, fit_template
from scenario_gen.nodes.base import StageNode, run_nodes
from scenario_gen.nodes.inputs import Inputs
from scenario_gen.parameters import check, parameter
from scenario_gen.planning import PlanningConfig, plan_routes

ROAD = ("map", "road/entries", "road/exits")


@dataclass(frozen=True)
class Config:
    """The planner's parameters."""

    fitting: FittingConfig = field(default_factory=FittingConfig)
    planning: PlanningConfig = field(default_factory=PlanningConfig)
    seed: int = parameter(0, "seed of the planner", low=0)
    pair_map: bool = parameter(True, "take only a map with the template's stamp; false: any map server's newest one")

    def __post_init__(self) -> None:
        check(self)


class Planner(StageNode):
    """Fits each template to the road and plans every vehicle's route between its changepoints."""

    INPUTS = (*ROAD, "tracks", "changepoints")
    STAGES = ("interaction", "roads", "fitting", "planning")
    OUTPUTS = ("fit",)

    def __init__(self, namespace: str | None = None) -> None:
        super().__init__("planner", Config(), namespace)
        paired = self.config.pair_map
        self._inputs_seen = Inputs(("tracks", "changepoints", *(ROAD if paired else ())), () if paired else ("map",))

    def received(self, topic: str, data: bytes) -> None:
        """Plan when road, tracks and changepoints are those of one template."""
        self._inputs_seen.put(topic, data)
        messages = self._inputs_seen.complete()
        if messages is not None:
            self.work("plan", lambda cancelled: None if cancelled() else self._plan(messages))

    def _plan(self, messages: dict[str, bytes]) -> None:
        config = self.config
        encounter = decode_tracks(messages["tracks"])
        segmentation = decode_changepoints(messages["changepoints"], encounter)
        _, road = decode_map(messages["map"], messages.get("road/entries"), messages.get("road/exits"))
        fit = fit_template(encounter, segmentation, road, config.fitting)
        routes = plan_routes(road, fit, config.planning, config.seed)
        anchors = anchor_stamps(encounter, segmentation.changepoints)
        for name, route in zip(tokens(vehicle.id for vehicle in encounter.vehicles), routes, strict=True):
            self.send(vehicle_topic(name, "route"), encode_route(route, anchors, road.frame_id))
        self.send("fit", encode_fit(encounter, fit, road.frame_id))
        self.get_logger().info(f"planned {len(routes)} routes through {len(anchors)} anchors")
        self.report(*fit_statuses(fit, self.get_fully_qualified_name()), stamp_ns=encounter.start_ns)


def main() -> None:
    """Run the node."""
    sys.exit(run_nodes(Planner))
