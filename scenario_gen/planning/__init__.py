"""Planning: RRT*-Connect between fitted anchors, and routes that can be driven."""

from scenario_gen.planning.config import PlanningConfig
from scenario_gen.planning.plan import deviations, plan_routes
from scenario_gen.planning.route import Route

__all__ = ["PlanningConfig", "Route", "deviations", "plan_routes"]
