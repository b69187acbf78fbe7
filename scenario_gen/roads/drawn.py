# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A road that is drawn: its arms, the lanes along them and from lane to lane through the junction, and the grid of all that.

An arm has its lanes from its end to its mouth, where the road grows wider than the lanes or somebody begins to turn. A way that
the template drives is the one that the road was drawn for, another one the clothoid that routes are made of; where it bends it is
wider than a lane, as far as the road is.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, permutations

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import Floats
from scenario_gen.numerics.curve import Curve
from scenario_gen.numerics.plane import angle_between, place, unit, unit_left
from scenario_gen.roads.config import RoadConfig
from scenario_gen.roads.pavement import drivable_beside, Inside, inside, paved, ring, strip, swept
from scenario_gen.roads.vector.raster import road_of
from scenario_gen.roads.ways import draw_route, reverse, TIGHTEST
from scenario_gen.situation import Track
from scenario_gen.types import (
    DrawnFor,
    Lane,
    LaneNetwork,
    Note,
    Road,
    RuleKind,
    TrafficRule,
)

Way = tuple[int, int, int, int]
"""Arm and lane that a way comes from, arm and lane that it leads to; lanes count from the dividing line."""

_STEP_M, _WAY_STEP_M = 1.0, 0.5  # between cross-sections, of arms and of ways
_VERGE_M = 2.0  # of the grid around what is paved, at least
_KERB_M = 1e-3  # by which a kerb may lie inside the middle of a cell that is drivable
_BEFORE_M = 1.0  # that a mouth lies before the place where the road is wider
_WIDER_THAN_LANES_M = 0.3
_LOOK_M = 0.2  # between the places along an arm where it is looked how wide the road is
_SHORTEST_M = 0.5  # of an arm
_TURN_BACK = np.radians(150.0)  # a way that turns by more is none but for who drives it
_STRAIGHT_ON = np.radians(10.0)  # a way that turns by less is no wider than its lanes
_WIDER_M = 1.0  # by which each border of a bent way lies outside at most
_INNER = 0.1  # of the most by which a bent way is wider, from which on it is looked whether the road is, too
_BENT = np.radians(0.1)
_CROSSING_M = (1.0, 5.0)  # least and most before the mouth of an arm
_CYCLISTS = frozenset(("bicycle",))
_CYCLISTS_SHARPEST = 0.35  # 1/m
_RING_ROOM_M = 0.5  # that a roundabout's lane is wider on each side


@dataclass(frozen=True, eq=False)
class Arm:
    """The end (3,) of an arm's dividing line, heading out, and its numbers of lanes in and out."""

    pose: Floats
    inward: int
    outward: int

    @classmethod
    def towards(cls, yaw: float, reach: float, lanes: int, aside: float = 0.0) -> "Arm":
        """The arm that leads from the origin in a direction [rad], `reach` metres long, its dividing line `aside` to the left."""
        return cls(np.array([*(reach * unit(yaw) + aside * unit_left(yaw)), yaw]), lanes, lanes)

    @classmethod
    def ramp(cls, entry: Floats, config: RoadConfig) -> "Arm":
        """The arm of one lane, by which nobody leaves, whose traffic comes in at a pose (3,)."""
        out = reverse(entry)
        aside = 0.5 * config.lane_width * (1.0 if config.traffic_side == "right" else -1.0)
        return cls(np.array([*(out[:2] - aside * unit_left(out[2])), out[2]]), 1, 0)

    def lane(self, k: int, config: RoadConfig, *, inward: bool) -> Floats:
        """The pose (3,) [m, m, rad] of lane k, counted from the dividing line, heading as its traffic does."""
        left = (
            (k + 0.5)
            * config.lane_width
            * (1.0 if inward == (config.traffic_side == "right") else -1.0)
        )
        yaw = self.pose[2]
        return np.array([*(self.pose[:2] + left * unit_left(yaw)), yaw + np.pi if inward else yaw])


@dataclass(frozen=True, eq=False)
class Driven:
    """A way through the junction that a road is drawn for, from the end of one lane to that of another.

    Attributes:
        places: the lanes.
        curve: the way.
        length: metres of the vehicle that drives it.
        width: metres that it needs.
    """

    places: Way
    curve: Curve
    length: float
    width: float


