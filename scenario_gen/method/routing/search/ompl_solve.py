# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A query for one of OMPL's planners, in this process; `ompl_planners` protects the caller.

OMPL searches the space of Dubins curves, with the exact sweep of our own planner as its motion
validator: a compiled kernel in place of its own checks at a resolution of 1 % of the extent.
"""

from collections.abc import Callable, Sequence
from time import process_time
from typing import Any

import numpy as np
from ompl import base, geometric, util

from scenario_gen.method.routing.search.dubins import Pose
from scenario_gen.method.routing.search.sweep import Scene, steering_cost
from scenario_gen.numerics import Floats

PLANNERS = {
    "ompl_rrt_connect": "RRTConnect",
    "ompl_rrt_star": "RRTstar",
    "ompl_informed_rrt_star": "InformedRRTstar",
    "ompl_bit_star": "BITstar",
}


class ExactSweeps(base.MotionValidator):  # type: ignore[misc]
    """The exact sweep of a vehicle's footprint along a Dubins curve, in cells."""

    def __init__(self, information: Any, scene: Scene) -> None:
        super().__init__(information)
        self.scene = scene

    def checkMotion(self, a: Any, b: Any, *_: Any) -> bool:  # noqa: N802 - OMPL's name
        """Whether the shortest curve between two states is free."""
        return bool(steering_cost(Pose(*_pose(a)), Pose(*_pose(b)), self.scene) < np.inf)


def _pose(state: Any) -> tuple[float, float, float]:
    return state.getX(), state.getY(), state.getYaw()


def bounded(space: Any, clearance: Floats) -> Any:
    """Return the information of a space whose places are on a grid (H, W) in cells."""
    bounds = base.RealVectorBounds(2)
    for axis, extent in enumerate(clearance.shape[::-1]):
        bounds.setLow(axis, 0.0)
        bounds.setHigh(axis, float(extent))
    space.setBounds(bounds)
    return base.SpaceInformation(space)


def curves(scene: Scene) -> Any:
    """Return OMPL's space information for the Dubins curves of a vehicle, with exact checks."""
    space = base.DubinsStateSpace(scene.body.turn_radius)
    information = bounded(space, scene.clearance)
    information.setStateValidityChecker(lambda _: True)  # the sweep of a motion checks its poses
    information.setMotionValidator(ExactSweeps(information, scene))
    information.setup()
    return information


def solve(
    information: Any,
    ends: Floats,
    planner: str,
    stop: Callable[[int], bool],
    *,
    step: float,
    simplify: bool = True,
    first: bool = False,
) -> tuple[Floats, int]:
    """Search for a path with one of OMPL's planners.

    Args:
        information: the curves and their checks.
        ends: (2, 3) poses of start and goal [cells, rad].
        planner: a name of PLANNERS.
        stop: called with the number of calls so far (about one per iteration); True ends it.
        step: longest edge [cells].
        simplify: whether to run OMPL's path simplifier.
        first: whether the first path ends the search.

    Returns:
        Poses (P, 3) joined by Dubins curves, without a row if no path was found; and the number of
        calls.
    """
    states = []
    for x, y, yaw in ends.tolist():
        state = information.getStateSpace().allocState()
        state.setXY(x, y)
        state.setYaw(yaw)
        states.append(state)
    return search(information, states, _pose, planner, stop, step, simplify=simplify, first=first)


def search(
    information: Any,
    ends: Sequence[Any],
    read: Callable[[Any], Sequence[float]],
    planner: str,
    stop: Callable[[int], bool],
    step: float | None,
    *,
    simplify: bool,
    first: bool = False,
) -> tuple[Floats, int]:
    """Search for a path between two states of any space, as `solve` does.

    `read` returns the numbers of a state; `step` None is OMPL's default. Returns a row for each
    state of the path, none if no path was found, and the number of calls.
    """
    util.setLogLevel(util.LOG_NONE)
    problem = base.ProblemDefinition(information)
    problem.setStartAndGoalStates(*ends)
    problem.setOptimizationObjective(base.PathLengthOptimizationObjective(information))
    algorithm = getattr(geometric, PLANNERS[planner])(information)
    if step is not None and planner != "ompl_bit_star":  # it has no range
        algorithm.setRange(step)
    algorithm.setProblemDefinition(problem)
    algorithm.setup()
    calls = 0

    def is_over() -> bool:
        nonlocal calls
        calls += 1
        return stop(calls) or (first and problem.hasExactSolution())

    algorithm.solve(base.PlannerTerminationCondition(is_over))
    if not problem.hasExactSolution():
        return np.empty((0, len(read(ends[0])))), calls
    path = problem.getSolutionPath()
    if simplify:
        geometric.PathSimplifier(information).simplifyMax(path)
    return np.array([read(path.getState(k)) for k in range(path.getStateCount())]), calls


def solve_in_child(
    answer: Any,
    scene: Scene,
    ends: Floats,
    planner: str,
    options: dict[str, Any],
    limits: tuple[int | None, float | None, int],
) -> None:
    """Search in a child process, and send poses, calls and CPU seconds through a connection.

    `limits` are checks, seconds and the seed: only a process's first search can set it.
    """
    checks, seconds, seed = limits
    util.RNG.setSeed(seed % (2**31 - 1) + 1)
    started = process_time()

    def stop(calls: int) -> bool:
        if checks is not None and calls > checks:
            return True
        return seconds is not None and process_time() - started > seconds

    path, calls = solve(curves(scene), ends, planner, stop, **options)
    answer.send((path, calls, process_time() - started))
    answer.close()
