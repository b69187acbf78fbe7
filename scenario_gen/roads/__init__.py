"""Occupancy grids, their entries and exits, and the readers of map formats."""

from scenario_gen.roads.build import build_road
from scenario_gen.roads.config import RoadConfig
from scenario_gen.roads.road import Road

__all__ = ["Road", "RoadConfig", "build_road"]
