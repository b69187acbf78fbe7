# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What every geometric planner takes and gives: the Protocol, its budget and its answer."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import Floats, frozen
from scenario_gen.roads import common_component, segments_free
from scenario_gen.types import Road


class BlockedError(RefusedError):
    """The start or the goal collides; `end` says which ("start" or "goal")."""

    def __init__(self, end: str, message: str) -> None:
        super().__init__(message)
        self.end = end


class NoWayError(RefusedError):
    """Connected components prove at once that no route leads from start to goal."""


class BudgetSpentError(RefusedError):
    """A way may exist, but none was found within the budget, or the search was cancelled."""


@dataclass(frozen=True)
class Query:
    """From where to where, for a disc: start and goal (2,) [m] in the road's frame, radius [m]."""

    start: Floats
    goal: Floats
    radius: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", frozen(np.reshape(self.start, 2)))
        object.__setattr__(self, "goal", frozen(np.reshape(self.goal, 2)))


@dataclass(frozen=True)
class Budget:
    """When a search stops: after `iterations`, after `seconds` of CPU time, or when `cancelled()` says so; what comes first.

    Only iterations give the same answer every time. `first` stops at the first path.
    """

    iterations: int | None = 2000
    seconds: float | None = None
    first: bool = False
    cancelled: Callable[[], bool] | None = None


@dataclass(frozen=True, eq=False)
class Plan:
    """A planner's answer.

    Attributes:
        path: (P, 2) metres, from start to goal.
        cost: its Euclidean length [m].
        iterations: how many were made (0 if the planner does not tell).
        history: (h, 3) iteration, CPU seconds, cost [m] of each improvement.
    """

    path: Floats
    cost: float
    iterations: int
    history: Floats


class Planner(Protocol):
    """Finds a short free path for a disc on a road."""

    def plan(self, road: Road, query: Query, budget: Budget, seed: int) -> Plan:
        """Return the best path found within the budget.

        Raises:
            BlockedError: start or goal collides.
            NoWayError: there is no route.
            BudgetSpentError: none was found in time.
        """
        ...


RETRY_FACTOR = 100
"""Times the iterations that a search may go on for a first path, where connected components have shown that there is a way."""


def plan_with_retry(
    planner: Planner, road: Road, query: Query, iterations: int, seed: int
) -> Plan:
    """Return the best path found in so many iterations; where there is none yet, the first that more patience finds.

    Raises:
        BlockedError, NoWayError, BudgetSpentError: as `Planner.plan`.
    """
    try:
        return planner.plan(road, query, Budget(iterations), seed)
    except BudgetSpentError:
        return planner.plan(road, query, Budget(RETRY_FACTOR * iterations, first=True), seed)


def check_query(road: Road, query: Query) -> int:
    """Raise BlockedError or NoWayError if no search could succeed.

    Returns:
        The label of the component (see `roads.connectivity`) that joins start and goal; 0: only the straight way does.
    """
    label = common_component(road, query.start, query.goal, query.radius)
    if label:  # both ends move freely to a cell of it
        return label
    ends = np.stack((query.start, query.goal))
    for end, xy, free in zip(
        ("start", "goal"), ends, segments_free(road, ends, ends, query.radius), strict=True
    ):
        if not free:
            raise BlockedError(
                end,
                f"the {end} ({xy[0]:.2f}, {xy[1]:.2f}) m is not drivable on road {road.name!r} for a disc of radius "
                f"{query.radius:.2f} m",
            )
    if label is None:
        (x0, y0), (x1, y1) = query.start, query.goal
        raise NoWayError(
            f"no route leads from ({x0:.2f}, {y0:.2f}) m to ({x1:.2f}, {y1:.2f}) m on road {road.name!r} "
            f"for a disc of radius {query.radius:.2f} m"
        )
    return label


def path_length(path: Floats) -> float:
    """Length of a polyline (P, 2), in its unit, metres or cells."""
    edge = path[1:] - path[:-1]
    return float(np.hypot(edge[:, 0], edge[:, 1]).sum())
