# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One query for one of OMPL's planners, in this process: see `planners` for the way that cannot hang or crash the caller.

OMPL sees the same exact edge check as our own planner (a motion validator around the compiled kernel), so neither its default
checking resolution of 1 % of the extent nor a Python callback per state stands in its way. For comparison it can also be
had as its Python users have it: state by state, one cell apart, which is not exact.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from ompl import base, geometric, util

from scenario_gen.numerics import Floats
from scenario_gen.roads import segment_free

PLANNERS = {
    "ompl_rrt_connect": "RRTConnect",
    "ompl_rrt_star": "RRTstar",
    "ompl_informed_rrt_star": "InformedRRTstar",
    "ompl_bit_star": "BITstar",
}


@dataclass(frozen=True, eq=False)
class Answer:
    """What OMPL found, in cells: the path (P, 2) as it is (empty: none found), the same simplified, termination checks made."""

    path: Floats
    simplified: Floats
    checks: int


@dataclass(frozen=True)
class Options:
    """How OMPL searches.

    Attributes:
        step: longest edge [cells]; None: OMPL's own choice.
        simplify: also run OMPL's path simplifier.
        state_by_state: check edges by a Python callback per state, a cell apart, instead of exactly.
    """

    step: float | None = None
    simplify: bool = True
    state_by_state: bool = False


def solve(
    clearance: Floats,
    ends: Floats,
    radius: float,
    planner: str,
    stop: Callable[[int], bool],
    options: Options = Options(),
    seed: int | None = None,
) -> Answer:
    """Let one of OMPL's planners search for a path.

    Args:
        clearance: (H, W) cells.
        ends: (2, 2) start and goal [cells].
        radius: disc radius [cells].
        planner: a name of PLANNERS.
        stop: called with the number of calls so far (about one per iteration); True ends the search.
        options: how it searches.
        seed: of OMPL's random numbers; only the first search of a process can set it.
    """
    util.setLogLevel(util.LOG_NONE)
    if seed is not None:
        util.RNG.setSeed(seed % (2**31 - 1) + 1)
    information = _space(clearance, radius, state_by_state=options.state_by_state)
    problem = base.ProblemDefinition(information)
    states = []
    for end in ends:
        state = information.getStateSpace().allocState()
        state[0], state[1] = float(end[0]), float(end[1])
        states.append(state)
    problem.setStartAndGoalStates(*states)
    problem.setOptimizationObjective(base.PathLengthOptimizationObjective(information))
    search = getattr(geometric, PLANNERS[planner])(information)
    if options.step is not None:
        search.setRange(options.step)
    search.setProblemDefinition(problem)
    search.setup()
    calls = 0

    def ended() -> bool:
        nonlocal calls
        calls += 1
        return stop(calls)

    search.solve(base.PlannerTerminationCondition(ended))
    if not problem.hasExactSolution():
        return Answer(np.empty((0, 2)), np.empty((0, 2)), calls)
    path = problem.getSolutionPath()
    bare = _vertices(path)
    if options.simplify:
        geometric.PathSimplifier(information).simplifyMax(path)
    return Answer(bare, _vertices(path), calls)


def _space(clearance: Floats, radius: float, *, state_by_state: bool) -> Any:
    """The plane of the grid, with the check of states and edges."""
    height, width = clearance.shape
    space = base.RealVectorStateSpace(2)
    bounds = base.RealVectorBounds(2)
    for axis, extent in enumerate((width, height)):
        bounds.setLow(axis, 0.0)
        bounds.setHigh(axis, float(extent))
    space.setBounds(bounds)
    information = base.SpaceInformation(space)

    class Edges(base.MotionValidator):  # type: ignore[misc]
        """The exact edge check."""

        def checkMotion(self, a: Any, b: Any, *_: Any) -> bool:  # noqa: N802 - OMPL's name
            return bool(segment_free(clearance, a[0], a[1], b[0], b[1], radius))

    def is_free(state: Any) -> bool:
        x, y = state[0], state[1]
        return bool(segment_free(clearance, x, y, x, y, radius))

    def is_in_free_cell(state: Any) -> bool:
        return bool(
            clearance[min(int(state[1]), height - 1), min(int(state[0]), width - 1)] > radius
        )

    if state_by_state:
        information.setStateValidityChecker(is_in_free_cell)
        information.setStateValidityCheckingResolution(1.0 / space.getMaximumExtent())
    else:
        information.setStateValidityChecker(is_free)
        information.setMotionValidator(Edges(information))
    information.setup()
    return information


def _vertices(path: Any) -> Floats:
    return np.array(
        [[path.getState(k)[0], path.getState(k)[1]] for k in range(path.getStateCount())]
    )
