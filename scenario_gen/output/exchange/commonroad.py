# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""CommonRoad 2020a: one XML file per scenario, with lanelets, obstacles and a planning problem.

Poses of obstacles and of the planning problem refer to the centre of the shape, as the format
defines it. Times are multiples of `timeStepSize`. The date is the date of the template's stamp, so
that the same bag gives the same bytes. Without an ego, the file has a placeholder problem, as the
schema of the format requires one; a comment in the file says so.
"""

from dataclasses import dataclass
import re
from typing import Any

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import angle_between, Floats
from scenario_gen.numerics.curve import Curve
from scenario_gen.output.exchange.cases import (
    Case,
    evenly_sampled,
    Exported,
    scenario_source,
)
from scenario_gen.output.exchange.config import ExportConfig
from scenario_gen.output.exchange.lanes import LaneMap, SIGN_IDS
from scenario_gen.output.exchange.lights import light_of, runs_of_states
from scenario_gen.output.exchange.xml import date_of, number, rendered
from scenario_gen.types import DRIVERS, Lane, LaneNetwork, Scenario, SignalState

FIRST_SIGN_ID = 400_000
MAX_SPEED = "274"
_COLOURS = {
    SignalState.GREEN: "green",
    SignalState.YELLOW: "yellow",
    SignalState.RED: "red",
    SignalState.RED_YELLOW: "redYellow",
}
_EXCLUSIVE_TYPES = {  # types of lanelets with one type of users
    "bicycleLane": frozenset(("bicycle",)),
    "busLane": frozenset(("bus",)),
}


def benchmark_id(case: Case, exported: Exported) -> str:
    """Return the benchmark id of a scenario, which is also the name of its file."""
    words = re.findall(r"[0-9A-Za-z]+", case.road_name)
    name = "".join(word[:1].upper() + word[1:] for word in words) or "Road"
    return f"ZAM_{name}-{case.number}_{exported.index + 1}_T-1"


def write_commonroad(
    case: Case, exported: Exported, export: ExportConfig = ExportConfig()
) -> tuple[bytes, tuple[str, ...]]:
    """Return a scenario as the bytes of a CommonRoad file, and notes on changes made for it.

    Raises:
        RefusedError: a vehicle arrives late, which the schema does not allow, or the ego does.
    """
    exported.refuse_late_ego()
    scenario = evenly_sampled(exported.others, export.step)
    notes: list[str] = []
    if scenario is not exported.others:
        omitted = float(exported.others.time[-1] - scenario.time[-1])
        notes.append(
            f"uneven time steps were resampled at {export.step:g} s; the last {omitted:.3f} s are "
            "left out"
        )
    notes += _late_arrivals(exported.index, scenario, export)
    step = float(np.round(scenario.time[1] - scenario.time[0], 9))
    lane_map, ego = case.lane_map, exported.ego
    lanes = lane_map.network.lanes
    signs = _signs(lane_map.network, scenario)
    data = rendered(
        "commonroad.xml.j2",
        benchmark_id=benchmark_id(case, exported),
        date=date_of(case.start_ns).partition("T")[0],
        source=scenario_source(case, exported),
        step=f"{step:.9f}".rstrip("0"),
        lane_map=lane_map,
        has_turns=any(map(lane_map.turn, range(len(lanes)))),
        signs=signs,
        signs_of=[[sign for sign in signs if k in sign.lanes] for k in range(len(lanes))],
        intersection_arms=_arms(lane_map),
        scenario=scenario,
        states=_states(scenario),
        ego=ego,
        ego_states=[] if ego is None else _states(ego)[0],
        goal=_near(lanes[0], len(scenario.time)) if ego is None else _goal(ego, step, export),
        lanelet_type=_lanelet_type,
        is_driven=lambda lane: lane.open_to(DRIVERS),
        angle_between=angle_between,
    )
    return data, tuple(notes)


def _late_arrivals(index: int, scenario: Scenario, export: ExportConfig) -> list[str]:
    """Return a note on vehicles that arrive late.

    Raises:
        RefusedError: a vehicle arrives late, and `export.late` refuses that.
    """
    late_ids = [
        vehicle.id
        for vehicle, first in zip(scenario.vehicles, scenario.present[:, 0], strict=True)
        if first > 0
    ]
    if not late_ids:
        return []
    vehicles = f"vehicle {', '.join(late_ids)} arrives late"
    if export.late == "refused":
        raise RefusedError(
            f"scenario {index}: {vehicles}, but CommonRoad's schema requires obstacles from the "
            "first step; `--set late=written` writes the step of its arrival, which commonroad-io "
            "reads; or export to openscenario or autoware"
        )
    return [f"{vehicles}: its initial time step is not 0, which the schema does not allow"]


@dataclass(frozen=True, eq=False)
class _Sign:
    """A sign or a light with its lanes.

    Attributes:
        id: in the file.
        lanes: of the network.
        number: the traffic sign's number, "" for a light.
        value: of a speed limit.
        line: (K, 2) stop line [m], or (0, 2).
        phases: colours of a light, each with its number of steps; an unknown one is inactive.
        turns: to which a light applies.
    """

    id: int
    lanes: frozenset[int]
    number: str
    value: str
    line: Floats
    phases: tuple[tuple[str, int], ...] = ()
    turns: tuple[str, ...] = ()

    @property
    def has_line(self) -> bool:
        """Whether it has a stop line."""
        return len(self.line) > 0


def _signs(network: LaneNetwork, scenario: Scenario) -> list[_Sign]:
    """Return the signs of a road, one sign per speed limit, and its lights."""
    signs: list[tuple[Any, ...]] = []
    for rule in network.rules:
        light = light_of(rule, network, scenario.facts.lights)
        line = rule.line
        turns: tuple[str, ...] = ()
        phases = [(SignalState.OFF, 1)]
        if light is not None:
            line = light.line if len(rule.line) else rule.line
            phases = runs_of_states(light.schedule, scenario)
            turns = light.turns
        colours = tuple((_COLOURS.get(state, "inactive"), steps) for state, steps in phases)
        kind = SIGN_IDS.get(rule.kind, "")
        signs.append((frozenset(rule.lanes), kind, "", line, colours, turns))
    limits: dict[float, set[int]] = {}
    for k, lane in enumerate(network.lanes):
        if lane.speed_limit > 0.0:
            limits.setdefault(lane.speed_limit, set()).add(k)
    signs += [
        (frozenset(lanes), MAX_SPEED, number(limit), np.zeros((0, 2)))
        for limit, lanes in limits.items()
    ]
    return sorted(
        (_Sign(FIRST_SIGN_ID + k, *sign) for k, sign in enumerate(signs, 1)),
        key=lambda sign: not sign.number,
    )


def _lanelet_type(lane: Lane) -> str:
    """Return the type of a lanelet, from its users."""
    if not lane.open_to(DRIVERS):
        return "crosswalk" if lane.crossing else "sidewalk"
    for kind, users in _EXCLUSIVE_TYPES.items():
        if lane.users and not lane.open_to(DRIVERS - users):
            return kind
    return "urban"


def _arms(lane_map: LaneMap) -> list[list[int]]:
    """Return the incoming lanes of each arm of a junction, if there is one."""
    lanes = lane_map.network.lanes
    arms = [side for strip in lane_map.strips for side in strip]
    incoming = [[k for k in arm if any(map(lane_map.turn, lanes[k].successors))] for arm in arms]
    return [arm for arm in incoming if arm]


def _states(scenario: Scenario) -> list[Any]:
    """Return of each vehicle and instant x, y [m], yaw [rad], speed [m/s], acceleration [m/s²]."""
    motion = (scenario.heading, scenario.speed, scenario.acceleration)
    states = np.concatenate((scenario.position, np.stack(motion, axis=-1)), axis=-1)
    return list(states.tolist())


def _goal(ego: Scenario, step: float, export: ExportConfig) -> dict[str, Any]:
    """Return the goal of the ego's planning problem: a region around its last state."""
    end = int(ego.present[0, 1])
    return {
        "pose": (*ego.position[0, end].tolist(), float(ego.heading[0, end])),
        "size": (export.goal_length, export.goal_width),
        "last": int(np.ceil(export.goal_late * ego.time[end] / step)),
        "yaw_rate": float((ego.heading[0, 1] - ego.heading[0, 0]) / (ego.time[1] - ego.time[0])),
    }


def _near(lane: Lane, steps: int) -> dict[str, Any]:
    """Return a goal that a stationary vehicle has reached, near the start of a lane."""
    middle = lane.centre
    at = min(int(np.searchsorted(Curve.through(middle).station, 5.0)), len(middle) - 2)
    pose = (*middle[at].tolist(), float(lane.yaw[at]))
    return {"pose": pose, "size": (1.0, 1.0), "last": max(steps - 1, 1)}
