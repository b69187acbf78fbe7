# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Planning: RRT*-Connect between fitted anchors, and routes that can be driven."""

from scenario_gen.method.routing.config import PlanningConfig
from scenario_gen.method.routing.plan import deviations, plan_routes
from scenario_gen.types.route import Route

__all__ = ["PlanningConfig", "Route", "deviations", "plan_routes"]
