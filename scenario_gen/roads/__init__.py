# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Occupancy grids, their entries and exits, and the readers of map formats."""

from scenario_gen.roads.along import lane_along, sharing_lanes
from scenario_gen.roads.build import (
    build_road,
    BUILT_IN,
    CORRIDOR,
    DrawRoad,
    road_and_template,
    ROADS,
    ROUNDABOUT,
)
from scenario_gen.roads.builtin import draw, layout_for
from scenario_gen.roads.clearance import (
    blocked_before,
    clearance_field,
    clearance_in_cells,
    CONTACT,
    distance_transform,
    footprint_fits,
    free_length,
    nearest_pose_with_room,
    segment_free,
    segments_free,
    to_cells,
    to_metres,
)
from scenario_gen.roads.config import RoadConfig
from scenario_gen.roads.connectivity import common_component, component_cells
from scenario_gen.roads.drawn import Arm, draw_plan, Driven, Plan, ways_through
from scenario_gen.roads.junctions import drives_about_ring
from scenario_gen.roads.obstacles import read_obstacles
from scenario_gen.roads.pavement import drivable_beside
from scenario_gen.roads.vector.ground import (
    along_lanes,
    cells_of,
    drives_against,
    ground_for,
    own_ground,
)
from scenario_gen.roads.vector.match import Course
from scenario_gen.roads.vector.place import (
    NoPlaceError,
    Place,
    placements,
    places,
    tracks_on,
    users_of,
)
from scenario_gen.roads.vector.read import is_vector_map, read_network, split
from scenario_gen.roads.vector.rules import RuleCheck
from scenario_gen.roads.ways import draw_route

__all__ = [
    "BUILT_IN", "CONTACT", "CORRIDOR", "ROADS", "ROUNDABOUT", "Arm", "Course", "DrawRoad", "Driven", "NoPlaceError",
    "Place", "Plan", "RoadConfig", "RuleCheck", "along_lanes", "blocked_before", "build_road", "cells_of", "clearance_field",
    "clearance_in_cells", "common_component", "component_cells", "distance_transform", "draw", "draw_plan", "draw_route",
    "drivable_beside", "drives_about_ring", "drives_against", "footprint_fits", "free_length", "ground_for", "is_vector_map",
    "lane_along", "layout_for", "nearest_pose_with_room", "own_ground", "placements", "places", "read_network",
    "read_obstacles", "road_and_template", "segment_free", "segments_free", "sharing_lanes", "split", "to_cells", "to_metres",
    "tracks_on", "users_of", "ways_through",
]  # fmt: skip
