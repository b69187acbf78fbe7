# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""planner: road, `tracks`, `changepoints` of one template in; `fit/info`, `fit` and routes out.

`~/get_plan` (nav_msgs/GetPlan) plans from pose to pose for a vehicle of the parameter
`vehicle_type` on the newest map. An impossible plan is empty, and /diagnostics has the reason.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
import math
from typing import Any

from nav_msgs.msg import Path
from nav_msgs.srv import GetPlan
import numpy as np
from rclpy.serialization import deserialize_message
from rclpy.time import Time

from msg_conventions.changepoints import decode_changepoints
from msg_conventions.diagnostics import decimal_stamp, Level
from msg_conventions.documents import LANES, PLAN
from msg_conventions.fits import fit_statuses, plan_messages
from msg_conventions.paths import encode_path
from msg_conventions.poses import check_quaternions, yaw
from msg_conventions.roads import decode_map
from msg_conventions.tracks import decode_tracks
from scenario_gen.base.cancelling import stop_if_cancelled
from scenario_gen.base.errors import InputError, RefusedError, ScenarioGenError
from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.base.road_users import CAR, VEHICLE_TYPES
from scenario_gen.method.chain import Chain
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.fitting import FittingConfig
from scenario_gen.method.routing import (
    Budget,
    checked_path,
    make_planner,
    PlanningConfig,
    PoseQuery,
    Preferences,
)
from scenario_gen.method.validity import Limits
from scenario_gen.numerics import Floats
from scenario_gen.ros.common.recording_part import request_part
from scenario_gen.ros.common.recording_part import TOPIC as PART
from scenario_gen.ros.common.services import REQUESTS
from scenario_gen.ros.common.stage_node import TemplateNode
from scenario_gen.situation import Situation
from scenario_gen.types import Encounter, Planned, Road, Segmentation


@dataclass(frozen=True)
class Config(Parameters):
    """The planner's parameters."""

    fitting: FittingConfig = field(default_factory=FittingConfig)
    planning: PlanningConfig = field(default_factory=PlanningConfig)
    limits: Limits = field(default_factory=Limits)
    seed: int = parameter(0, "seed of the planner", low=0)
    vehicle_type: str = parameter(
        CAR,
        "type of the vehicle that ~/get_plan plans for: its usual size, its limit of curvature",
        choices=tuple(VEHICLE_TYPES.built_in),
        group=VEHICLE_TYPES.group,
    )
    pair_map: bool = parameter(
        True, "take only a map with the recording's stamp; false: any map server's newest one"
    )


class Planner(TemplateNode):
    """Fits each template to the road and plans every vehicle's route between its changepoints."""

    INPUTS = ("map", LANES, "tracks", "changepoints")
    STAGES = ("situation", "roads", "method.fitting", "method.routing")
    OUTPUTS = ("fit", PLAN, PART)

    def __init__(self, namespace: str | None = None) -> None:
        super().__init__("planner", Config(), namespace)
        self.create_service(GetPlan, "~/get_plan", self._get_plan, qos_profile=REQUESTS)
        self._request_count = 0

    def received(self, topic: str, data: bytes) -> None:
        """Plan when road, tracks and changepoints of one template have arrived."""
        self.inputs.put(topic, data)
        messages = self.inputs.complete()
        # Incomplete inputs also replace, and so cancel, the work on the previous ones.
        self.work("plan", lambda _: self._plan(messages) if messages else None)

    def _plan(self, messages: dict[str, bytes]) -> None:
        config = self.config
        encounter = decode_tracks(messages["tracks"])
        segmentation = decode_changepoints(messages["changepoints"], encounter)
        _, road = decode_map(messages["map"], messages.get(LANES))
        pipeline = PipelineConfig(
            fitting=config.fitting, planning=config.planning, limits=config.limits
        )
        whole = Chain(Situation.of(encounter), segmentation, road, pipeline, seed=config.seed)
        try:
            planned = whole.plan()
        except RefusedError as error:
            plan_part = partial(_plan_part, whole)
            request_part(self, plan_part, encounter, error, config.fitting)
            return
        fit, routes = planned.fit, planned.routes
        stop_if_cancelled()
        sent = plan_messages(encounter, segmentation, fit, routes, road.frame_id, messages)
        for topic, data in sent.items():
            self.outputs.send(topic, data)
        count = len(fit.anchor_index)
        self.get_logger().info(f"planned {len(routes)} routes through {count} anchors")
        statuses = fit_statuses(fit, self.get_fully_qualified_name(), routes)
        self.diagnostics.report(*statuses, stamp_ns=encounter.start_ns)

    async def _get_plan(
        self, request: GetPlan.Request, response: GetPlan.Response
    ) -> GetPlan.Response:
        """Plan for a caller, off the executor's thread."""
        grid = self.inputs.get("map")
        stamp = Time.from_msg(request.start.header.stamp).nanoseconds
        self._request_count += 1
        name = f"get_plan {self._request_count}"

        def job(cancelled: Callable[[], bool]) -> bytes:
            try:
                if grid is None or cancelled():
                    raise RefusedError("there is no map yet" if grid is None else "cancelled")
                _, road = decode_map(grid)
                poses = plan_poses(
                    road, query_of(request, road.frame_id, self.config), self.config
                )
                return encode_path(poses, np.full(len(poses), stamp), road.frame_id, stamp)
            except ScenarioGenError as error:
                kind = type(error).__name__
                self.status(
                    Level.ERROR,
                    str(error),
                    "get_plan",
                    error=kind,
                    job=name,
                    request_stamp=decimal_stamp(stamp),
                )
                return b""

        response.plan.header.stamp = request.start.header.stamp
        if not self.active:
            self.get_logger().warning("no plan: the node is not active; activate it first")
        elif plan := await self.result_of(name, job, lambda _: b""):
            response.plan = deserialize_message(plan, Path)
        return response


