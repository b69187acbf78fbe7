# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""CommonRoad 2020a: one XML file per scenario, with lanelets, obstacles and a planning problem.

Obstacles and the planning problem are posed at the centre of their shape, as the format defines it. Times are whole steps of
`timeStepSize`. The date is that of the template's stamp, so that the same bag gives the same bytes. Without an ego there is a
placeholder problem, for the format's schema demands one; a comment in the file says so.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
import re

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import Floats
from scenario_gen.numerics.curve import Curve
from scenario_gen.output.exchange.cases import Case, Exported
from scenario_gen.output.exchange.config import ExportConfig
from scenario_gen.output.exchange.lanes import LaneMap, SIGN_IDS
from scenario_gen.output.exchange.motion import even_step
from scenario_gen.output.exchange.xml import add, comment, date_of, Element, number, serialized
from scenario_gen.types import DRIVERS, Lane, LaneNetwork, Scenario

OBSTACLES, PROBLEM, INTERSECTION, SIGNS = (
    100_000,
    200_000,
    300_000,
    400_000,
)  # ids from here on; lanelets count from 1
MAX_SPEED = "274"
GOAL_TURN = 0.3  # rad by which an ego may be turned at its goal
AUTHOR = "scenario_gen"
_FOR_ONE = {
    "bicycleLane": frozenset(("bicycle",)),
    "busLane": frozenset(("bus",)),
}  # types of lanelets of one type of users


def benchmark_id(case: Case, exported: Exported) -> str:
    """Return the scenario's name in CommonRoad's manner, which is its file's name too."""
    words = re.findall(r"[0-9A-Za-z]+", case.road_name)
    name = "".join(word[:1].upper() + word[1:] for word in words) or "Road"
    return f"ZAM_{name}-{case.number}_{exported.index + 1}_T-1"


def write_commonroad(
    case: Case, exported: Exported, export: ExportConfig = ExportConfig()
) -> tuple[bytes, tuple[str, ...]]:
    """Return a scenario as the bytes of a CommonRoad file, and sentences on what was changed for it.

    Raises:
        RefusedError: a vehicle arrives late, for which the schema has no form, or the ego does.
    """
    exported.refuse_late_ego()
    scenario, notes = _even(exported.others, export)
    late = [
        v.id
        for v, (first, _) in zip(scenario.vehicles, scenario.present.tolist(), strict=True)
        if first > 0
    ]
    if late and export.late == "refused":
        raise RefusedError(
            f"scenario {exported.index}: vehicle {', '.join(late)} arrives late, and CommonRoad's schema has obstacles "
            "from the first step on only; `--set late=written` writes the step at which it arrives, which commonroad-io "
            "reads; or export it to openscenario or autoware"
        )
    if late:
        notes += (
            f"vehicle {', '.join(late)} arrives late: its initial time step is not 0, which the schema does not allow",
        )
    step = even_step(scenario) or export.step
    root = Element(
        "commonRoad",
        {
            "commonRoadVersion": "2020a",
            "benchmarkID": benchmark_id(case, exported),
            "date": date_of(case.start_ns).partition("T")[0],
            "author": AUTHOR,
            "affiliation": AUTHOR,
            "source": f"scenario {exported.index} of {case.namespace or '/'}, sha256 {exported.sha256}",
            "timeStepSize": f"{step:.9f}".rstrip("0"),
        },
    )
    comment(root, f"lanelets: {case.lane_map.origin}")
    location = add(root, "location")
    add(location, "geoNameId", "-999")  # the format's value for unknown, as 999 below
    add(location, "gpsLatitude", "999")
    add(location, "gpsLongitude", "999")
    tags = add(root, "scenarioTags")
    add(tags, "simulated")
    lane_map = case.lane_map
    if any(map(lane_map.turn, range(len(lane_map.network.lanes)))):
        add(tags, "intersection")
    signs = _signs(lane_map.network)
    for k in range(len(lane_map.network.lanes)):
        _lanelet(root, lane_map, k, [sign for sign in signs if k in sign.lanes])
    for sign in signs:
        _sign(root, sign)
    _intersection(root, lane_map)
    for n, vehicle in enumerate(scenario.vehicles):
        comment(root, f"vehicle {vehicle.id}")
        _obstacle(root, scenario, n)
    if exported.ego is None:
        comment(
            root,
            "a placeholder: nobody is left out of this scenario, and the format demands a planning problem",
        )
        _placeholder(root, lane_map.network.lanes[0], len(scenario.time))
    else:
        comment(root, f"vehicle {exported.ego.vehicles[0].id}")
        _problem(root, exported.ego, step, export)
    return serialized(root), notes


