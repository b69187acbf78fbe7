# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The true lanes of a built-in road: its arms as they were drawn, and ways through the junction from lane to lane.

An arm has its lanes from its end to its mouth, where the road grows wider than the lanes; their outer edges lie half a cell's
diagonal outside, where the cells' corners are. A way is the clothoid that routes are made of, as wide as the lanes that it joins,
and wider where a footprint on it needs it: nobody paints lanes inside of a junction.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from scenario_gen.numerics import Floats, wrap_angle
from scenario_gen.numerics.curve import Curve
from scenario_gen.numerics.plane import unit_left
from scenario_gen.output.exchange.derived_lanes import outline, widest_near
from scenario_gen.output.exchange.lanes import Joint, LaneMap, Strip
from scenario_gen.roads import Arm, arms_of, draw_ring_route, draw_route, flare_begins, reverse, ring_of
from scenario_gen.types import Road, Scenario

STEP = 1.0  # metres between points of a line
HALF_DIAGONAL = 0.7072  # of a cell, in sides
BEFORE = 1.0  # metres that a mouth lies before the place where the road is wider
STEADY = 5  # cells along an arm for which the road is wider
SHORTEST = 0.5  # metres of an arm
EVEN = 1e-3  # metres by which lanes may lie elsewhere than side by side
STRAIGHT_ON = 0.52  # rad, 30°: a way that turns by less goes straight on
TURN_BACK = 2.6  # rad, 150°: a way that turns by more is none but for who drives it
MOST_WIDER = 1.2  # metres by which an edge of a way is moved out at most
STRAIGHT_LINE = 1e-6  # by which the cosine of an arm's direction to a straight road may differ from 1
MARGIN = 0.05  # metres between a footprint and its way's edge


@dataclass(frozen=True, eq=False)
class _Side:
    """An arm to be drawn: the dividing line from its end inwards, as far as its mouth, and its numbers of lanes in and out."""

    line: Curve
    mouth: float
    inward: int
    outward: int


def drawn_lanes(road: Road, axis: Curve | None, side: str, scenarios: Sequence[Scenario], run_out: float) -> LaneMap | None:
    """Return the lanes of a road with arms.

    Args:
        road: drawn by this version, with its entries and exits.
        axis: dividing line of its main road where that bends, anywhere in the plane; None if it is straight.
        side: of traffic.
        scenarios: whose footprints the ways through the junction must hold.
        run_out: metres by which arms are continued straight on beyond their ends.

    Returns:
        None if its lanes do not lie side by side in arms, or from one of them no way leads on.
    """
    arms = arms_of(road)
    if len(arms) < 2:
        return None
    widths = [np.abs(offsets) for arm in arms for offsets in (arm.inward, arm.outward)]
    width = 2.0 * min(float(offsets.min()) for offsets in widths)
    ramps = _ramps(road, arms, width, side)
    if len(np.concatenate(widths)) + len(ramps) != len(road.entries) + len(road.exits):
        return None
    if any(np.abs(np.sort(offsets) - (np.arange(len(offsets)) + 0.5) * width).max() > EVEN for offsets in widths):
        return None
    if axis is not None:
        move = arms[0].pose[:2] - axis.points[0, :2]  # the first arm is the axis' beginning
        axis = Curve(axis.points + np.array([*move, 0.0]))
        if float(np.hypot(*(axis.points[-1, :2] - arms[1].pose[:2]))) > EVEN:
            return None
    extra = HALF_DIAGONAL * road.resolution
    if len(arms) == 2 and not ramps:
        line = axis or _between(arms)
        if line is None:
            return None
        strip = _arm_strip(
            "main road", _Side(line, line.length + run_out, len(arms[0].inward), len(arms[1].inward)), width, extra, side, run_out
        )
        return LaneMap((strip,), (), side, "", derived=False)
    ring = ring_of(road)
    sides = []
    for k, arm in enumerate((*arms, *ramps)):
        mouth = _mouth(road, arm, _line(arm, k, axis, road), width, ring)
        if mouth is None:
            return None
        sides.append(mouth)
    strips = [_arm_strip(f"arm {k + 1}", arm_lanes, width, extra, side, run_out) for k, arm_lanes in enumerate(sides)]
    drawn = ((places, _way(sides, places, width, side, ring)) for places in _places(sides))
    ways = {places: way for places, way in drawn if way is not None and road.drivable_at(way.points[:, :2]).all()}
    if {places[0] for places in ways} != set(range(len(sides))):
        return None
    used = _used(ways, sides, width, scenarios)
    joints = []
    for places, way in ways.items():
        a, i, b, j = places
        ahead = i if sides[a].outward else i + sides[b].outward - sides[a].inward  # a ramp joins the outermost lane
        turn = float(wrap_angle(np.asarray(way.points[-1, 2] - way.points[0, 2])))
        if (j != ahead or abs(turn) > TURN_BACK) and places not in used:
            continue
        name = "straight" if abs(turn) < STRAIGHT_ON else "left" if turn > 0.0 else "right"
        joints.append(Joint(len(strips), a, b, name, i, j))
        strips.append(_way_strip(way, sides, places, width, extra, side, used.get(places, [])))
    return LaneMap(tuple(strips), tuple(joints), side, "", derived=False)


