# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""OMPL's planners for a disc in the plane.

OMPL uses the exact edge check of our own planner through a motion validator around the compiled
kernel. So neither its default checking resolution, 1 % of the extent, nor a Python callback per
state slows it down.
"""

from collections.abc import Callable
from typing import Any

from ompl import base

from scenario_gen.method.routing.search.ompl_solve import bounded, search
from scenario_gen.numerics import Floats
from scenario_gen.roads import segment_free


class ExactEdges(base.MotionValidator):  # type: ignore[misc]
    """The exact edge check, for a disc in a clearance field (H, W); in cells."""

    def __init__(self, information: Any, clearance: Floats, radius: float) -> None:
        super().__init__(information)
        self.clearance, self.radius = clearance, radius

    def checkMotion(self, a: Any, b: Any, *_: Any) -> bool:  # noqa: N802 - OMPL's name
        """Whether the straight line between two states is free."""
        return bool(segment_free(self.clearance, a[0], a[1], b[0], b[1], self.radius))


def plane(clearance: Floats) -> Any:
    """Return OMPL's space information for the plane of a grid (H, W) in cells, without checks."""
    return bounded(base.RealVectorStateSpace(2), clearance)


def exact_plane(clearance: Floats, radius: float) -> Any:
    """Return OMPL's space information for the plane, with exact checks for a disc."""
    information = plane(clearance)
    validator = ExactEdges(information, clearance, radius)
    information.setStateValidityChecker(lambda state: validator.checkMotion(state, state))
    information.setMotionValidator(validator)
    information.setup()
    return information


def solve(
    information: Any,
    ends: Floats,
    planner: str,
    stop: Callable[[int], bool],
    *,
    step: float | None = None,
    simplify: bool = True,
) -> tuple[Floats, int]:
    """Search for a path with one of OMPL's planners.

    Args:
        information: the plane and its checks.
        ends: (2, 2) start and goal [cells].
        planner: a name of PLANNERS.
        stop: called with the number of calls so far (about one per iteration); True ends it.
        step: longest edge [cells]; None: OMPL's default.
        simplify: whether to run OMPL's path simplifier.

    Returns:
        The path (P, 2) in cells, without a row if none was found; and the number of calls.
    """
    states = []
    for end in ends:
        state = information.getStateSpace().allocState()
        state[0], state[1] = float(end[0]), float(end[1])
        states.append(state)
    return search(
        information,
        states,
        lambda state: (state[0], state[1]),
        planner,
        stop,
        step,
        simplify=simplify,
    )
