# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Roads drawn from a plan: their lanes and paved ground, arm by arm and route by route.

An arm has its lanes from its end to its mouth, where the road grows wider than the lanes or a
vehicle begins to turn. A route through the junction is the one that the road is drawn for, or else
the clothoid that routes are made of. Where it bends, its lane is wider, as far as the road is.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import permutations

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import angle_between, Floats, unit
from scenario_gen.numerics.curve import Curve
from scenario_gen.roads.config import RoadConfig
from scenario_gen.roads.lights import arm_lights
from scenario_gen.roads.pavement import drivable_width, inside, paved, ring, strip, swept
from scenario_gen.roads.plan import Connection, lane_id, Plan
from scenario_gen.roads.vector.ground import road_of, VERGE_M
from scenario_gen.roads.ways import draw_route, MAX_CAR_CURVATURE_PER_M, reverse
from scenario_gen.types import Lane, LaneNetwork, Road, RuleKind, TrafficRule

_KERB_M = 1e-3  # by which a kerb may lie inside the centre of a drivable cell
_ARM_STEP_M = 1.0  # between cross-sections of arms
_ROUTE_STEP_M = 0.5  # between cross-sections of routes
_BEFORE_MOUTH_M = 1.0  # between a mouth and the place where the road is wider
_WIDER_THAN_LANES_M = 0.3
_LOOKUP_STEP_M = 0.2  # between places where the road's width is looked up
_MIN_ARM_LANES_M = 0.5
_MAX_TURN_RAD = np.radians(150.0)  # of a route that is not driven
_MIN_BEND_RAD = np.radians(10.0)  # of a route that is wider than its lanes
_MAX_WIDENING_M = 1.0  # of a bent route, on each side
_BENT_RAD = np.radians(0.1)
_CROSSING_DISTANCES_M = (1.0, 5.0)  # from the mouth of an arm to its crossing
_CYCLIST = frozenset(("bicycle",))
_MAX_CYCLIST_CURVATURE_PER_M = 0.35
_RING_MARGIN_M = 0.5  # on each side of a roundabout's lane


def draw_plan(plan: Plan, name: str, config: RoadConfig) -> Road:
    """Return a road with its lanes and the grid of its paved ground and a verge.

    Args:
        plan: its arms, in metres.
        name: of the road.
        config: lane width, resolution, traffic side, corner radius.

    Raises:
        RefusedError: it has more cells than are allowed, or cannot have cycle lanes.
    """
    if config.cycle_lane and (plan.ring or plan.has_ramp):
        raise RefusedError(f"road {name} has no cycle lanes; unset road.cycle_lane")
    drawing = _RoadDrawing(plan, config)
    other_lanes = drawing.other_lanes()
    network = LaneNetwork(
        name,
        tuple(drawing.lanes),
        plan.notes,
        rules=tuple(drawing.rules()),
        rules_kept=config.traffic_rules == "kept",
        drawn=True,
        drawn_for=plan.drawn_for,
    ).with_lanes((*drawing.lanes, *other_lanes))
    outlines = [shapely.MultiPoint(lane.outline) for lane in other_lanes]
    box = np.reshape(shapely.total_bounds([drawing.surface, *outlines]), (2, 2))
    kerb = plan.arms[0].inward * config.lane_width  # lies on the edges of cells
    beyond = (VERGE_M - box[0] - kerb) / config.resolution
    box[1] += VERGE_M
    box[0] = -kerb - config.resolution * np.ceil(beyond - 1e-6)
    low = box[0]
    surface = shapely.transform(drawing.surface, lambda points: points - low)
    return draw_lanes(network.moved(-low), surface, config, box - low)


def draw_lanes(
    network: LaneNetwork, surface: BaseGeometry, config: RoadConfig, box: Floats | None = None
) -> Road:
    """Return the road of lanes and a paved surface [m].

    The grid covers `box`, or the surface and a verge.

    Raises:
        RefusedError: it has more cells than are allowed.
    """
    if box is None:
        box = np.reshape(surface.bounds, (2, 2)) + np.array([[-VERGE_M], [VERGE_M]])
    return road_of(network, box, config, surface.buffer(_KERB_M, join_style="mitre"))