def _plan_part(whole: Chain, part: Encounter) -> Planned:
    """Return a part of a template, planned."""
    segmentation = _part_of(whole.segmentation, whole.encounter, part)
    return replace(whole, situation=Situation.of(part), segmentation=segmentation).plan()


def _part_of(segmentation: Segmentation, whole: Encounter, part: Encounter) -> Segmentation:
    """Return the segmentation of a part of an encounter."""
    first = (part.start_ns - whole.start_ns) // whole.dt_ns
    count = len(part.time)
    changepoints = segmentation.changepoints - first
    return replace(
        segmentation,
        labels=segmentation.labels[first : first + count],
        changepoints=changepoints[(changepoints > 0) & (changepoints < count)],
        changepoint_probability=segmentation.changepoint_probability[first : first + count],
    )


def query_of(request: Any, frame_id: str, config: Config) -> PoseQuery:
    """Return the query of a nav_msgs/srv/GetPlan request.

    Raises:
        InputError: a pose is not finite, has no rotation, or is in another frame than the map, or
            the tolerance is negative.
    """
    if not (math.isfinite(request.tolerance) and request.tolerance >= 0.0):
        raise InputError(f"tolerance is {request.tolerance}; it must be at least 0 m")
    poses = []
    for name, stamped in (("start", request.start), ("goal", request.goal)):
        at, turn = stamped.pose.position, stamped.pose.orientation
        if stamped.header.frame_id not in ("", frame_id):
            raise InputError(
                f"{name} is in frame {stamped.header.frame_id!r}; the map is in {frame_id!r}"
            )
        rotation = np.array([turn.x, turn.y, turn.z, turn.w])
        if not np.isfinite([at.x, at.y, *rotation]).all():
            raise InputError(f"{name} is not finite ({at.x}, {at.y})")
        check_quaternions(rotation, name)
        poses.append(np.array([at.x, at.y, float(yaw(rotation))]))
    kind = VEHICLE_TYPES[config.vehicle_type]
    curvature = config.limits.of(config.vehicle_type).planned.max_curvature
    wanted = Preferences(config.planning.margin)
    return PoseQuery(poses[0], poses[1], kind.length, kind.width, curvature, wanted)


def plan_poses(road: Road, query: PoseQuery, config: Config) -> Floats:
    """Return poses (M, 3) x, y [m], yaw [rad] along the planned path.

    Raises:
        RefusedError: the start or goal is blocked, there is no route, or the budget is spent.
    """
    planner, budget = make_planner(config.planning), Budget(config.planning.iterations)
    plan = partial(planner.plan_poses, road, query, budget, config.seed)
    return checked_path(config.planning.planner, plan)