def _ramps(road: Road, arms: Sequence[Arm], width: float, side: str) -> list[Arm]:
    """Return an arm of one lane, by which nobody leaves, for each entry that is in no arm."""
    known = [arm.pose[:2] + offset * unit_left(arm.pose[2]) for arm in arms for offset in arm.inward]
    offset = width / 2.0 if side == "right" else -width / 2.0  # lanes in lie to the left of who looks out, on the right side
    ramps = []
    for entry in road.entries:
        if all(float(np.hypot(*(entry[:2] - place))) > EVEN for place in known):
            out = reverse(entry)
            pose = np.array([*(out[:2] - offset * unit_left(out[2])), out[2]])
            ramps.append(Arm(pose, np.array([offset]), np.zeros(0)))
    return ramps


def _between(arms: Sequence[Arm]) -> Curve | None:
    """Return the straight line from the first arm's end to the second's; None if they do not lie on one."""
    ends = np.stack([arm.pose[:2] for arm in arms[:2]])
    yaw = float(np.arctan2(*(ends[1] - ends[0])[::-1]))
    headings = np.array([arms[0].pose[2] + np.pi, arms[1].pose[2]])
    if (np.cos(headings - yaw) < 1.0 - STRAIGHT_LINE).any():
        return None
    return Curve(np.column_stack((ends, np.full(2, yaw))))


def _line(arm: Arm, k: int, axis: Curve | None, road: Road) -> Curve:
    """Return an arm's dividing line from its end inwards: half of a bent main road's axis, else as far as the grid goes."""
    if axis is not None and k < 2:
        return (axis if k == 0 else axis.reversed()).cut(0.0, axis.length / 2.0, STEP)
    x, y, yaw = arm.pose.tolist()
    length = road.resolution * float(road.drivable.shape[0] + road.drivable.shape[1])
    end = [x - length * float(np.cos(yaw)), y - length * float(np.sin(yaw)), yaw + np.pi]
    return Curve(np.array([[x, y, yaw + np.pi], end]))


def _mouth(road: Road, arm: Arm, line: Curve, width: float, ring: tuple[Floats, float] | None) -> _Side | None:
    """Return an arm as far as the road is no wider than its lanes, and a way about the ring can begin; None if it never is."""
    along = np.arange(0.0, line.length, road.resolution)
    is_right = bool(arm.inward[0] > 0.0)  # lanes in lie to the left of who looks out
    left, right = (len(arm.outward), len(arm.inward)) if is_right else (len(arm.inward), len(arm.outward))
    wider = np.zeros(len(along), dtype=np.bool_)
    for edge in (left * width + 1.5 * road.resolution, -right * width - 1.5 * road.resolution):
        wider |= road.drivable_at(line.beside(along, np.full(len(along), edge))[:, :2])
    wider = np.array([wider[k : k + STEADY].all() for k in range(len(wider) - STEADY)])  # not a slanted kerb's single cells
    if not wider.any():
        return None
    mouth = float(along[int(np.argmax(wider))]) - BEFORE
    if ring is not None:
        mouth = min(mouth, float(np.hypot(*(arm.pose[:2] - ring[0]))) - flare_begins(ring[1], width / 2.0) - BEFORE)
    mouth = max(mouth, SHORTEST)
    return _Side(line, mouth, len(arm.inward), len(arm.outward))


def _arm_strip(name: str, arm: _Side, width: float, extra: float, side: str, run_out: float) -> Strip:
    """Return an arm from its run-out to its mouth; its outermost edges lie `extra` outside."""
    reference = arm.line.cut(-run_out, arm.mouth, STEP).points
    along, against = (np.full((count, len(reference)), width) for count in (arm.inward, arm.outward))
    along[-1:] += extra
    against[-1:] += extra
    right, left = (along, against) if side == "right" else (against, along)
    return Strip(name, reference, np.zeros(len(reference)), right, left)