class _RoadDrawing:
    """The lanes of a planned road.

    Attributes:
        lanes: those for cars, the lanes of arms first.
        surface: the paved ground [m].
    """

    def __init__(self, plan: Plan, config: RoadConfig) -> None:
        self.lanes: list[Lane] = []
        self._plan = plan
        self._config = config
        self._width = config.lane_width
        # Lanes inward lie to the right of the dividing line (1) or to its left (-1).
        self._sign = 1.0 if config.traffic_side == "right" else -1.0
        self._lines = [
            arm.line.cut(0.0, arm.line.length - plan.ring, _ARM_STEP_M) for arm in plan.arms
        ]
        has_corners = plan.has_junction and not plan.ring and not plan.has_ramp
        self._corner_radius = config.corner_radius if has_corners else 0.0
        self.surface = paved(self._paved_pieces(), self._corner_radius)
        self._drivable = inside(self.surface)
        self._driven = {
            Connection(*route.connection): route.curve for route in reversed(plan.driven)
        }
        self._mouths = self._find_mouths()
        if plan.has_junction:
            self._add_routes_between_ends()
            self._mouths = self._find_mouths()
        self._lane_index: dict[tuple[int, bool, int], int] = {}  # by arm, inward, and number
        self._arm_of_route: dict[int, int] = {}  # the arm that each route's lane comes from
        for k in range(len(plan.arms)):
            self._add_arm_lanes(k, inward=True)
            self._add_arm_lanes(k, inward=False)
        if plan.has_junction:
            self._add_routes()

    def rules(self) -> Iterator[TrafficRule]:
        """Yield the signs at the mouths of arms: to stop, or to give way to other traffic."""
        priority, plan = self._config.priority, self._plan
        if not plan.has_junction or priority == "none":
            return
        lit = ("signals", "auto") if plan.lights else ("signals",)
        signals = priority in lit and not plan.ring
        all_stop = priority == "all_way_stop" and not plan.ring and not plan.has_ramp
        for arm in range(len(self._plan.arms)):
            lanes = self._lanes_inward(arm)
            if not lanes:
                continue
            name = f"arm {arm + 1}"
            line = self._stop_line(arm, lanes)
            if signals:
                recorded = [self._plan.lights.get((arm, n)) for n in range(len(lanes))]
                axis = self._lines[arm]
                yield from arm_lights(name, lanes, recorded, line, axis, self._config)
            elif all_stop:
                yield TrafficRule(name, RuleKind.STOP, lanes, (), line)
            elif arm in self._plan.yielding:
                yield TrafficRule(name, RuleKind.GIVE_WAY, lanes, self._lanes_before(arm), line)

    def _lanes_inward(self, arm: int) -> tuple[int, ...]:
        count = self._plan.arms[arm].inward
        return tuple(self._lane_index[arm, True, n] for n in range(count))

    def _lanes_before(self, yielding: int) -> tuple[int, ...]:
        """Return the lanes whose traffic goes before that of a yielding arm."""
        if self._plan.ring:
            return tuple(k for k, arm in self._arm_of_route.items() if arm != yielding)
        arms = [arm for arm in range(len(self._plan.arms)) if arm not in self._plan.yielding]
        return tuple(k for arm in arms for k in self._lanes_inward(arm))

    def _stop_line(self, arm: int, lanes: tuple[int, ...]) -> Floats:
        """Return the line (2, 2) [m] across some lanes at the mouth of an arm."""
        first, last = self.lanes[lanes[0]], self.lanes[lanes[-1]]
        ends = (first.left, last.right) if self._sign > 0.0 else (first.right, last.left)
        line = np.stack((ends[0][-1], ends[1][-1]))
        if self._config.crossing != "none":
            yaw = float(self._lines[arm].at(np.array([self._mouths[arm]]))[0, 2])
            line -= (_CROSSING_DISTANCES_M[1] + _BEFORE_MOUTH_M) * unit(yaw)
        return line

    def other_lanes(self) -> list[Lane]:
        """Return cycle lanes and crossings; their indices continue those of the car lanes."""
        others = self._cycle_lanes() if self._config.cycle_lane else []
        if self._config.crossing != "none":
            others += [self._crossing(k) for k in range(len(self._lines))]
        return others

    def _cycle_lanes(self) -> list[Lane]:
        lanes: list[Lane] = []
        index: dict[tuple[int, bool], int] = {}
        for k in range(len(self._lines)):
            for inward in (True, False):
                count = self._lane_count(k, inward=inward)
                inner = count * self._width
                index[k, inward] = len(lanes)
                offsets = inner, inner + self._config.cycle_lane
                lane = self._arm_lane(k, count, offsets, inward=inward)
                lanes.append(replace(lane, users=_CYCLIST))
        if not self._plan.has_junction:
            return lanes
        first = len(self.lanes)
        widening = (self._config.cycle_lane - self._width) / 2.0
        for a, b in permutations(range(len(self._plan.arms)), 2):
            route = self._cycle_route(a, b)
            if route is not None:
                start, goal = index[a, True], index[b, False]
                lane = self._lane_along(route, lanes[start], lanes[goal], widening)
                successors = (*lanes[start].successors, first + len(lanes))
                lanes[start] = replace(lanes[start], successors=successors)
                lanes.append(replace(lane, successors=(first + goal,), users=_CYCLIST))
        return lanes

    def _cycle_route(self, a: int, b: int) -> Curve | None:
        """Return the route between the cycle lanes of two arms; None if it is too sharp."""
        counts = self._plan.arms[a].inward, self._plan.arms[b].outward
        start, goal = (count * self._width + self._config.cycle_lane / 2.0 for count in counts)
        return self._clothoid(a, start, b, goal, _MAX_CYCLIST_CURVATURE_PER_M)

    def _crossing(self, k: int) -> Lane:
        """Return the crossing before the mouth of an arm, or in the middle of a road through."""
        line = self._lines[k]
        if self._plan.has_junction:
            near, far = (max(self._mouths[k] - m, 0.0) for m in _CROSSING_DISTANCES_M)
            stations = far, near
        else:
            stations = middle_stations(line)
        counts = [self._lane_count(k, inward=inward) for inward in (True, False)]
        inward, outward = (count * self._width + self._config.cycle_lane for count in counts)
        reach = (inward, outward) if self._sign > 0.0 else (outward, inward)
        return crossing_lane(f"crossing {k + 1}", line, stations, reach)

    def _lane_count(self, arm: int, *, inward: bool) -> int:
        return self._plan.arms[arm].inward if inward else self._plan.arms[arm].outward

    def _add_arm_lanes(self, k: int, *, inward: bool) -> None:
        count, first = self._lane_count(k, inward=inward), len(self.lanes)
        for n in range(count):
            neighbours = tuple(first + m for m in (n - 1, n + 1) if 0 <= m < count)
            self._lane_index[k, inward, n] = first + n
            inner, outer = self._width * n, self._width * (n + 1)
            lane = self._arm_lane(k, n, (inner, outer), inward=inward)
            self.lanes.append(replace(lane, neighbours=neighbours))

    def _arm_lane(self, k: int, n: int, offsets: tuple[float, float], *, inward: bool) -> Lane:
        """Return lane n of an arm between offsets [m] from its dividing line."""
        line = self._lines[k].cut(0.0, self._mouths[k], _ARM_STEP_M)
        side = -self._sign if inward else self._sign
        borders = [line.at_offset(line.station, side * offset)[:, :2] for offset in offsets]
        left, right = (border if inward else border[::-1] for border in borders)
        if self._sign < 0.0:
            left, right = right, left
        return Lane(lane_id(k, n, inward=inward), left, right, arm=k + 1, inward=inward)

    def _add_routes(self) -> None:
        """Add the lanes through the junction, and the ground that they need."""
        routes = self._routes()
        arm_lanes = list(self.lanes)
        ends = {
            connection: (
                self._lane_index[connection.from_arm, True, connection.from_lane],
                self._lane_index[connection.to_arm, False, connection.to_lane],
            )
            for connection in routes
        }
        narrow = []
        for connection, route in routes.items():
            start, goal = ends[connection]
            narrow.append(self._lane_along(route, arm_lanes[start], arm_lanes[goal], 0.0))
        outlines = shapely.make_valid([shapely.Polygon(lane.outline) for lane in narrow])
        self.surface = paved([self.surface, *outlines], self._corner_radius)
        self._drivable = inside(self.surface)
        for connection, route in routes.items():
            start, goal = ends[connection]
            number = len(self.lanes)
            lane = self._lane_along(
                route, arm_lanes[start], arm_lanes[goal], self._widening(route)
            )
            self.lanes.append(replace(lane, successors=(goal,)))
            self._arm_of_route[number] = connection.from_arm
            successors = (*self.lanes[start].successors, number)
            self.lanes[start] = replace(self.lanes[start], successors=successors)

    def _paved_pieces(self) -> Iterator[BaseGeometry]:
        """Yield the arms, the ring, and the ground that recorded vehicles sweep."""
        for arm, line in zip(self._plan.arms, self._lines, strict=True):
            counts = arm.inward, arm.outward
            right, left = counts if self._sign > 0.0 else counts[::-1]
            yield strip(line, -right * self._width, left * self._width)
        if self._plan.ring:
            yield ring(self._plan.ring, self._width / 2.0 + _RING_MARGIN_M)
        for route in self._plan.driven:
            from_arm, _, to_arm, _ = route.connection
            if not self._plan.ring or from_arm == to_arm:  # the ring has all other routes
                half = route.length / 2.0
                inner = route.curve.cut(half, route.curve.length - half)
                yield swept(inner, route.length, route.width, route.trailer)

    def _find_mouths(self) -> list[float]:
        """Return how far [m] from its end each arm has its lanes."""
        if not self._plan.has_junction:
            return [line.length for line in self._lines]
        return [self._mouth(k) for k in range(len(self._lines))]

    def _mouth(self, k: int) -> float:
        arm, line = self._plan.arms[k], self._lines[k]
        along = np.arange(0.0, line.length, _LOOKUP_STEP_M)
        wider = np.zeros(len(along), dtype=np.bool_)
        for side, count in ((-self._sign, arm.inward), (self._sign, arm.outward)):
            edge = side * (count * self._width + _WIDER_THAN_LANES_M)
            wider |= self._drivable(line.at_offset(along, edge)[:, :2])
        mouth = float(along[int(np.argmax(wider))]) if wider.any() else line.length
        for connection, route in self._driven.items():
            if connection.from_arm == k:
                mouth = min(mouth, _straight_length(route))
            if connection.to_arm == k:
                mouth = min(mouth, _straight_length(route.reversed()))
        return max(mouth - _BEFORE_MOUTH_M, _MIN_ARM_LANES_M)

    def _straight_connections(self) -> Iterator[Connection]:
        """Yield the connection of each lane with the same lane of each other arm.

        Lanes from a ramp count from the outside.
        """
        arms = self._plan.arms
        for a, b in permutations(range(len(arms)), 2):
            shift = 0 if arms[a].outward else arms[b].outward - arms[a].inward
            for i in range(arms[a].inward):
                if 0 <= i + shift < arms[b].outward:
                    yield Connection(a, i, b, i + shift)

    def _routes(self) -> dict[Connection, Curve]:
        """Return the driven routes, the straight ones, and those of lanes without a route."""
        routes: dict[Connection, Curve] = {}
        self._add_possible(routes, (*self._driven, *self._straight_connections()))
        for a, b in permutations(range(len(self._plan.arms)), 2):
            self._add_possible(routes, self._missing_connections(routes, a, b))
        return routes

    def _missing_connections(
        self, routes: Iterable[Connection], a: int, b: int
    ) -> list[Connection]:
        """Return connections of two arms for the lanes that no route joins."""
        inward, outward = self._plan.arms[a].inward, self._plan.arms[b].outward
        if not inward or not outward:
            return []
        starts = {(route.from_arm, route.from_lane) for route in routes}
        goals = {(route.to_arm, route.to_lane) for route in routes}
        missing = [Connection(a, i, b, outward - 1) for i in range(inward) if (a, i) not in starts]
        missing += [Connection(a, inward - 1, b, j) for j in range(outward) if (b, j) not in goals]
        return missing

    def _add_possible(
        self, routes: dict[Connection, Curve], connections: Iterable[Connection]
    ) -> None:
        """Add the routes of connections, if cars can drive them."""
        for connection in dict.fromkeys(connections):
            route = self._route(connection)
            if route is not None:
                routes[connection] = route

    def _add_routes_between_ends(self) -> None:
        """Add straight routes whose mouths are too near to each other as driven ones."""
        arms, config = self._plan.arms, self._config
        for connection in self._straight_connections():
            if self._route(connection) is None:
                a, i, b, j = connection
                start = arms[a].lane(i, config, inward=True)
                route = _possible_route(start, arms[b].lane(j, config, inward=False))
                if route is not None:
                    self._driven[connection] = route

    def _route(self, connection: Connection) -> Curve | None:
        """Return the route between two lanes at their mouths; None if cars cannot drive it."""
        a, i, b, j = connection
        driven = self._driven.get(connection)
        if driven is not None:
            return driven.cut(self._mouths[a], driven.length - self._mouths[b], _ROUTE_STEP_M)
        return self._clothoid(a, (i + 0.5) * self._width, b, (j + 0.5) * self._width)

    def _clothoid(
        self,
        a: int,
        start_offset: float,
        b: int,
        goal_offset: float,
        max_curvature: float = MAX_CAR_CURVATURE_PER_M,
    ) -> Curve | None:
        """Return the route between the mouths of two arms, with offsets [m] from their lines."""
        at_a, at_b = np.array([self._mouths[a]]), np.array([self._mouths[b]])
        start = self._lines[a].at_offset(at_a, -self._sign * start_offset)[0]
        goal = reverse(self._lines[b].at_offset(at_b, self._sign * goal_offset)[0])
        route = _possible_route(start, goal, max_curvature)
        return None if route is None else route.cut(0.0, route.length, _ROUTE_STEP_M)

    def _widening(self, route: Curve) -> Floats | float:
        """Return how far [m] the borders of a route may lie outside of its lanes, (M,).

        A bent route is as wide as the road allows.
        """
        if np.ptp(route.points[:, 2]) <= _MIN_BEND_RAD:
            return 0.0
        swell = np.square(np.sin(np.pi * route.station / route.length))
        half = self._width / 2.0
        left, right = (
            drivable_width(
                self._drivable, route, side, half + _MAX_WIDENING_M, _LOOKUP_STEP_M / 2.0
            )
            for side in (1.0, -1.0)
        )
        inner = swell > 0.1  # near its ends it is not wider
        free = np.minimum(left, right)[inner] - half + _LOOKUP_STEP_M
        return np.asarray(swell * float(np.clip(free / swell[inner], 0.0, _MAX_WIDENING_M).min()))

    def _lane_along(self, route: Curve, start: Lane, goal: Lane, widening: Floats | float) -> Lane:
        """Return the lane along a route, whose borders join those of two lanes."""
        share = (route.station / route.length)[:, None]
        half = self._width / 2.0 + widening

        def border(side: float, begin: Floats, end: Floats) -> Floats:
            line = route.at_offset(route.station, side * half)[:, :2]
            line = line + (1.0 - share) * (begin - line[0]) + share * (end - line[-1])
            line[[0, -1]] = begin, end
            return np.asarray(line)

        left = border(1.0, start.left[-1], goal.left[0])
        right = border(-1.0, start.right[-1], goal.right[0])
        return Lane(f"{start.id}>{goal.id}", left, right, junction="1")


