# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""CommonRoad 2020a: one XML file per scenario, with lanelets, obstacles and a planning problem.

Poses of obstacles and of the planning problem refer to the centre of the shape, as the format
defines it. Times are multiples of `timeStepSize`. The date is the date of the template's stamp, so
that the same bag gives the same bytes. Without an ego, the file has a placeholder problem, as the
schema of the format requires one; a comment in the file says so.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
import re

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import Floats
from scenario_gen.numerics.curve import Curve
from scenario_gen.numerics.plane import angle_between
from scenario_gen.output.exchange.cases import (
    Case,
    evenly_sampled,
    Exported,
    scenario_source,
)
from scenario_gen.output.exchange.config import ExportConfig
from scenario_gen.output.exchange.lanes import LaneMap, SIGN_IDS
from scenario_gen.output.exchange.lights import light_of, runs_of_states
from scenario_gen.output.exchange.xml import add, comment, date_of, Element, number, serialized
from scenario_gen.types import (
    DRIVERS,
    Lane,
    LaneNetwork,
    Obstacle,
    Scenario,
    SignalState,
    TrafficLight,
    Vehicle,
)

FIRST_OBSTACLE_ID = 100_000  # the ids of lanelets start from 1
FIRST_PROBLEM_ID = 200_000
FIRST_INTERSECTION_ID = 300_000
FIRST_SIGN_ID = 400_000
FIRST_STATIC_ID = 500_000
MAX_SPEED = "274"
MAX_GOAL_HEADING_ERROR_RAD = 0.3
AUTHOR = "scenario_gen"
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
    root = _header(case, exported, step)
    lane_map = case.lane_map
    signs = _signs(lane_map.network, scenario)
    for k in range(len(lane_map.network.lanes)):
        _lanelet(root, lane_map, k, [sign for sign in signs if k in sign.lanes])
    for sign in signs:
        _sign(root, sign, scenario)
    _intersection(root, lane_map)
    for n, obstacle in enumerate(lane_map.network.obstacles):
        _static_obstacle(root, obstacle, n)
    for n, vehicle in enumerate(scenario.vehicles):
        comment(root, f"vehicle {vehicle.id}")
        _obstacle(root, scenario, n)
    if exported.ego is None:
        comment(
            root,
            "a placeholder: the scenario has no ego, but the format requires a planning problem",
        )
        _placeholder(root, lane_map.network.lanes[0], len(scenario.time))
    else:
        comment(root, f"vehicle {exported.ego.vehicles[0].id}")
        _problem(root, exported.ego, step, export)
    return serialized(root), tuple(notes)


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


def _header(case: Case, exported: Exported, step: float) -> Element:
    """Return the root element with the location and the tags of a scenario."""
    root = Element(
        "commonRoad",
        {
            "commonRoadVersion": "2020a",
            "benchmarkID": benchmark_id(case, exported),
            "date": date_of(case.start_ns).partition("T")[0],
            "author": AUTHOR,
            "affiliation": AUTHOR,
            "source": scenario_source(case, exported),
            "timeStepSize": f"{step:.9f}".rstrip("0"),
        },
    )
    lane_map = case.lane_map
    comment(root, f"lanelets: {lane_map.origin}")
    location = add(root, "location")
    add(location, "geoNameId", "-999")  # the format's value for unknown, as 999 below
    add(location, "gpsLatitude", "999")
    add(location, "gpsLongitude", "999")
    tags = add(root, "scenarioTags")
    add(tags, "simulated")
    if any(map(lane_map.turn, range(len(lane_map.network.lanes)))):
        add(tags, "intersection")
    return root


def _points(parent: Element, tag: str, points: Floats) -> None:
    bound = add(parent, tag)
    for x, y in points.tolist():
        _point(bound, x, y)


def _point(parent: Element, x: float, y: float, tag: str = "point") -> None:
    point = add(parent, tag)
    add(point, "x", x)
    add(point, "y", y)


@dataclass(frozen=True, eq=False)
class _Sign:
    """A sign or a light with its lanes; `line` (K, 2) [m] is its stop line.

    `number` is the traffic sign's number, "" for a light, whose states are `light`'s, if known.
    """

    id: int
    lanes: frozenset[int]
    number: str
    value: str = ""
    line: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    light: TrafficLight | None = None

    @property
    def tag(self) -> str:
        """The tag of an element that refers to the sign."""
        return "trafficSignRef" if self.number else "trafficLightRef"


