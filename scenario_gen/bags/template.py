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

"""A fitted template as its messages tell it."""

from collections.abc import Mapping
from dataclasses import dataclass

from msg_conventions.changepoints import decode_changepoints
from msg_conventions.fits import anchor_stamps, decode_fit
from msg_conventions.names import tokens
from msg_conventions.paths import decode_route
from msg_conventions.roads import decode_map
from msg_conventions.topics import vehicle_topic
from msg_conventions.tracks import decode_tracks
from scenario_gen.encounter import Encounter
from scenario_gen.errors import InputError
from scenario_gen.planning import Route
from scenario_gen.roads import Road
from scenario_gen.scenario import BoundaryStates
from scenario_gen.segmentation.result import Segmentation


@dataclass(frozen=True, eq=False)
class Template:
    """An encounter with its changepoints, placed on a road."""

    encounter: Encounter
    segmentation: Segmentation
    road: Road
    asked: BoundaryStates
    routes: tuple[Route, ...]


def read_template(messages: Mapping[str, bytes]) -> Template:
    """Return the template that the messages (by topic) describe; the road's entries and exits may be missing.

    Raises:
        InputError: a message is damaged, in another frame than the map, or missing.
    """
    encounter = decode_tracks(messages["tracks"])
    segmentation = decode_changepoints(messages["changepoints"], encounter)
    _, road = decode_map(messages["map"], messages.get("road/entries"), messages.get("road/exits"))
    _, frame, asked, poses = decode_fit(messages["fit"])
    anchors = anchor_stamps(encounter, segmentation.changepoints)
    if poses.shape[:2] != (len(encounter.vehicles), len(anchors)):
        raise InputError(
            f"fit: {poses.shape[0]} vehicles at {poses.shape[1]} points, where tracks and changepoints ask for "
            f"{len(encounter.vehicles)} at {len(anchors)}"
        )
    routes = []
    for name in tokens(vehicle.id for vehicle in encounter.vehicles):
        topic = vehicle_topic(name, "route")
        if topic not in messages:
            raise InputError(f"{topic} is missing, though tracks has a vehicle {name!r}")
        route_frame, route = decode_route(messages[topic], anchors, topic)
        if {frame, route_frame} != {road.frame_id}:
            raise InputError(f"{topic}: frame {route_frame!r}, fit {frame!r} and map {road.frame_id!r} must be one and the same")
        routes.append(route)
    return Template(encounter, segmentation, road, asked, tuple(routes))
