# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The interface of all geometric planners: queries, budget, answer, and the protocol."""

from dataclasses import dataclass, field
import math
from typing import Protocol

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import edge_lengths, Floats, sealed
from scenario_gen.types import Road

NO_POSES = sealed(np.empty((0, 3)))


class BlockedError(RefusedError):
    """The start or the goal collides; `end` says which ("start" or "goal")."""

    def __init__(self, end: str, message: str) -> None:
        super().__init__(message)
        self.end = end


class NoWayError(RefusedError):
    """Connected components prove at once that no route leads from start to goal."""


class BudgetSpentError(RefusedError):
    """A route may exist, but none was found within the budget."""


@dataclass(frozen=True, eq=False)
class Preferences:
    """What a path for a vehicle should avoid, as costs on top of its length.

    Attributes:
        clearance: wanted beside the footprint [m].
        clearance_cost: extra cost of a metre without any clearance.
        guide: (G, 3) poses of a line to stay near; empty: no side costs more.
        left_cost: extra cost of a metre driven a metre left of the guide [1/m].
        right_cost: extra cost of a metre driven a metre right of the guide [1/m].
        max_left: largest allowed offset to the left of the guide [m].
        max_right: largest allowed offset to the right of the guide [m].
        samples: (S, 3) poses to sample near; empty: the poses of a path for a disc.
    """

    clearance: float = 0.0
    clearance_cost: float = 1.0
    guide: Floats = field(default_factory=lambda: NO_POSES)
    left_cost: float = 0.0
    right_cost: float = 0.0
    max_left: float = math.inf
    max_right: float = math.inf
    samples: Floats = field(default_factory=lambda: NO_POSES)


@dataclass(frozen=True, eq=False)
class PoseQuery:
    """A query for a vehicle: start and goal (3,) x [m], y [m], yaw [rad]; footprint [m].

    Its path turns with at most `curvature` [1/m].
    """

    start: Floats
    goal: Floats
    length: float
    width: float
    curvature: float
    preferences: Preferences = field(default_factory=Preferences)


@dataclass(frozen=True)
class Budget:
    """Limits of a search: `iterations`, `seconds` of CPU time.

    Only iterations give the same answer every time. `first` stops at the first path.
    """

    iterations: int | None = 2000
    seconds: float | None = None
    first: bool = False


@dataclass(frozen=True, eq=False)
class Plan:
    """A planner's answer.

    Attributes:
        path: (P, 3) x, y [m], yaw [rad] from start to goal.
        cost: its length [m], and the extra costs of the preferences.
        iterations: number of iterations (0 if the planner does not report it).
        history: (h, 3) iteration, CPU seconds, cost [m] of each improvement.
    """

    path: Floats
    cost: float
    iterations: int
    history: Floats


class Planner(Protocol):
    """Finds a short drivable path for a vehicle."""

    def plan_poses(self, road: Road, query: PoseQuery, budget: Budget, seed: int) -> Plan:
        """Return the best path found within the budget.

        Raises:
            BlockedError: the footprint has no room at start or goal.
            NoWayError: there is no route.
            BudgetSpentError: none was found within the budget.
        """
        ...


def path_length(path: Floats) -> float:
    """Return the length of a polyline (P, 2 or more), in its unit."""
    return float(edge_lengths(path[:, :2]).sum())