def _signs(network: LaneNetwork, scenario: Scenario) -> list[_Sign]:
    """Return the signs of a road, one sign per speed limit, and its lights."""
    limits: dict[float, set[int]] = {}
    for k, lane in enumerate(network.lanes):
        if lane.speed_limit > 0.0:
            limits.setdefault(lane.speed_limit, set()).add(k)
    lights = scenario.facts.lights
    signs = []
    for rule in network.rules:
        light = light_of(rule, network, lights)
        line = light.line if light is not None and len(rule.line) else rule.line
        signs.append((frozenset(rule.lanes), SIGN_IDS.get(rule.kind, ""), "", line, light))
    signs += [
        (frozenset(lanes), MAX_SPEED, number(limit), np.zeros((0, 2)), None)
        for limit, lanes in limits.items()
    ]
    return sorted(
        (_Sign(FIRST_SIGN_ID + k, *sign) for k, sign in enumerate(signs, 1)),
        key=lambda sign: not sign.number,
    )


def _sign(root: Element, sign: _Sign, scenario: Scenario) -> None:
    """Append a sign, or a light with its states at the steps; unknown ones are inactive."""
    if sign.number:
        element = add(add(root, "trafficSign", id=sign.id), "trafficSignElement")
        add(element, "trafficSignID", sign.number)
        if sign.value:
            add(element, "additionalValue", sign.value)
        return
    light = add(root, "trafficLight", id=sign.id)
    cycle = add(light, "cycle")
    phases = [(SignalState.OFF, 1)]
    if sign.light is not None:
        phases = runs_of_states(sign.light.schedule, scenario)
    for state, steps in phases:
        element = add(cycle, "cycleElement")
        add(element, "duration", steps)
        add(element, "color", _COLOURS.get(state, "inactive"))
    if len(sign.line):
        _point(add(light, "position"), *sign.line.mean(axis=0).tolist())
    if sign.light is not None and sign.light.turns:
        first, *others = sign.light.turns
        add(light, "direction", first + "".join(map(str.title, others)))


def _lanelet(root: Element, lane_map: LaneMap, k: int, signs: Sequence[_Sign]) -> None:
    lane = lane_map.network.lanes[k]
    lanelet = add(root, "lanelet", id=k + 1)
    _points(lanelet, "leftBound", lane.left)
    _points(lanelet, "rightBound", lane.right)
    for other in sorted(lane_map.network.predecessors[k]):
        add(lanelet, "predecessor", ref=other + 1)
    for other in sorted(lane.successors):
        add(lanelet, "successor", ref=other + 1)
    for side, (other, same) in sorted(lane_map.neighbours(k).items()):
        add(
            lanelet,
            f"adjacent{side.title()}",
            ref=other + 1,
            drivingDir="same" if same else "opposite",
        )
    at_line = [sign for sign in signs if len(sign.line)]
    if at_line:
        stop = add(lanelet, "stopLine")
        line = at_line[-1].line  # lights are last, and the format has one line
        for x, y in line[[0, -1]].tolist():
            _point(stop, x, y)
        add(stop, "lineMarking", "solid")
        for sign in [sign for sign in at_line if np.array_equal(sign.line, line)]:
            add(stop, sign.tag, ref=sign.id)
    add(lanelet, "laneletType", _lanelet_type(lane))
    if lane_map.turn(k):
        add(lanelet, "laneletType", "intersection")
    for user in sorted(lane.users - {"van"}) or ["vehicle"]:  # the format has no vans
        add(lanelet, "userOneWay" if lane.open_to(DRIVERS) else "userBidirectional", user)
    for sign in signs:
        add(lanelet, sign.tag, ref=sign.id)


def _lanelet_type(lane: Lane) -> str:
    """Return the type of a lanelet, from its users."""
    if not lane.open_to(DRIVERS):
        return "crosswalk" if lane.crossing else "sidewalk"
    for kind, users in _EXCLUSIVE_TYPES.items():
        if lane.users and not lane.open_to(DRIVERS - users):
            return kind
    return "urban"


def _intersection(root: Element, lane_map: LaneMap) -> None:
    """Append the intersection with the incoming lanelets of each arm, if there is a junction."""
    lanes = lane_map.network.lanes
    arms = [side for strip in lane_map.strips for side in strip]
    incoming = [[k for k in arm if any(map(lane_map.turn, lanes[k].successors))] for arm in arms]
    incoming = [lanelets for lanelets in incoming if lanelets]
    if not incoming:
        return
    intersection = add(root, "intersection", id=FIRST_INTERSECTION_ID)
    for n, lanelets in enumerate(incoming, 1):
        element = add(intersection, "incoming", id=FIRST_INTERSECTION_ID + n)
        for k in lanelets:
            add(element, "incomingLanelet", ref=k + 1)
        for direction in ("right", "straight", "left"):
            _successors(element, lane_map, direction, lanelets)


