# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Planning: RRT*-Connect between fitted anchors, and routes that can be driven."""

from scenario_gen.method.routing.config import MakePlanner, PlanningConfig
from scenario_gen.method.routing.legs import checked_path
from scenario_gen.method.routing.plan import make_planner, plan_routes
from scenario_gen.method.routing.search.planner import (
    Budget,
    BudgetSpentError,
    Plan,
    PoseQuery,
    Preferences,
)

__all__ = [
    "Budget",
    "BudgetSpentError",
    "MakePlanner",
    "Plan",
    "PlanningConfig",
    "PoseQuery",
    "Preferences",
    "checked_path",
    "make_planner",
    "plan_routes",
]