def _possible_route(
    start: Floats, goal: Floats, max_curvature: float = MAX_CAR_CURVATURE_PER_M
) -> Curve | None:
    """Return the route between two poses (3,); None if it is too sharp."""
    if abs(angle_between(goal[2], start[2])) > _MAX_TURN_RAD:
        return None
    return draw_route(start, goal, max_curvature=max_curvature)


def _straight_length(route: Curve) -> float:
    """Return how far [m] a route goes before it bends; infinite if it does not."""
    bent = np.abs(route.points[:, 2] - route.points[0, 2]) > _BENT_RAD
    first = int(np.argmax(bent))
    if not bent.any():
        return np.inf
    # A long edge is straight up to the bend at its end.
    return float(max(route.station[max(first - 1, 0)], route.station[first] - _ARM_STEP_M))


def middle_stations(line: Curve) -> tuple[float, float]:
    """Return the stations [m] between which a crossing in the middle of a line lies."""
    half = (_CROSSING_DISTANCES_M[1] - _CROSSING_DISTANCES_M[0]) / 2.0
    return line.length / 2.0 - half, line.length / 2.0 + half


def crossing_lane(
    name: str, line: Curve, stations: tuple[float, float], reach: tuple[float, float]
) -> Lane:
    """Return the crossing between two stations [m], with a reach [m] to the right and left."""
    offsets = np.array([-reach[0], reach[1]])
    behind, ahead = (line.at_offset(np.full(2, station), offsets)[:, :2] for station in stations)
    return Lane(name, behind, ahead, users=frozenset(("pedestrian",)), crossing=True)