Way = tuple[int, int, int, int]  # arm and lane that it comes from, arm and lane that it leads to


def _places(sides: Sequence[_Side]) -> Iterator[Way]:
    for a, b in product(range(len(sides)), repeat=2):
        if a != b:
            yield from ((a, i, b, j) for i in range(sides[a].inward) for j in range(sides[b].outward))


def _way(sides: Sequence[_Side], places: Way, width: float, side: str, ring: tuple[Floats, float] | None) -> Curve | None:
    """Return the way from the middle of one lane at its mouth to another's; None if no car could drive it."""
    a, i, b, j = places
    keep = 1.0 if side == "right" else -1.0
    start = sides[a].line.beside(np.array([sides[a].mouth]), np.array([-keep * (i + 0.5) * width]))[0]
    goal = sides[b].line.beside(np.array([sides[b].mouth]), np.array([keep * (j + 0.5) * width]))[0] + np.array([0.0, 0.0, np.pi])
    way = draw_route(start, goal, lambda _: True) if ring is None else draw_ring_route(start, goal, *ring, lambda _: True)
    if way is None:
        return None
    points = way.cut(0.0, way.length, STEP).points.copy()
    rest = float(wrap_angle(np.asarray(goal[2] - points[-1, 2])))
    points[0], points[-1] = start, [*goal[:2], points[-1, 2] + rest]
    return Curve(points)


def _used(ways: dict[Way, Curve], sides: Sequence[_Side], width: float, scenarios: Sequence[Scenario]) -> dict[Way, list[Floats]]:
    """Return, for each way that somebody drives, the outlines (P, 2) [m] of those who do."""
    used: dict[Way, list[Floats]] = {}
    for scenario in scenarios:
        for n in range(len(scenario.vehicles)):
            first, last = scenario.present[n].tolist()
            place, yaw = scenario.position[n, first : last + 1], scenario.heading[n, first : last + 1]
            inside = ~np.any([_in_arm(arm, place, width) for arm in sides], axis=0)
            near = [_farthest(way, place[inside], yaw[inside]) if inside.any() else np.inf for way in ways.values()]
            if near and min(near) < np.inf:
                used.setdefault(list(ways)[int(np.argmin(near))], []).append(outline(scenario, n))
    return used


def _in_arm(arm: _Side, place: Floats, width: float) -> np.ndarray:
    station, offset = arm.line.project(place)
    return (station < arm.mouth) & (np.abs(offset) < (max(arm.inward, arm.outward) + 0.5) * width)


def _farthest(way: Curve, place: Floats, yaw: Floats) -> float:
    """Return how far [m] positions (P, 2) stray from a way; infinitely if they lead elsewhere."""
    station, offset = way.project(place)
    if not (np.cos(yaw - way.at(station)[:, 2]) > 0.5).all():
        return float("inf")
    return float(np.abs(offset).max())


def _way_strip(
    way: Curve, sides: Sequence[_Side], places: Way, width: float, extra: float, side: str, outlines: Sequence[Floats]
) -> Strip:
    """Return a way as a strip of one lane, whose edges meet those of the lanes that it joins."""
    a, i, b, j = places
    share = way.station / way.length
    inner = np.full(len(share), width / 2.0)
    at_start, at_goal = (extra * (k == count - 1) for k, count in ((i, sides[a].inward), (j, sides[b].outward)))
    outer = inner + at_start * (1.0 - share) + at_goal * share
    left, right = (inner, outer) if side == "right" else (outer, inner)
    if outlines:
        station, offset = way.project(np.concatenate(outlines))
        on_way = (station > 0.0) & (station < way.length)
        needed = widest_near(way, station[on_way], np.abs(offset[on_way]) + MARGIN)[1:-1]
        for base in (left, right):  # alike, so that the lane's middle, which planners follow, is as smooth as the way
            base[1:-1] = np.maximum(base[1:-1], np.minimum(needed, base[1:-1] + MOST_WIDER))
    none = np.zeros((0, len(share)))
    name = f"way from arm {a + 1} to arm {b + 1}"
    if side == "right":
        return Strip(name, way.points, left, (left + right)[None], none)
    return Strip(name, way.points, -right, none, (left + right)[None])
