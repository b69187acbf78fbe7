# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A planner: the shortest of the free ways with at most one corner, which is drawn at random."""

import numpy as np

from scenario_gen import PlanningConfig, Road
from scenario_gen.method.routing import Budget, BudgetSpentError, check_query, Plan, Query
from scenario_gen.roads import segments_free


class OneCorner:
    """As many corners are tried as there are iterations; it has no parameters of its own."""

    def __init__(self, _: PlanningConfig) -> None:
        pass

    def plan(self, road: Road, query: Query, budget: Budget, seed: int) -> Plan:
        """Return the way; the same seed gives the same one."""
        check_query(road, query)
        rng, size = (
            np.random.default_rng(seed),
            np.array(road.drivable.shape[::-1]) * road.resolution,
        )
        corners = np.vstack(
            [
                0.5 * (query.start + query.goal),
                road.origin + size * rng.random((budget.iterations or 1000, 2)),
            ]
        )
        start, goal = (
            np.broadcast_to(query.start, corners.shape),
            np.broadcast_to(query.goal, corners.shape),
        )
        free = segments_free(road, start, corners, query.radius) & segments_free(
            road, corners, goal, query.radius
        )
        if not free.any():
            raise BudgetSpentError(f"no way with one corner on road {road.name!r}")
        lengths = np.linalg.norm(corners - start, axis=1) + np.linalg.norm(goal - corners, axis=1)
        best = int(np.argmin(np.where(free, lengths, np.inf)))
        return Plan(
            np.array([query.start, corners[best], query.goal]),
            float(lengths[best]),
            len(corners),
            np.zeros((0, 3)),
        )
