# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A planner: the shortest of the free ways with at most one corner, which is drawn at random."""

import numpy as np

from scenario_gen import PlanningConfig, Road
from scenario_gen.method.routing import Budget, BudgetSpentError, Plan, PoseQuery
from scenario_gen.roads import segments_free


class OneCorner:
    """As many corners are tried as there are iterations; it has no parameters of its own."""

    def __init__(self, _: PlanningConfig) -> None:
        pass

    def plan_poses(self, road: Road, query: PoseQuery, budget: Budget, seed: int) -> Plan:
        """Return the way, whose corner is rounded later; the same seed gives the same one."""
        rng = np.random.default_rng(seed)
        size = np.array(road.drivable.shape[::-1]) * road.resolution
        ends = np.stack((query.start, query.goal))[:, :2]
        drawn = road.origin + size * rng.random((budget.iterations or 1000, 2))
        corners = np.vstack([ends.mean(axis=0), drawn])
        start, goal = (np.broadcast_to(end, corners.shape) for end in ends)
        radius = 0.5 * query.width
        free = segments_free(road, start, corners, radius)
        free &= segments_free(road, corners, goal, radius)
        if not free.any():
            raise BudgetSpentError(f"no way with one corner on road {road.name!r}")
        lengths = np.linalg.norm(corners - start, axis=1) + np.linalg.norm(goal - corners, axis=1)
        best = int(np.argmin(np.where(free, lengths, np.inf)))
        points = np.array([ends[0], corners[best], ends[1]])
        yaw = [query.start[2], np.arctan2(*(ends[1] - corners[best])[::-1]), query.goal[2]]
        poses = np.column_stack((points, yaw))
        return Plan(poses, float(lengths[best]), len(corners), np.zeros((0, 3)))
