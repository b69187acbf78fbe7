# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""road_server: `map` and its description, `road/lanes`; `~/get_map`, `~/load_map`.

Built-in roads are sized to the template: the node publishes the road for each encounter on
`tracks`, with its stamp. Without tracks it publishes the road in its default size with stamp 0
(`corridor` waits for tracks).
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlparse

from ament_index_python.packages import get_package_share_directory, PackageNotFoundError
from nav_msgs.msg import OccupancyGrid
from nav_msgs.srv import GetMap, LoadMap
from rclpy.serialization import deserialize_message

from msg_conventions.cdr import stamp_of
from msg_conventions.diagnostics import Level
from msg_conventions.documents import LANES
from msg_conventions.pictures import road_markers
from msg_conventions.roads import road_messages
from msg_conventions.tracks import decode_tracks
from scenario_gen.base.cancelling import stop_if_cancelled
from scenario_gen.base.errors import InputError, RefusedError, ScenarioGenError
from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.method.fitting import FittingConfig
from scenario_gen.roads import build_road, RoadConfig
from scenario_gen.ros.common.node_parameters import ROAD_NAMES
from scenario_gen.ros.common.recording_part import request_part
from scenario_gen.ros.common.recording_part import TOPIC as PART
from scenario_gen.ros.common.services import REQUESTS
from scenario_gen.ros.common.stage_node import StageNode
from scenario_gen.types import NoteKind


@dataclass(frozen=True)
class Config(Parameters):
    """The road server's parameters."""

    road_name: str = parameter(
        "t_intersection",
        f"{', '.join(ROAD_NAMES)}, a map_server YAML file, or a vector map (.osm, .xodr, .xml)",
    )
    wait_for_tracks: bool = parameter(False, "publish no road before tracks arrive")
    road: RoadConfig = field(default_factory=RoadConfig)
    fitting: FittingConfig = field(default_factory=FittingConfig)


def road_of_url(url: str) -> str:
    """Return the built-in name or file path of a LoadMap request's URL.

    Raises:
        InputError: another scheme than file:// and package://, or a package that is not installed.
    """
    parts = urlparse(url)
    if parts.scheme == "file":
        return unquote(parts.path)
    if parts.scheme == "package":
        try:
            return str(
                Path(get_package_share_directory(parts.netloc)) / unquote(parts.path).lstrip("/")
            )
        except (PackageNotFoundError, ValueError):
            raise InputError(
                f"{url}: package {parts.netloc!r} is not installed or not sourced"
            ) from None
    if parts.scheme:
        raise InputError(
            f"{url}: give file://, package://, a path, or the name of a built-in road"
        )
    return url


class RoadServer(StageNode):
    """Serves one road at a time."""

    INPUTS = ("tracks",)
    STAGES = ("roads",)
    OUTPUTS = ("map", "road/entries", "road/exits", LANES, "road/markings", PART)

    def __init__(self, namespace: str | None = None) -> None:
        super().__init__("road_server", Config(), namespace)
        self._tracks: bytes | None = None
        self._name = self.config.road_name
        self._grid: bytes | None = None
        self.create_service(GetMap, "~/get_map", self._get_map, qos_profile=REQUESTS)
        self._request_count = 0
        self.create_service(LoadMap, "~/load_map", self._load_map, qos_profile=REQUESTS)

    def started(self) -> None:
        """Publish the road in its default size until tracks arrive."""
        if not self.config.wait_for_tracks and self.config.road_name != "corridor":
            self.work("road", lambda _: self._publish(self._name))

    def received(self, topic: str, data: bytes) -> None:
        """Size the road to the newest encounter."""
        self._tracks = data
        self.work("road", lambda _: self._publish(self._name))

    def _publish(self, name: str) -> None:
        """Build a road, sized to the tracks if there are any, and publish it."""
        tracks = self._tracks
        encounter = decode_tracks(tracks) if tracks else None
        try:
            road = build_road(name, encounter, self.config.road)
        except RefusedError as error:
            if encounter is None:
                raise
            road_of_part = partial(build_road, name, config=self.config.road)
            request_part(self, road_of_part, encounter, error, self.config.fitting)
            return
        stamp_ns = stamp_of(tracks, "tracks") if tracks else 0
        messages = road_messages(road, stamp_ns)
        messages["road/markings"] = road_markers(road.lanes, road.frame_id, stamp_ns)
        stop_if_cancelled()
        for topic, data in messages.items():
            self.outputs.send(topic, data)
        self._grid = messages["map"]
        height, width = road.drivable.shape
        message = f"{road.name}: {width} x {height} cells of {road.resolution:.2f} m, " + (
            "no lanes" if road.lanes is None else f"{len(road.entries)} entries"
        )
        faults = [
            str(note)
            for note in (road.lanes.notes if road.lanes is not None else ())
            if note.kind is NoteKind.FAULTY
        ]
        level, message = (
            (Level.WARN, "; ".join([message, *faults])) if faults else (Level.OK, message)
        )
        self.status(level, message, "road", stamp_ns)

    def _get_map(self, _request: Any, response: Any) -> Any:
        if self._grid is not None:
            response.map = deserialize_message(self._grid, OccupancyGrid)
        return response

    async def _load_map(
        self, request: LoadMap.Request, response: LoadMap.Response
    ) -> LoadMap.Response:
        """Load another road, off the executor's thread, until the next request or restart."""
        codes = LoadMap.Response
        self._request_count += 1

        def job(cancelled: Callable[[], bool]) -> int:
            if cancelled():
                return int(codes.RESULT_UNDEFINED_FAILURE)
            try:
                name = road_of_url(request.map_url)
                self._publish(name)
                self._name = name
                return int(codes.RESULT_SUCCESS)
            except ScenarioGenError as reason:
                message = f"load_map {request.map_url!r}: {reason}"
                self.status(
                    Level.ERROR, message, "load_map", error=type(reason).__name__
                )  # cleared when the job ends
                missing = not Path(request.map_url.removeprefix("file://")).exists()
                return int(
                    codes.RESULT_MAP_DOES_NOT_EXIST
                    if missing
                    else codes.RESULT_INVALID_MAP_METADATA
                )

        response.result = codes.RESULT_UNDEFINED_FAILURE
        if self.active:
            response.result = await self.result_of(
                f"load_map {self._request_count}",
                job,
                lambda _: int(codes.RESULT_UNDEFINED_FAILURE),
            )
            if response.result == codes.RESULT_SUCCESS:
                self._get_map(request, response)
        return response
