# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Roads: drawn ones, occupancy grids, and the readers of map formats."""

from scenario_gen.roads.build import (
    build_road,
    BUILT_IN,
    CORRIDOR,
    road_and_template,
    ROADS,
    ROUNDABOUT,
    windows_on_map,
)
from scenario_gen.roads.clearance import (
    CONTACT_CELLS,
    footprint_fits,
    nearest_pose_with_room,
    segment_free,
    segments_free,
    to_cells,
    to_metres,
)
from scenario_gen.roads.config import RoadConfig
from scenario_gen.roads.connectivity import free_cells, free_space, FreeSpace
from scenario_gen.roads.drawn import draw_plan
from scenario_gen.roads.junctions import drives_about_ring
from scenario_gen.roads.lights import lights_of
from scenario_gen.roads.obstacles import read_obstacles
from scenario_gen.roads.plan import Arm, Plan
from scenario_gen.roads.room import has_room, max_repair, share_with_room
from scenario_gen.roads.vector.candidate import PlaceLimits
from scenario_gen.roads.vector.ground import (
    along_lanes,
    drives_against,
    ground_for,
    own_side,
)
from scenario_gen.roads.vector.lane_graph import lane_graph, LanePath
from scenario_gen.roads.vector.place import (
    best_place,
    find_places,
    NoPlaceError,
    Place,
    places,
    users_of,
)
from scenario_gen.roads.vector.read import is_vector_map, read_network, split
from scenario_gen.roads.vector.rules import RuleCheck
from scenario_gen.roads.ways import draw_route

__all__ = [
    "BUILT_IN",
    "CONTACT_CELLS",
    "CORRIDOR",
    "ROADS",
    "ROUNDABOUT",
    "Arm",
    "FreeSpace",
    "LanePath",
    "NoPlaceError",
    "Place",
    "PlaceLimits",
    "Plan",
    "RoadConfig",
    "RuleCheck",
    "along_lanes",
    "best_place",
    "build_road",
    "draw_plan",
    "draw_route",
    "drives_about_ring",
    "drives_against",
    "find_places",
    "footprint_fits",
    "free_cells",
    "free_space",
    "ground_for",
    "has_room",
    "is_vector_map",
    "lane_graph",
    "lights_of",
    "max_repair",
    "nearest_pose_with_room",
    "own_side",
    "places",
    "read_network",
    "read_obstacles",
    "road_and_template",
    "segment_free",
    "segments_free",
    "share_with_room",
    "split",
    "to_cells",
    "to_metres",
    "users_of",
    "windows_on_map",
]