def _successors(
    incoming: Element, lane_map: LaneMap, direction: str, lanelets: Sequence[int]
) -> None:
    """Append the successors of an arm's lanelets that turn in one direction."""
    for k in lanelets:
        for successor in sorted(lane_map.network.lanes[k].successors):
            if lane_map.turn(successor) == direction:
                add(incoming, f"successors{direction.title()}", ref=successor + 1)


def _interval(parent: Element, tag: str, low: float, high: float) -> None:
    element = add(parent, tag)
    add(element, "intervalStart", low)
    add(element, "intervalEnd", high)


def _state(parent: Element, tag: str, scenario: Scenario, n: int, k: int) -> Element:
    """Append the state of vehicle `n` at instant `k`."""
    state = add(parent, tag)
    _point(add(state, "position"), *scenario.position[n, k].tolist())
    add(state, "orientation/exact", float(scenario.heading[n, k]))
    add(state, "time/exact", k)
    add(state, "velocity/exact", float(scenario.speed[n, k]))
    add(state, "acceleration/exact", float(scenario.acceleration[n, k]))
    return state


def _static_obstacle(root: Element, standing: Obstacle, n: int) -> None:
    obstacle = add(root, "staticObstacle", id=FIRST_STATIC_ID + n)
    add(obstacle, "type", "parkedVehicle" if standing.is_car else "unknown")
    _rectangle(obstacle, standing)
    state = add(obstacle, "initialState")
    _point(add(state, "position"), standing.x, standing.y)
    add(state, "orientation/exact", standing.yaw)
    add(state, "time/exact", 0)


def _rectangle(obstacle: Element, sized: Vehicle | Obstacle) -> None:
    rectangle = add(obstacle, "shape/rectangle")
    add(rectangle, "length", sized.length)
    add(rectangle, "width", sized.width)


def _obstacle(root: Element, scenario: Scenario, n: int) -> None:
    vehicle = scenario.vehicles[n]
    obstacle = add(root, "dynamicObstacle", id=FIRST_OBSTACLE_ID + n + 1)
    add(obstacle, "type", vehicle.kind.commonroad)
    _rectangle(obstacle, vehicle)
    first, last = scenario.present[n].tolist()
    _state(obstacle, "initialState", scenario, n, first)
    trajectory = add(obstacle, "trajectory")
    for k in range(first + 1, last + 1):
        _state(trajectory, "state", scenario, n, k)


def _problem(root: Element, ego: Scenario, step: float, export: ExportConfig) -> None:
    """Append the ego's planning problem: from its first state to a region around its last one."""
    problem = add(root, "planningProblem", id=FIRST_PROBLEM_ID + 1)
    start = _state(problem, "initialState", ego, 0, 0)
    rate = (ego.heading[0, 1] - ego.heading[0, 0]) / (ego.time[1] - ego.time[0])
    add(start, "yawRate/exact", float(rate))
    add(start, "slipAngle/exact", 0.0)
    end = int(ego.present[0, 1])
    (x, y), yaw = ego.position[0, end].tolist(), float(ego.heading[0, end])
    last = int(np.ceil(export.goal_late * ego.time[end] / step))
    _goal(problem, (x, y, yaw), (export.goal_length, export.goal_width), last)


def _goal(
    problem: Element, pose: tuple[float, float, float], size: tuple[float, float], last: int
) -> None:
    goal = add(problem, "goalState")
    _interval(goal, "time", 1, last)
    x, y, yaw = pose
    yaw = angle_between(yaw, 0.0)
    rectangle = add(goal, "position/rectangle")
    add(rectangle, "length", size[0])
    add(rectangle, "width", size[1])
    add(rectangle, "orientation", yaw)
    _point(rectangle, x, y, "center")
    _interval(
        goal, "orientation", yaw - MAX_GOAL_HEADING_ERROR_RAD, yaw + MAX_GOAL_HEADING_ERROR_RAD
    )


def _placeholder(root: Element, lane: Lane, steps: int) -> None:
    """Append a problem that a stationary vehicle solves, near the start of the first lane."""
    middle = lane.centre
    at = min(int(np.searchsorted(Curve.through(middle).station, 5.0)), len(middle) - 2)
    yaw = float(lane.yaw[at])
    x, y = middle[at].tolist()
    problem = add(root, "planningProblem", id=FIRST_PROBLEM_ID)
    state = add(problem, "initialState")
    _point(add(state, "position"), x, y)
    for tag, value in (
        ("velocity", 0.0),
        ("orientation", yaw),
        ("yawRate", 0.0),
        ("slipAngle", 0.0),
    ):
        add(state, f"{tag}/exact", value)
    add(state, "time/exact", 0)
    _goal(problem, (x, y, yaw), (1.0, 1.0), max(steps - 1, 1))
