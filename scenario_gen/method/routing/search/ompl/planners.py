# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""OMPL's planners behind the same Protocol, each search in a process of its own.

Some of OMPL's planners hang, and some take their process down. So every search runs in a child forked from a clean server
process that has OMPL loaded; it is ended when its time is over or the caller cancels, and its death is an answer, not a crash.
A fresh child also makes a seed mean the same thing every time (OMPL takes one per process only).
"""

from dataclasses import dataclass
import multiprocessing
from multiprocessing.connection import Connection
from time import monotonic, thread_time
from typing import Any

import numpy as np

from scenario_gen.base.errors import needs
from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.method.routing.search.planner import (
    Budget,
    BudgetSpentError,
    check_query,
    path_length,
    Plan,
    Query,
)
from scenario_gen.numerics import Floats
from scenario_gen.roads import clearance_in_cells, to_cells, to_metres
from scenario_gen.types import Road

GLANCE = 0.05  # [s] between two looks at the child and at the caller's wish to cancel


@dataclass(frozen=True)
class OmplConfig(Parameters):
    """Settings of the planners from OMPL."""

    step: float = parameter(
        0.0, "longest new edge; 0: OMPL's own choice", unit="cells", low=0.0, high=1e6
    )
    simplify: bool = parameter(True, "run OMPL's path simplifier at the end")
    time_limit: float = parameter(
        30.0,
        "wall-clock time after which a search is ended by force",
        unit="s",
        low=0.1,
        high=3600.0,
    )


class OmplPlanner:
    """One of OMPL's planners; `name` is a key of `solve.PLANNERS`.

    Source: the Open Motion Planning Library (Şucan, Moll & Kavraki 2012).
    """

    def __init__(self, name: str, config: OmplConfig = OmplConfig()) -> None:
        self.name = name
        self.config = config

    def plan(self, road: Road, query: Query, budget: Budget, seed: int) -> Plan:
        """See `Planner.plan`; an iteration is one look of OMPL's at its termination condition.

        Raises:
            BudgetSpentError: no path was found within the budget.
        """
        check_query(road, query)
        needs("planners", "ompl")
        from scenario_gen.method.routing.search.ompl.child import search  # loads OMPL

        started = thread_time()
        ends = to_cells(road, np.stack((query.start, query.goal)))
        context = multiprocessing.get_context("forkserver")
        context.set_forkserver_preload(["scenario_gen.method.routing.search.ompl.child"])
        ours, theirs = context.Pipe(duplex=False)
        request = (
            clearance_in_cells(road),
            ends,
            query.radius / road.resolution,
            self.name,
            self.config,
        )
        child = context.Process(
            target=search,
            args=(theirs, request, budget.iterations, budget.seconds, seed),
            daemon=True,
        )
        child.start()
        theirs.close()
        try:
            path, iterations, seconds = self._await(ours, child, budget)
        finally:
            if child.is_alive():
                child.kill()
            child.join()
            ours.close()
        if not len(path):
            raise BudgetSpentError(
                f"{self.name} found no path on road {road.name!r} within {iterations} iterations, {seconds:.2f} s"
            )
        metres = to_metres(road, path)
        metres[0], metres[-1] = query.start, query.goal
        cost = path_length(metres)
        return Plan(
            metres,
            cost,
            iterations,
            np.array([[iterations, seconds + thread_time() - started, cost]]),
        )

    def _await(self, ours: Connection, child: Any, budget: Budget) -> tuple[Floats, int, float]:
        """The child's answer; BudgetSpentError if it dies, takes too long or is no longer wanted."""
        deadline = monotonic() + self.config.time_limit + (budget.seconds or 0.0)
        while not ours.poll(GLANCE):
            if budget.cancelled and budget.cancelled():
                raise BudgetSpentError(f"{self.name} was cancelled")
            if monotonic() > deadline:
                raise BudgetSpentError(
                    f"{self.name} did not answer within {self.config.time_limit:.0f} s and was ended"
                )
        try:
            answer: tuple[Floats, int, float] = ours.recv()
        except EOFError:
            child.join(1.0)
            raise BudgetSpentError(
                f"{self.name} ended without an answer (exit code {child.exitcode})"
            ) from None
        return answer