def _even(scenario: Scenario, export: ExportConfig) -> tuple[Scenario, tuple[str, ...]]:
    if even_step(scenario) is not None:
        return scenario, ()
    result = scenario.resampled(export.step)
    lost = float(scenario.time[-1] - result.time[-1])
    return result, (
        f"its uneven instants were resampled at {export.step:g} s; its last {lost:.3f} s are left out",
    )


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
    """A sign or a light: of which lanes, with its number and value; a light has none. `line` (K, 2) [m] is its stop line."""

    id: int
    lanes: frozenset[int]
    number: str
    value: str = ""
    line: Floats = field(default_factory=lambda: np.zeros((0, 2)))

    @property
    def tag(self) -> str:
        """Of an element that refers to it."""
        return "trafficSignRef" if self.number else "trafficLightRef"


def _signs(network: LaneNetwork) -> list[_Sign]:
    """Return the signs of a road, one for each of its speed limits, and its lights."""
    limits: dict[float, set[int]] = {}
    for k, lane in enumerate(network.lanes):
        if lane.speed_limit > 0.0:
            limits.setdefault(lane.speed_limit, set()).add(k)
    found = [
        (frozenset(rule.lanes), SIGN_IDS.get(rule.kind, ""), "", rule.line)
        for rule in network.rules
    ]
    found += [
        (frozenset(lanes), MAX_SPEED, number(limit), np.zeros((0, 2)))
        for limit, lanes in limits.items()
    ]
    return sorted(
        (_Sign(SIGNS + k, *sign) for k, sign in enumerate(found, 1)),
        key=lambda sign: not sign.number,
    )


def _sign(root: Element, sign: _Sign) -> None:
    """Append a sign, or a light that is off: no state of it is known."""
    if sign.number:
        element = add(add(root, "trafficSign", id=sign.id), "trafficSignElement")
        add(element, "trafficSignID", sign.number)
        if sign.value:
            add(element, "additionalValue", sign.value)
        return
    state = add(add(add(root, "trafficLight", id=sign.id), "cycle"), "cycleElement")
    add(state, "duration", 1)
    add(state, "color", "inactive")


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
        for x, y in at_line[0].line[[0, -1]].tolist():
            _point(stop, x, y)
        add(stop, "lineMarking", "solid")
    add(lanelet, "laneletType", "unknown" if lane_map.is_derived(k) else _lanelet_type(lane))
    if lane_map.turn(k):
        add(lanelet, "laneletType", "intersection")
    for user in sorted(lane.users - {"van"}) or ["vehicle"]:  # the format has no vans
        add(lanelet, "userOneWay" if lane.open_to(DRIVERS) else "userBidirectional", user)
    for sign in signs:
        add(lanelet, sign.tag, ref=sign.id)


def _lanelet_type(lane: Lane) -> str:
    """Return the type of a lanelet, by its users."""
    if not lane.open_to(DRIVERS):
        return "crosswalk" if lane.crossing else "sidewalk"
    own = [
        kind
        for kind, users in _FOR_ONE.items()
        if lane.users and not lane.open_to(DRIVERS - users)
    ]
    return own[0] if own else "urban"


def _intersection(root: Element, lane_map: LaneMap) -> None:
    """Say of every strip that leads into the junction where one can go from it."""
    lanes, turn = lane_map.network.lanes, lane_map.turn
    arms = [
        [k for k in side if any(map(turn, lanes[k].successors))]
        for strip in lane_map.strips
        for side in strip
    ]
    arms = [incoming for incoming in arms if incoming]
    if not arms:
        return
    intersection = add(root, "intersection", id=INTERSECTION)
    for n, incoming in enumerate(arms):
        element = add(intersection, "incoming", id=INTERSECTION + 1 + n)
        for k in incoming:
            add(element, "incomingLanelet", ref=k + 1)
        for way in ("right", "straight", "left"):
            for other in (
                other
                for k in incoming
                for other in sorted(lanes[k].successors)
                if turn(other) == way
            ):
                add(element, f"successors{way.title()}", ref=other + 1)