@dataclass(frozen=True, eq=False)
class Plan:
    """What is known of a road when it is drawn; its arms lead away from the origin.

    Attributes:
        arms: its arms; one by which nobody leaves is a ramp.
        axis: the dividing line from the end of the first arm to that of the second; None: these are arms as the others.
        driven: ways through the junction.
        ring: radius [m] of the lane of a roundabout about the origin; 0: it is none.
        yielding: the arms that give way, if priorities are shown.
        drawn_for: where the template that it is drawn for lies, about the same origin.
        notes: what was decided.
    """

    arms: Sequence[Arm]
    axis: Curve | None = None
    driven: Sequence[Driven] = ()
    ring: float = 0.0
    yielding: Collection[int] = ()
    drawn_for: DrawnFor | None = None
    notes: tuple[Note, ...] = ()


def lane_id(arm: int, lane: int, *, inward: bool) -> str:
    """The id of lane `lane`, counted from the dividing line, of an arm."""
    return f"{arm + 1}.{-lane - 1 if inward else lane + 1}"


def aligned(
    tracks: Sequence[Track],
    lane_of: Mapping[tuple[int, bool], tuple[int, int]],
    pose: Floats,
    at: Floats,
) -> DrawnFor | None:
    """Where the template of a road lies of which a pose (3,) in its own frame is one on the road; None without a template.

    Args:
        tracks: the template's.
        lane_of: arm and lane of the ends of its tracks, as far as they are known, by vehicle and whether it comes in.
        pose: x, y [m], yaw [rad] in the template's frame.
        at: the same on the road, about the plan's origin.
    """
    turn = at[2] - pose[2]
    ids = {key: lane_id(*place, inward=key[1]) for key, place in lane_of.items()}
    lanes = tuple((ids.get((i, True), ""), ids.get((i, False), "")) for i in range(len(tracks)))
    moved = place(np.array([*at[:2], turn]), -pose[0], -pose[1])
    return DrawnFor(np.array([*moved, turn]), lanes) if tracks else None


def draw_plan(plan: Plan, name: str, config: RoadConfig, box: Floats | None = None) -> Road:
    """Return a road with its lanes, and the grid of what is paved.

    Args:
        plan: its arms, in metres.
        name: of the road.
        config: lane width, resolution, traffic side, radius of corners.
        box: (2, 2) [m] lowest and highest x, y of the grid, of which the lowest become 0; None: all and a verge.

    Raises:
        RefusedError: it has more cells than are allowed, or cannot have cycle lanes.
    """
    if config.cycle_lane and (plan.ring or not all(arm.outward for arm in plan.arms)):
        raise RefusedError(
            f"road {name} is drawn without cycle lanes; unset road.cycle_lane, or choose another road"
        )
    drawing = _Drawing(plan, config)
    lanes, surface = drawing.drawn()
    others = drawing.others(lanes)
    network = LaneNetwork(
        name,
        lanes,
        plan.notes,
        rules=tuple(drawing.rules(lanes)),
        rules_kept=config.traffic_rules == "kept",
        drawn=True,
        drawn_for=plan.drawn_for,
    ).with_lanes((*lanes, *others))
    if box is None:
        whole = [surface, *(shapely.MultiPoint(lane.outline) for lane in others)]
        box = np.reshape(shapely.total_bounds(whole), (2, 2)) + np.array([[-_VERGE_M], [_VERGE_M]])
        box[0] = np.floor(box[0])
    low = box[0]
    return draw_lanes(
        network.moved(-low),
        shapely.transform(surface, lambda points: points - low),
        config,
        box - low,
    )


def draw_lanes(
    network: LaneNetwork, surface: BaseGeometry, config: RoadConfig, box: Floats | None = None
) -> Road:
    """Return the road of lanes and of what is paved about them, in metres; `box` of its grid, or all and a verge.

    Raises:
        RefusedError: it has more cells than are allowed.
    """
    if box is None:
        box = np.reshape(surface.bounds, (2, 2)) + np.array([[-_VERGE_M], [_VERGE_M]])
    whole = surface.buffer(_KERB_M, join_style="mitre")
    return road_of(network, box, config, whole)


