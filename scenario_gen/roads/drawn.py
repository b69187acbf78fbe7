# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The lanes of a drawn road: along its arms from their ends to the junction, and ways through that from lane to lane.

An arm has its lanes from its end to its mouth, where the road grows wider than the lanes or somebody begins to turn. A way that
the template drives is the one that the road was drawn for, another one the clothoid that routes are made of; where it bends it is
wider than a lane, as far as the road is.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise, product

import numpy as np

from scenario_gen.numerics import Bools, Floats
from scenario_gen.numerics.curve import Curve
from scenario_gen.numerics.plane import angle_between, unit, unit_left
from scenario_gen.roads.config import RoadConfig
from scenario_gen.roads.ways import draw_ring_route, draw_route, flare_begins, reverse
from scenario_gen.types import Lane, LaneNetwork, Road

Way = tuple[int, int, int, int]
"""Arm and lane that a way comes from, arm and lane that it leads to; lanes count from the dividing line."""

_STEP_M, _WAY_STEP_M = 1.0, 0.5  # between cross-sections, of arms and of ways
_BEFORE_M = 1.0  # that a mouth lies before the place where the road is wider
_STEADY = 5  # cells along an arm for which the road is wider
_SHORTEST_M = 0.5  # of an arm
_TURN_BACK = np.radians(150.0)  # a way that turns by more is none but for who drives it
_STRAIGHT_ON = np.radians(10.0)  # a way that turns by less is no wider than its lanes
_WIDER_M = 1.0  # by which each border of a bent way lies outside at most
_INNER = 0.1  # of the most by which a bent way is wider, from which on it is looked whether the road is, too
_BENT = np.radians(0.1)


@dataclass(frozen=True, eq=False)
class PlannedArm:
    """The end (3,) of an arm's dividing line, heading out, and its numbers of lanes in and out."""

    pose: Floats
    inward: int
    outward: int

    @classmethod
    def ramp(cls, entry: Floats, config: RoadConfig) -> "PlannedArm":
        """The arm of one lane, by which nobody leaves, whose traffic comes in at a pose (3,)."""
        out = reverse(entry)
        aside = 0.5 * config.lane_width * (1.0 if config.traffic_side == "right" else -1.0)
        return cls(np.array([*(out[:2] - aside * unit_left(out[2])), out[2]]), 1, 0)

    def lane(self, k: int, config: RoadConfig, *, inward: bool) -> Floats:
        """The pose (3,) [m, m, rad] of lane k, counted from the dividing line, heading as its traffic does."""
        left = (k + 0.5) * config.lane_width * (1.0 if inward == (config.traffic_side == "right") else -1.0)
        yaw = self.pose[2]
        return np.array([*(self.pose[:2] + left * unit_left(yaw)), yaw + np.pi if inward else yaw])


def lane_ends(arms: Sequence[PlannedArm], config: RoadConfig) -> tuple[Floats, Floats]:
    """The entries (E, 3) and exits (X, 3) [m, m, rad] of some arms."""
    entries = [arm.lane(k, config, inward=True) for arm in arms for k in range(arm.inward)]
    return np.array(entries), np.array([arm.lane(k, config, inward=False) for arm in arms for k in range(arm.outward)])


@dataclass(frozen=True, eq=False)
class Plan:
    """What is known of a road when it is drawn.

    Attributes:
        arms: its arms; one by which nobody leaves is a ramp.
        axis: the dividing line from the end of the first arm to that of the second; None: these are arms as the others.
        ways: the ways through the junction that it was drawn for, from the end of one lane to that of another.
        ring: radius [m] of the lane of a roundabout about the origin; 0: it is none.
    """

    arms: Sequence[PlannedArm]
    axis: Curve | None = None
    ways: Mapping[Way, Curve] = field(default_factory=dict)
    ring: float = 0.0


def road_of(plan: Plan, name: str, low: Floats, drivable: Bools, config: RoadConfig) -> Road:
    """Return a road with its lanes.

    Args:
        plan: its arms, in metres.
        name: of the road.
        low: (2,) [m] the lower-left corner of the grid, which is the road's origin.
        drivable: (H, W) its cells.
        config: lane width, resolution, traffic side.
    """
    shift = np.array([*low, 0.0])
    arms = [replace(arm, pose=arm.pose - shift) for arm in plan.arms]
    entries, exits = (ends - shift for ends in lane_ends(plan.arms, config))
    road = Road(name, drivable, config.resolution, np.zeros(2), entries, exits)
    axis = None if plan.axis is None else Curve(plan.axis.points - shift)
    ways = {places: Curve(way.points - shift) for places, way in plan.ways.items()}
    lanes = _Drawing(road, Plan(arms, axis, ways, plan.ring), -low, config).lanes()
    return replace(road, lanes=LaneNetwork(name, lanes, drawn=True)) if lanes else road