def _exact(parent: Element, tag: str, value: float) -> None:
    add(add(parent, tag), "exact", value)


def _interval(parent: Element, tag: str, low: float, high: float) -> None:
    element = add(parent, tag)
    add(element, "intervalStart", low)
    add(element, "intervalEnd", high)


def _state(parent: Element, tag: str, scenario: Scenario, n: int, k: int) -> Element:
    """Append position, orientation, time, velocity and acceleration of vehicle `n` at instant `k`."""
    state = add(parent, tag)
    _point(add(state, "position"), *scenario.position[n, k].tolist())
    _exact(state, "orientation", float(scenario.heading[n, k]))
    add(add(state, "time"), "exact", k)
    _exact(state, "velocity", float(scenario.speed[n, k]))
    _exact(state, "acceleration", float(scenario.acceleration[n, k]))
    return state


def _obstacle(root: Element, scenario: Scenario, n: int) -> None:
    vehicle = scenario.vehicles[n]
    obstacle = add(root, "dynamicObstacle", id=OBSTACLES + n + 1)
    add(obstacle, "type", vehicle.kind.commonroad)
    rectangle = add(add(obstacle, "shape"), "rectangle")
    add(rectangle, "length", vehicle.length)
    add(rectangle, "width", vehicle.width)
    first, last = scenario.present[n].tolist()
    _state(obstacle, "initialState", scenario, n, first)
    trajectory = add(obstacle, "trajectory")
    for k in range(first + 1, last + 1):
        _state(trajectory, "state", scenario, n, k)


def _problem(root: Element, ego: Scenario, step: float, export: ExportConfig) -> None:
    """Append the ego's problem: from its start to a region about its end, within a wide window of time."""
    problem = add(root, "planningProblem", id=PROBLEM + 1)
    start = _state(problem, "initialState", ego, 0, 0)
    rate = (ego.heading[0, 1] - ego.heading[0, 0]) / (ego.time[1] - ego.time[0])
    _exact(start, "yawRate", float(rate))
    _exact(start, "slipAngle", 0.0)
    end = int(ego.present[0, 1])
    (x, y), yaw = ego.position[0, end].tolist(), float(ego.heading[0, end])
    last = int(np.ceil(export.goal_late * ego.time[end] / step))
    _goal(problem, (x, y, yaw), (export.goal_length, export.goal_width), last)


def _goal(
    problem: Element, pose: tuple[float, float, float], size: tuple[float, float], last: int
) -> None:
    goal = add(problem, "goalState")
    time = add(goal, "time")
    add(time, "intervalStart", 1)
    add(time, "intervalEnd", last)
    x, y, yaw = pose
    yaw = float((yaw + np.pi) % (2.0 * np.pi) - np.pi)
    rectangle = add(add(goal, "position"), "rectangle")
    add(rectangle, "length", size[0])
    add(rectangle, "width", size[1])
    add(rectangle, "orientation", yaw)
    _point(rectangle, x, y, "center")
    _interval(goal, "orientation", yaw - GOAL_TURN, yaw + GOAL_TURN)


def _placeholder(root: Element, lane: Lane, steps: int) -> None:
    """Append a problem that is solved by standing still, near the beginning of the first lane, on its run-out."""
    middle = lane.centre
    at = min(int(np.searchsorted(Curve.through(middle).station, 5.0)), len(middle) - 2)
    yaw = float(lane.yaw[at])
    x, y = middle[at].tolist()
    problem = add(root, "planningProblem", id=PROBLEM)
    state = add(problem, "initialState")
    _point(add(state, "position"), x, y)
    for tag, value in (
        ("velocity", 0.0),
        ("orientation", yaw),
        ("yawRate", 0.0),
        ("slipAngle", 0.0),
    ):
        _exact(state, tag, value)
    add(add(state, "time"), "exact", 0)
    _goal(problem, (x, y, yaw), (1.0, 1.0), max(steps - 1, 1))