class _Drawing:
    """The lanes of a road, arm by arm and way by way."""

    def __init__(self, plan: Plan, config: RoadConfig) -> None:
        self._plan, self._config, self._width = plan, config, config.lane_width
        self._sign = (
            1.0 if config.traffic_side == "right" else -1.0
        )  # lanes in lie so many times their offset to the right
        self._joined = len(plan.arms) > 2 or plan.axis is None or len(plan.driven) > 0
        self._lines = [self._line(k) for k in range(len(plan.arms))]
        rounded = self._joined and not plan.ring and all(arm.outward for arm in plan.arms)
        self._corner_radius = config.corner_radius if rounded else 0.0
        self._surface = paved(self._pieces(), self._corner_radius)
        self._drivable: Inside = inside(self._surface)
        self._driven = {way.places: way.curve for way in reversed(plan.driven)}
        self._mouths = [
            self._mouth(k) if self._joined else line.length for k, line in enumerate(self._lines)
        ]
        for places in self._usual() if self._joined else ():
            if (
                self._way(places) is None and (way := self._from_end_to_end(places)) is not None
            ):  # its mouths lie too near
                self._driven[places] = way
        self._mouths = [
            self._mouth(k) if self._joined else line.length for k, line in enumerate(self._lines)
        ]

    def drawn(self) -> tuple[tuple[Lane, ...], BaseGeometry]:
        """All lanes, those of the arms first, and what is paved."""
        arms, lanes = self._plan.arms, list[Lane]()
        index: dict[tuple[int, bool, int], int] = {}
        for k, arm in enumerate(arms[: None if self._joined else 1]):
            outward = arm.outward if self._joined else arms[1].inward
            for inward, count in ((True, arm.inward), (False, outward)):
                borders = self._along(
                    k, (self._width * n for n in range(count + 1)), inward=inward
                )
                first = len(lanes)
                for n, (inner, outer) in enumerate(pairwise(borders)):
                    left, right = (inner, outer) if self._sign > 0.0 else (outer, inner)
                    beside = tuple(first + other for other in (n - 1, n + 1) if 0 <= other < count)
                    index[k, inward, n] = len(lanes)
                    lanes.append(Lane(lane_id(k, n, inward=inward), left, right, (), beside))
        if not self._joined:
            return tuple(lanes), self._surface
        ways = [
            (index[a, True, i], index[b, False, j], way)
            for (a, i, b, j), way in self._ways().items()
        ]
        narrow = [self._way_lane(way, lanes[start], lanes[goal], 0.0) for start, goal, way in ways]
        outlines = shapely.make_valid([shapely.Polygon(lane.outline) for lane in narrow])
        self._surface = paved([self._surface, *outlines], self._corner_radius)
        self._drivable = inside(self._surface)
        after: dict[int, list[int]] = {}
        for start, goal, way in ways:
            after.setdefault(start, []).append(len(lanes))
            lane = self._way_lane(way, lanes[start], lanes[goal], self._wider(way))
            lanes.append(replace(lane, successors=(goal,)))
        return tuple(
            replace(lane, successors=tuple(after.get(k, lane.successors)))
            for k, lane in enumerate(lanes)
        ), self._surface

    def rules(self, lanes: Sequence[Lane]) -> Iterator[TrafficRule]:
        """What signs say at the mouths of arms: to stop, or to give way to the other arms, and to who is on the ring."""
        arms = (
            range(len(self._plan.arms)) if self._joined and self._config.priority != "none" else ()
        )
        mouths = [k for k, lane in enumerate(lanes) if not lane.junction]
        into = [[k for k in mouths if lanes[k].id.startswith(f"{arm + 1}.-")] for arm in arms]
        stop = (
            self._config.priority == "all_way_stop"
            and not self._plan.ring
            and all(arm.outward for arm in self._plan.arms)
        )
        for arm in arms:
            if not into[arm] or not (stop or arm in self._plan.yielding):
                continue
            over = [
                k
                for other in arms
                if other != arm and other not in self._plan.yielding
                for k in into[other]
            ]
            if self._plan.ring:
                over = [
                    k
                    for k, lane in enumerate(lanes)
                    if lane.junction and not lane.id.startswith(f"{arm + 1}.")
                ]
            ends = [edge for k in into[arm] for edge in (lanes[k].left[-1], lanes[k].right[-1])]
            line = np.stack((ends[0], ends[-1]) if self._sign > 0.0 else (ends[1], ends[-2]))
            if self._config.crossing != "none":  # who stops does so before it
                line -= (_CROSSING_M[1] + _BEFORE_M) * unit(
                    float(self._lines[arm].at(np.array([self._mouths[arm]]))[0, 2])
                )
            kind = RuleKind.STOP if stop else RuleKind.GIVE_WAY
            yield TrafficRule(
                f"arm {arm + 1}", kind, tuple(into[arm]), () if stop else tuple(over), line
            )

    def others(self, lanes: Sequence[Lane]) -> list[Lane]:
        """Cycle lanes and crossings, whose neighbours count behind those of lanes that cars may use."""
        others, index, arms = list[Lane](), dict[tuple[int, bool], int](), self._plan.arms
        for k, arm in enumerate(
            arms[: None if self._joined else 1] if self._config.cycle_lane else ()
        ):
            counts = arm.inward, arm.outward if self._joined else arms[1].inward
            for inward, count in zip((True, False), counts, strict=True):
                edges = count * self._width + np.array([0.0, self._config.cycle_lane])
                inner, outer = self._along(k, edges, inward=inward)
                left, right = (inner, outer) if self._sign > 0.0 else (outer, inner)
                index[k, inward] = len(others)
                others.append(Lane(lane_id(k, count, inward=inward), left, right, users=_CYCLISTS))
        for a, b in permutations(range(len(arms)), 2) if index and self._joined else ():
            way = self._cycle_way(a, b)
            if way is not None:
                start, goal = index[a, True], index[b, False]
                lane = self._way_lane(
                    way, others[start], others[goal], (self._config.cycle_lane - self._width) / 2.0
                )
                leads = (*others[start].successors, len(lanes) + len(others))
                others[start] = replace(others[start], successors=leads)
                others.append(replace(lane, successors=(len(lanes) + goal,), users=_CYCLISTS))
        if self._config.crossing != "none":
            others += [self._crossing(k) for k in range(len(arms) if self._joined else 1)]
        return others

    def _cycle_way(self, a: int, b: int) -> Curve | None:
        """The way from the cycle lane into the junction on one arm to that out of it on another; None if nobody could ride it."""
        counts = self._plan.arms[a].inward, self._plan.arms[b].outward
        middles = [count * self._width + self._config.cycle_lane / 2.0 for count in counts]
        if self._plan.axis is not None and max(a, b) < 2 and middles[0] == middles[1]:
            return self._through(a, middles[0])
        return self._drawn_way(a, middles[0], b, middles[1], _CYCLISTS_SHARPEST)

    def _crossing(self, k: int) -> Lane:
        """The crossing of an arm, before its mouth, from the right of its line to the left; of a road through in its middle."""
        line, arms = self._lines[k], self._plan.arms
        near, far = (max(self._mouths[k] - metres, 0.0) for metres in _CROSSING_M)
        stations = (far, near) if self._joined else half_way(line)
        counts = arms[k].inward, arms[k].outward if self._joined else arms[1].inward
        right, left = (
            count * self._width + self._config.cycle_lane
            for count in (counts if self._sign > 0.0 else counts[::-1])
        )
        return across(f"crossing {k + 1}", line, stations, (right, left))

    def _pieces(self) -> Iterator[BaseGeometry]:
        """What is paved for certain: the arms, the ring, and where a vehicle drives through the junction."""
        for arm, line in zip(self._plan.arms, self._lines, strict=True):
            right, left = (
                (arm.inward, arm.outward) if self._sign > 0.0 else (arm.outward, arm.inward)
            )
            yield strip(line, -right * self._width, left * self._width)
        if self._plan.ring:
            yield ring(self._plan.ring, self._width / 2.0 + _RING_ROOM_M)
        for way in self._plan.driven:
            if self._plan.ring and way.places[0] != way.places[2]:
                continue  # who turns back drives all of the ring
            inner = way.curve.cut(way.length / 2.0, way.curve.length - way.length / 2.0)
            yield swept(inner, way.length, way.width)

    def _line(self, k: int) -> Curve:
        """The dividing line of an arm from its end to the junction's middle; of a road through, from end to end."""
        axis = self._plan.axis
        if axis is not None and k < 2:
            line = axis if k == 0 else axis.reversed()
            return (
                line.cut(0.0, float(line.project(np.zeros((1, 2)))[0][0]), _STEP_M)
                if self._joined
                else line
            )
        start = reverse(self._plan.arms[k].pose)
        length = -float((start[:2] * unit(start[2])).sum()) - self._plan.ring
        return Curve(np.array([start, [*(start[:2] + length * unit(start[2])), start[2]]]))

    def _mouth(self, k: int) -> float:
        """How far [m] from its end an arm has its lanes."""
        arm, line = self._plan.arms[k], self._lines[k]
        along = np.arange(0.0, line.length, _LOOK_M)
        wider = np.zeros(len(along), dtype=np.bool_)
        for side, count in ((-self._sign, arm.inward), (self._sign, arm.outward)):
            edge = side * (count * self._width + _WIDER_THAN_LANES_M)
            wider |= self._drivable(line.beside(along, edge)[:, :2])
        mouth = float(along[int(np.argmax(wider))]) if wider.any() else line.length
        for (a, _, b, _), way in self._driven.items():
            for own, curve in ((a, way), (b, way.reversed())):
                bent = np.abs(curve.points[:, 2] - curve.points[0, 2]) > _BENT
                if own == k and bent.any():
                    mouth = min(mouth, float(curve.station[max(int(np.argmax(bent)) - 1, 0)]))
        return max(mouth - _BEFORE_M, _SHORTEST_M)

    def _along(self, k: int, offsets: Iterable[float], *, inward: bool) -> list[Floats]:
        """Lines so far [m] outside of an arm's dividing line, on the side of its lanes in or out, in the direction of traffic."""
        line = self._lines[k].cut(0.0, self._mouths[k], _STEP_M)
        side = -self._sign if inward else self._sign
        borders = [line.beside(line.station, side * offset)[:, :2] for offset in offsets]
        return borders if inward else [border[::-1] for border in borders]

    def _usual(self) -> list[Way]:
        """From each lane to the same lane of each other arm."""
        arms = self._plan.arms
        return [
            (a, i, b, j)
            for a, b in permutations(range(len(arms)), 2)
            for i in range(arms[a].inward)
            if 0
            <= (j := i if arms[a].outward else i + arms[b].outward - arms[a].inward)
            < arms[b].outward
        ]

    def _ways(self) -> dict[Way, Curve]:
        """The ways of the template, the usual ones, and those that lack."""
        arms = self._plan.arms
        everywhere = dict.fromkeys((*self._driven, *self._usual()))
        ways = {places: way for places in everywhere if (way := self._way(places)) is not None}
        for a, b in permutations(range(len(arms)), 2):
            lacking = [
                (a, i, b, arms[b].outward - 1)
                for i in range(arms[a].inward)
                if all(w[:2] != (a, i) for w in ways)
            ]
            lacking += [
                (a, arms[a].inward - 1, b, j)
                for j in range(arms[b].outward)
                if all(w[2:] != (b, j) for w in ways)
            ]
            for places in lacking:
                if min(places) >= 0 and (way := self._way(places)) is not None:
                    ways[places] = way
        return ways

    def _from_end_to_end(self, places: Way) -> Curve | None:
        """The way from the end of one lane to that of another; None if no car could drive it."""
        (a, i, b, j), arms = places, self._plan.arms
        start, goal = (
            arms[a].lane(i, self._config, inward=True),
            arms[b].lane(j, self._config, inward=False),
        )
        return (
            None if abs(angle_between(goal[2], start[2])) > _TURN_BACK else draw_route(start, goal)
        )

    def _way(self, places: Way) -> Curve | None:
        """The way from the middle of one lane at its mouth to another's; None if no car could drive it."""
        a, i, b, j = places
        if (driven := self._driven.get(places)) is not None:
            return driven.cut(self._mouths[a], driven.length - self._mouths[b], _WAY_STEP_M)
        if self._plan.axis is not None and max(a, b) < 2 and i == j:
            return self._through(a, (i + 0.5) * self._width)
        return self._drawn_way(a, (i + 0.5) * self._width, b, (j + 0.5) * self._width)

    def _through(self, a: int, offset: float) -> Curve:
        """The way from the first arm's mouth to the second one's, or back, so far [m] beside the dividing line."""
        assert self._plan.axis is not None
        line = self._plan.axis if a == 0 else self._plan.axis.reversed()
        line = line.cut(self._mouths[a], line.length - self._mouths[1 - a], _WAY_STEP_M)
        return Curve(line.beside(line.station, -self._sign * offset))

    def _drawn_way(
        self, a: int, begins: float, b: int, ends: float, tightest: float = TIGHTEST
    ) -> Curve | None:
        """The way from one arm's mouth to another's, from and to places so far [m] beside their dividing lines."""
        start = self._lines[a].beside(np.array([self._mouths[a]]), -self._sign * begins)[0]
        goal = reverse(self._lines[b].beside(np.array([self._mouths[b]]), self._sign * ends)[0])
        if abs(angle_between(goal[2], start[2])) > _TURN_BACK:
            return None
        way = draw_route(start, goal, tightest=tightest)
        return None if way is None else way.cut(0.0, way.length, _WAY_STEP_M)

    def _wider(self, way: Curve) -> Floats | float:
        """How many metres the borders of a way lie outside of a lane's: as far as the road is wide, if the way bends."""
        if np.ptp(way.points[:, 2]) <= _STRAIGHT_ON:
            return 0.0
        swell = np.square(np.sin(np.pi * way.station / way.length))
        half = self._width / 2.0
        beside = (
            drivable_beside(self._drivable, way, sign, half + _WIDER_M, _LOOK_M / 2.0)
            for sign in (1.0, -1.0)
        )
        inner, free = swell > _INNER, np.minimum(*beside) - half
        return np.asarray(
            swell * float(np.clip((free[inner] + _LOOK_M) / swell[inner], 0.0, _WIDER_M).min())
        )

    def _way_lane(self, way: Curve, start: Lane, goal: Lane, wider: Floats | float) -> Lane:
        """The lane along a way, whose borders begin and end at those of the lanes that it joins."""
        share = (way.station / way.length)[:, None]
        edges = []
        for sign, ends in (
            (1.0, (start.left[-1], goal.left[0])),
            (-1.0, (start.right[-1], goal.right[0])),
        ):
            own = way.beside(way.station, sign * (self._width / 2.0 + wider))[:, :2]
            edges.append(own + (1.0 - share) * (ends[0] - own[0]) + share * (ends[1] - own[-1]))
            edges[-1][[0, -1]] = ends
        return Lane(f"{start.id}>{goal.id}", edges[0], edges[1], junction="1")


