# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Occupancy grids, their entries and exits, and the readers of map formats."""

from scenario_gen.roads.build import build_road, BUILT_IN, road_and_template
from scenario_gen.roads.config import RoadConfig
from scenario_gen.types.road import Road

__all__ = ["BUILT_IN", "Road", "RoadConfig", "build_road", "road_and_template"]
