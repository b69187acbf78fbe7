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

"""planner: `map`, `tracks` and `changepoints` of one template in; `fit`, a `vehicle_<id>/route` each, and `fit/info` out.

`~/get_plan` (nav_msgs/GetPlan) plans on the newest map for anyone; a plan that cannot be is empty, and `~/explain` says why.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
import sys

from nav_msgs.msg import Path
from nav_msgs.srv import GetPlan
import numpy as np
from rclpy.serialization import deserialize_message
from rclpy.task import Future
from rclpy.time import Time
from std_srvs.srv import Trigger

from msg_conventions.belonging import encode_belonging, identity
from msg_conventions.changepoints import decode_changepoints
from msg_conventions.diagnostics import fit_statuses, Level, written
from msg_conventions.fits import anchor_stamps, encode_fit
from msg_conventions.names import tokens
from msg_conventions.paths import encode_path, encode_route
from msg_conventions.roads import decode_map
from msg_conventions.topics import vehicle_topic
from msg_conventions.tracks import decode_tracks
from scenario_gen.cancelling import stop_if_cancelled
from scenario_gen.errors import RefusedError, ScenarioGenError
from scenario_gen.fitting import fit_template, FittingConfig
from scenario_gen.nodes.base import REQUESTS, run_nodes, StageNode
from scenario_gen.nodes.inputs import Inputs
from scenario_gen.nodes.plan_request import plan_poses, query_of, Reasons
from scenario_gen.parameters import check, parameter
from scenario_gen.planning import plan_routes, PlanningConfig

ROAD = ("map", "road/entries", "road/exits")


@dataclass(frozen=True)
class Config:
    """The planner's parameters."""

    fitting: FittingConfig = field(default_factory=FittingConfig)
    planning: PlanningConfig = field(default_factory=PlanningConfig)
    seed: int = parameter(0, "seed of the planner", low=0)
    radius: float = parameter(1.0, "radius of the disc that ~/get_plan plans for", unit="m", low=0.0, high=20.0)
    pair_map: bool = parameter(True, "take only a map with the template's stamp; false: any map server's newest one")

    def __post_init__(self) -> None:
        check(self)


class Planner(StageNode):
    """Fits each template to the road and plans every vehicle's route between its changepoints."""

    INPUTS = (*ROAD, "road/info", "tracks", "changepoints")
    STAGES = ("interaction", "roads", "fitting", "planning")
    OUTPUTS = ("fit", "fit/info")

    def __init__(self, namespace: str | None = None) -> None:
        super().__init__("planner", Config(), namespace)
        self.create_service(GetPlan, "~/get_plan", self._get_plan, qos_profile=REQUESTS)
        self.serve(Trigger, "~/explain", self._explain)
        self._reasons = Reasons()
        paired = self.config.pair_map
        self._asked = 0
        self._inputs_seen = Inputs(("tracks", "changepoints", *(ROAD if paired else ())), () if paired else ("map",))

    def stopped(self) -> None:
        """Forget the inputs: being latched, they come again."""
        self._inputs_seen.clear()

    def received(self, topic: str, data: bytes) -> None:
        """Plan when road, tracks and changepoints are those of one template."""
        if topic == "road/info" and not self.config.pair_map:
            return  # a map server of the user's own does not say what belongs to its map
        self._inputs_seen.put(topic, data)
        messages = self._inputs_seen.complete()  # if not all is there, the work on what was there is cancelled all the same
        self.work("plan", lambda cancelled: None if cancelled() or messages is None else self._plan(messages))

    def _plan(self, messages: dict[str, bytes]) -> None:
        config = self.config
        encounter = decode_tracks(messages["tracks"])
        segmentation = decode_changepoints(messages["changepoints"], encounter)
        _, road = decode_map(messages["map"], messages.get("road/entries"), messages.get("road/exits"))
        fit = fit_template(encounter, segmentation, road, config.fitting)
        routes = plan_routes(road, fit, config.planning, config.seed)
        stop_if_cancelled()
        anchors = anchor_stamps(encounter, segmentation.changepoints)
        made = {
            vehicle_topic(name, "route"): encode_route(route, anchors, road.frame_id)
            for name, route in zip(tokens(vehicle.id for vehicle in encounter.vehicles), routes, strict=True)
        }
        made["fit"] = encode_fit(encounter, fit, road.frame_id)
        made["fit/info"] = encode_belonging("fit", messages | made, encounter.start_ns)
        for topic, data in made.items():
            self.send(topic, data)
        self.get_logger().info(f"planned {len(routes)} routes through {len(anchors)} anchors")
        statuses = fit_statuses(fit, self.get_fully_qualified_name(), identity(messages))
        self.report(*statuses, stamp_ns=encounter.start_ns)

    async def _get_plan(self, request: GetPlan.Request, response: GetPlan.Response) -> GetPlan.Response:
        """Plan for a caller, off the executor's thread."""
        answer, executor, grid = Future(), self.executor, self._inputs_seen.get("map")
        stamp = Time.from_msg(request.start.header.stamp).nanoseconds
        self._asked += 1
        name = f"get_plan {self._asked}"

        def job(cancelled: Callable[[], bool]) -> None:
            plan, reason = b"", "cancelled"
            try:
                if grid is None or cancelled():
                    raise RefusedError("there is no map yet" if grid is None else "cancelled")
                _, road = decode_map(grid)
                query = query_of(request, road.frame_id, self.config.radius)
                poses = plan_poses(road, query, self.config.planning, self.config.seed)
                plan, reason = encode_path(poses, np.full(len(poses), stamp), road.frame_id, stamp), ""
            except ScenarioGenError as error:
                reason = str(error)
                self.status(Level.ERROR, reason, "get_plan", error=type(error).__name__, job=name, request_stamp=written(stamp))
            except Exception as error:
                reason = f"{type(error).__name__}: {error}"
                raise
            finally:
                self._reasons.add(stamp, reason)
                answer.set_result(plan)
                executor.wake()

        response.plan.header.stamp = request.start.header.stamp
        if not self.active:
            self._reasons.add(stamp, "the node is not active; activate it first")
        else:
            self.work(name, job)
            if plan := await answer:
                response.plan = deserialize_message(plan, Path)
        return response

    def _explain(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success, response.message = self._reasons.told()
        return response


def main() -> None:
    """Run the node."""
    sys.exit(run_nodes(Planner))