class _Drawing:
    """The lanes of a road, arm by arm and way by way."""

    def __init__(self, road: Road, plan: Plan, centre: Floats, config: RoadConfig) -> None:
        self._road, self._plan, self._centre, self._config = road, plan, centre, config
        self._sign = 1.0 if config.traffic_side == "right" else -1.0  # lanes in lie so many times their offset to the right
        self._lines = [self._line(k) for k in range(len(plan.arms))]
        self._joined = len(plan.arms) > 2
        self._mouths = [self._mouth(k) if self._joined else line.length for k, line in enumerate(self._lines)]

    def lanes(self) -> tuple[Lane, ...]:
        """All lanes, those of the arms first; none if some lane leads nowhere or is led to by none."""
        arms, lanes = self._plan.arms, list[Lane]()
        index: dict[tuple[int, bool, int], int] = {}
        for k, arm in enumerate(arms[: None if self._joined else 1]):
            outward = arm.outward if self._joined else arms[1].inward
            for inward, count in ((True, arm.inward), (False, outward)):
                borders = self._borders(k, inward=inward, count=count)
                first = len(lanes)
                for n, (inner, outer) in enumerate(pairwise(borders)):
                    left, right = (inner, outer) if self._sign > 0.0 else (outer, inner)
                    beside = tuple(first + other for other in (n - 1, n + 1) if 0 <= other < count)
                    index[k, inward, n] = len(lanes)
                    lanes.append(Lane(f"{k + 1}.{-n - 1 if inward else n + 1}", left, right, (), beside))
        if not self._joined:
            return tuple(lanes)
        after: dict[int, list[int]] = {}
        for (a, i, b, j), way in self._ways().items():
            start, goal = index[a, True, i], index[b, False, j]
            after.setdefault(start, []).append(len(lanes))
            left, right = self._edges(way, lanes[start], lanes[goal])
            lanes.append(Lane(f"{lanes[start].id}>{lanes[goal].id}", left, right, (goal,), junction="1"))
        ends = {k for key, k in index.items() if not key[1]}
        if set(after) != set(index.values()) - ends or {lane.successors[0] for lane in lanes if lane.junction} != ends:
            return ()
        return tuple(replace(lane, successors=tuple(after.get(k, lane.successors))) for k, lane in enumerate(lanes))

    def _line(self, k: int) -> Curve:
        """The dividing line of an arm from its end inwards; of a road through, from end to end."""
        axis = self._plan.axis
        if axis is not None and k < 2:
            line = axis if k == 0 else axis.reversed()
            return line if len(self._plan.arms) == 2 else line.cut(0.0, line.length / 2.0, _STEP_M)
        start = reverse(self._plan.arms[k].pose)
        length = self._road.resolution * float(sum(self._road.drivable.shape))
        return Curve(np.array([start, [*(start[:2] + length * unit(start[2])), start[2]]]))

    def _mouth(self, k: int) -> float:
        """How far [m] from its end an arm has its lanes."""
        arm, line, width = self._plan.arms[k], self._lines[k], self._config.lane_width
        along = np.arange(0.0, line.length, self._road.resolution)
        wider = np.zeros(len(along), dtype=np.bool_)
        for side, count in ((-self._sign, arm.inward), (self._sign, arm.outward)):
            edge = side * (count * width + 1.5 * self._road.resolution)
            wider |= self._road.drivable_at(line.beside(along, edge)[:, :2])
        # a slanted kerb's single cells do not count
        steady = np.array([wider[n : n + _STEADY].all() for n in range(len(wider) - _STEADY)])
        mouth = float(along[int(np.argmax(steady))]) if steady.any() else line.length
        if self._plan.ring:
            away = float(np.hypot(*(arm.pose[:2] - self._centre)))
            mouth = min(mouth, away - flare_begins(self._plan.ring, width / 2.0))
        for (a, _, b, _), way in self._plan.ways.items():
            for own, curve in ((a, way), (b, way.reversed())):
                bent = np.abs(curve.points[:, 2] - curve.points[0, 2]) > _BENT
                if own == k and bent.any():
                    mouth = min(mouth, float(curve.station[max(int(np.argmax(bent)) - 1, 0)]))
        return max(mouth - _BEFORE_M, _SHORTEST_M)

    def _borders(self, k: int, *, inward: bool, count: int) -> list[Floats]:
        """The borders of an arm's lanes in or out from the dividing line outwards, in the direction of traffic."""
        line = self._lines[k].cut(0.0, self._mouths[k], _STEP_M)
        side = -self._sign if inward else self._sign
        offsets = side * self._config.lane_width * np.arange(count + 1)
        borders = [line.beside(line.station, offset)[:, :2] for offset in offsets]
        return borders if inward else [border[::-1] for border in borders]

    def _ways(self) -> dict[Way, Curve]:
        """The ways of the template, those from each lane straight on to the same lane of each other arm, and those that lack."""
        arms = self._plan.arms
        pairs = [(a, b) for a, b in product(range(len(arms)), repeat=2) if a != b or self._plan.ring]
        usual = [
            (a, i, b, j)
            for a, b in pairs
            for i in range(arms[a].inward)
            if 0 <= (j := i if arms[a].outward else i + arms[b].outward - arms[a].inward) < arms[b].outward
        ]
        ways = {places: way for places in dict.fromkeys((*self._plan.ways, *usual)) if (way := self._way(places)) is not None}
        for a, b in pairs:
            lacking = [(a, i, b, arms[b].outward - 1) for i in range(arms[a].inward) if all(w[:2] != (a, i) for w in ways)]
            lacking += [(a, arms[a].inward - 1, b, j) for j in range(arms[b].outward) if all(w[2:] != (b, j) for w in ways)]
            for places in lacking:
                if min(places) >= 0 and (way := self._way(places)) is not None:
                    ways[places] = way
        return ways

    def _way(self, places: Way) -> Curve | None:
        """The way from the middle of one lane at its mouth to another's; None if no car could drive it there."""
        a, i, b, j = places
        width, driven = self._config.lane_width, self._plan.ways.get(places)
        start = self._middle(a, -self._sign * (i + 0.5))
        goal = reverse(self._middle(b, self._sign * (j + 0.5)))
        if driven is not None:
            way: Curve | None = driven.cut(self._mouths[a], driven.length - self._mouths[b], _WAY_STEP_M)
        elif self._plan.ring:
            way = draw_ring_route(start, goal, self._centre, self._plan.ring, lambda _: True)
        elif abs(angle_between(goal[2], start[2])) > _TURN_BACK:
            return None
        elif self._plan.axis is not None and max(a, b) < 2 and i == j:
            line = self._plan.axis if a == 0 else self._plan.axis.reversed()
            line = line.cut(self._mouths[a], line.length - self._mouths[b], _STEP_M)
            way = Curve(line.beside(line.station, -self._sign * (i + 0.5) * width))
        else:
            way = draw_route(start, goal, lambda _: True)
        if way is None or not self._road.drivable_at(way.points[:, :2]).all():
            return None
        return way.cut(0.0, way.length, _WAY_STEP_M)

    def _middle(self, k: int, lanes: float) -> Floats:
        """The pose (3,) at an arm's mouth so many lanes to the left of its dividing line, heading inwards."""
        pose: Floats = self._lines[k].beside(np.array([self._mouths[k]]), np.array([lanes * self._config.lane_width]))[0]
        return pose

    def _edges(self, way: Curve, start: Lane, goal: Lane) -> tuple[Floats, Floats]:
        """The borders of a way, which begin and end at those of the lanes that it joins."""
        width, share = self._config.lane_width, way.station / way.length
        wider = np.zeros(len(share))
        if np.ptp(way.points[:, 2]) > _STRAIGHT_ON:
            swell = np.square(np.sin(np.pi * share))
            free = (
                np.minimum(*(drivable_beside(self._road, way, sign, width / 2.0 + _WIDER_M) for sign in (1.0, -1.0)))
                - width / 2.0
            )
            inner = swell > _INNER
            wider = swell * float(np.clip((free[inner] + self._road.resolution) / swell[inner], 0.0, _WIDER_M).min())
        edges = []
        for sign, ends in ((1.0, (start.left[-1], goal.left[0])), (-1.0, (start.right[-1], goal.right[0]))):
            own = way.beside(way.station, sign * (width / 2.0 + wider))[:, :2]
            off = np.stack((ends[0] - own[0], ends[1] - own[-1]))
            edges.append(own + (1.0 - share[:, None]) * off[0] + share[:, None] * off[1])
            edges[-1][[0, -1]] = ends
        return edges[0], edges[1]


def ways_through(road: Road) -> dict[tuple[int, int], Curve]:
    """Return the ways from the end of an entry's lane to that of an exit's, by the indices of the two, that a drawn road has."""
    network = road.lanes if road.lanes is not None and road.lanes.drawn else LaneNetwork(road.name, ())
    ways = {}
    for e, first in enumerate(network.entries):
        for way in network.lanes[first].successors:
            (last,) = network.lanes[way].successors
            line = np.concatenate([network.lanes[k].centre for k in (first, way, last)])
            ways[e, network.exits.index(last)] = Curve.through(line)
    return ways


def drivable_beside(road: Road, line: Curve, sign: float, most: float) -> Floats:
    """Return (M,) how far [m] a road is drivable to the left (`sign` 1) or right (-1) of a line's points, at most `most`."""
    distance = np.arange(0.0, most, road.resolution / 2.0)
    station = np.repeat(line.station[:, None], len(distance), axis=1)
    drivable = road.drivable_at(line.beside(station, sign * distance[None, :])[..., :2])
    free = np.logical_and.accumulate(drivable, axis=1).sum(axis=1) * road.resolution / 2.0
    return np.asarray(np.minimum(free, most))