def half_way(line: Curve) -> tuple[float, float]:
    """Stations [m] of a line between which a crossing in its middle lies."""
    half = (_CROSSING_M[1] - _CROSSING_M[0]) / 2.0
    return line.length / 2.0 - half, line.length / 2.0 + half


def across(
    name: str, line: Curve, stations: tuple[float, float], reach: tuple[float, float]
) -> Lane:
    """Return the crossing between two stations [m] of a line, so many metres to its right and to its left."""
    behind, ahead = (
        line.beside(np.full(2, s), np.array([-reach[0], reach[1]]))[:, :2] for s in stations
    )
    return Lane(name, behind, ahead, users=frozenset(("pedestrian",)), crossing=True)


def ways_through(road: Road) -> dict[tuple[int, int], Curve]:
    """Return the ways from the end of an entry's lane to that of an exit's, by the indices of the two, that a drawn road has."""
    network = (
        road.lanes if road.lanes is not None and road.lanes.drawn else LaneNetwork(road.name, ())
    )
    ways = {}
    for e, first in enumerate(network.entries):
        for way in network.lanes[first].successors:
            (last,) = network.lanes[way].successors
            line = np.concatenate([network.lanes[k].centre for k in (first, way, last)])
            ways[e, network.exits.index(last)] = Curve.through(line)
    return ways
