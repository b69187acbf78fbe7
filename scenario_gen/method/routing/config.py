# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Settings of the planning stage."""

from dataclasses import dataclass, field
from functools import partial
from typing import Protocol

from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.base.registry import Registry
from scenario_gen.method.routing.search.car_planner import PoseRrtStarConnect, PoseSearchConfig
from scenario_gen.method.routing.search.ompl_planners import OmplConfig, OmplPlanner
from scenario_gen.method.routing.search.planner import Planner


class MakePlanner(Protocol):
    """The function behind a name of the parameter `planner`."""

    def __call__(self, config: "PlanningConfig", /) -> Planner:
        """Return a planner with its own part of the parameters."""
        ...


def make_rrt_star_connect(config: "PlanningConfig") -> Planner:
    """Return the paper's search, from pose to pose for a vehicle."""
    return PoseRrtStarConnect(config.pose)


def _ompl(name: str, config: "PlanningConfig") -> Planner:
    return OmplPlanner(name, config.ompl)


_OMPL_NAMES = ("ompl_rrt_connect", "ompl_rrt_star", "ompl_informed_rrt_star", "ompl_bit_star")
PLANNERS = Registry[MakePlanner](
    "scenario_gen.planners",
    {
        "rrt_star_connect": make_rrt_star_connect,
        **{name: partial(_ompl, name) for name in _OMPL_NAMES},
    },
)
"""The geometric planners by name."""


@dataclass(frozen=True)
class PlanningConfig(Parameters):
    """How routes are planned."""

    planner: str = parameter(
        "rrt_star_connect",
        "geometric planner",
        choices=tuple(PLANNERS.built_in),
        group=PLANNERS.group,
    )
    iterations: int = parameter(
        1000, "iterations of the planner between two anchors", low=1, high=10_000_000
    )
    margin: float = parameter(
        0.3,
        "clearance wanted beside the footprint where the road has it",
        unit="m",
        low=0.0,
        high=5.0,
    )
    spacing: float = parameter(
        0.5, "largest distance between two points of a route", unit="m", low=0.05, high=0.5
    )
    keep_side: float = parameter(
        0.05,
        "cost of a metre driven a metre away from the direct curve between two anchors, three "
        "times as much towards oncoming traffic; 0: no side costs more",
        unit="1/m",
        low=0.0,
        high=10.0,
    )
    traffic_side: str = parameter(
        "right", "the side of the road to keep to", choices=("right", "left")
    )

    oncoming: str = parameter(
        "around_obstacles",
        "use of the oncoming lane: where an obstacle blocks the lanes of a direction, or never",
        choices=("around_obstacles", "never"),
    )

    pose: PoseSearchConfig = field(default_factory=PoseSearchConfig)
    ompl: OmplConfig = field(default_factory=OmplConfig)
