# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""OMPL's planners behind the same Protocol, each search in a process of its own.

Some of OMPL's planners hang, and some crash their process. So every search runs in a child, forked
from a clean server process that has loaded OMPL. The child is killed when its time is over or the
caller cancels; its death is an answer, not a crash. A fresh child also gives a seed the same
meaning every time: OMPL accepts only one per process.
"""

from dataclasses import dataclass
import multiprocessing
from multiprocessing.connection import Connection
from time import monotonic, thread_time
from typing import Any

import numpy as np

from scenario_gen.base.cancelling import stop_if_cancelled
from scenario_gen.base.errors import needs
from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.base.signals import environment_set
from scenario_gen.method.routing.search.car_planner import (
    dense_path,
    refuse_blocked,
    refuse_no_way,
    SPACING_M,
)
from scenario_gen.method.routing.search.planner import (
    Budget,
    BudgetSpentError,
    path_length,
    Plan,
    PoseQuery,
)
from scenario_gen.method.routing.search.sweep import car_scene, poses_in_cells
from scenario_gen.numerics import Floats
from scenario_gen.roads import to_metres
from scenario_gen.types import Road

CHECKS_COUNT = 10  # of OMPL's termination condition, in the time of one of our own iterations
MAX_EDGE_M = 100_000.0
POLL_S = 0.05  # between two checks of the child, and of whether the caller has cancelled


@dataclass(frozen=True)
class OmplConfig(Parameters):
    """Settings of the planners from OMPL."""

    step: float = parameter(
        0.0, "longest new edge; 0: of any length", unit="m", low=0.0, high=10_000.0
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

    def plan_poses(self, road: Road, query: PoseQuery, budget: Budget, seed: int) -> Plan:
        """See `Planner.plan_poses`; an iteration is ten checks of OMPL's termination condition.

        Of the query's preferences, the bounds on the offset from the guide hold.

        Raises:
            BlockedError: the footprint has no room at start or goal.
            NoWayError: not even a disc as wide as the footprint can get there.
            BudgetSpentError: no path was found within the budget.
        """
        refuse_blocked(road, query)
        refuse_no_way(road, query)
        needs("planners", "ompl")
        from scenario_gen.method.routing.search.ompl_solve import solve_in_child  # loads OMPL

        started = thread_time()
        context = multiprocessing.get_context("forkserver")
        context.set_forkserver_preload(["scenario_gen.method.routing.search.ompl_solve"])
        receiver, sender = context.Pipe(duplex=False)
        cell, scene = road.resolution, car_scene(road, query)
        options = {
            "step": (self.config.step or MAX_EDGE_M) / cell,
            "simplify": self.config.simplify,
            "first": budget.first,
        }
        checks = None if budget.iterations is None else CHECKS_COUNT * budget.iterations
        child = context.Process(
            target=solve_in_child,
            args=(
                sender,
                scene,
                poses_in_cells(road, np.stack((query.start, query.goal))),
                self.name,
                options,
                (checks, budget.seconds, seed),
            ),
            daemon=True,
        )
        with environment_set({"PYTHONSAFEPATH": "1"}):  # runs no code beside the data
            child.start()
        sender.close()
        try:
            path, calls, seconds = self._answer(receiver, child, budget)
        finally:
            child.kill()  # OMPL's destructors may crash
            child.join()
            receiver.close()
        iterations = calls // CHECKS_COUNT
        if not len(path):
            raise BudgetSpentError(
                f"{self.name} found no path on road {road.name!r} within {iterations} iterations, "
                f"{seconds:.2f} s"
            )
        poses = dense_path(path, scene.body.turn_radius, SPACING_M / cell)
        poses[:, :2] = to_metres(road, poses[:, :2])
        cost = path_length(poses)
        history = np.array([[iterations, seconds + thread_time() - started, cost]])
        return Plan(poses, cost, iterations, history)

    def _answer(
        self, receiver: Connection, child: Any, budget: Budget
    ) -> tuple[Floats, int, float]:
        """Return the child's poses, checks and CPU seconds.

        Raises:
            BudgetSpentError: it died or took too long.
        """
        deadline = monotonic() + self.config.time_limit + (budget.seconds or 0.0)
        while not receiver.poll(POLL_S):
            stop_if_cancelled()
            if monotonic() > deadline:
                raise BudgetSpentError(
                    f"{self.name} did not answer within {self.config.time_limit:.0f} s "
                    "and was ended"
                )
        try:
            answer: tuple[Floats, int, float] = receiver.recv()
        except EOFError:
            child.join(1.0)
            raise BudgetSpentError(
                f"{self.name} ended without an answer (exit code {child.exitcode})"
            ) from None
        return answer
