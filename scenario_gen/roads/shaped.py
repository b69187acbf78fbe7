# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Roads shaped to a template: along its bends, with arms where it comes and goes, lanes where it drives, as wide as it needs.

Two kinds of template. Along one road (nobody turns as at a junction, nobody crosses) the main road follows the template's own
main line, and side arms are put at its middle. At a junction the arms are the directions in which vehicles come and go; each
has its dividing line and lanes where the recorded vehicles were, to the nearest lane; and every vehicle's way through, with the
template's own curvature, is swept into the road, so there is room for it.
"""

from dataclasses import dataclass, replace

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import exact, Floats, wrap_angle
from scenario_gen.numerics.curve import Curve
from scenario_gen.roads.arms import RING_ROOM
from scenario_gen.roads.config import RoadConfig
from scenario_gen.roads.sketch import convex_hull, Sketch
from scenario_gen.roads.ways import draw_ring_route, draw_route, extended
from scenario_gen.template import FrenetTracks, main_line, MainLine, sharpness_of, Track, turn_of
from scenario_gen.types import Road

ARM_COUNT = {"straight": 2, "curve": 2, "t_intersection": 3, "four_way": 4, "roundabout": 4}
_RING = (13.0, 45.0)  # metres, smallest and largest radius of a roundabout's lane
_RING_LATERAL, _RING_FASTEST = 3.0, 4.0  # m/s² at the template's fastest: as it is sized, and at most
_RAMP_ANGLE = np.radians(12.0)
_ROOM = 6.0  # metres kept free behind the first and before the last footprint
_SLACK = 12.0  # metres by which a way may differ from the template's
_SHORTEST = 30.0  # metres of an arm
_BEND = np.radians(20.0)  # of a curve whose template does not bend
_SAME_ARM = np.radians(30.0)  # directions that differ by less are those of one arm
_MERGED = np.radians(45.0)  # and by so much if the road has too few arms otherwise
_PART = np.radians(75.0)  # a vehicle that is still turning may go on by so much to an arm
_STEADY = np.radians(6.0)  # a path that turns by less near its end shows the arm's direction
_THROUGH = np.radians(20.0)  # who turns by less goes straight through, on one line
_SURE = 5.0  # metres of such a path that make it sure
_LANE_GAP = 2.0  # metres sideways that make another lane
_MOST_BETWEEN = 4  # lanes left free between the two directions, at most
_MOST_LANES = 8
_WIDE_JUNCTION = 30.0  # metres from the middle to a corner between two arms that belongs to the junction
_SWEPT = 0.6  # metres of room beside a footprint on its way through the junction
_BESIDE = 0.4  # metres on each side of the widest vehicle in its lane


PLAIN_LINE = MainLine(Curve(np.array([[0.0, 0.0, 0.0], [120.0, 0.0, 0.0]])), np.array([0.0, 120.0]), np.array([0.0, 120.0]))
"""What `curve` is drawn along where there is no template."""


def fitting_width(tracks: tuple[Track, ...], config: RoadConfig) -> RoadConfig:
    """The configuration with lanes at least as wide as the template's widest vehicle needs."""
    widest = max(track.vehicle.width for track in tracks) + 2.0 * _BESIDE
    return replace(config, lane_width=max(config.lane_width, float(np.ceil(widest * 10.0 - 1e-6) / 10.0)))


def bends(name: str, main: MainLine) -> bool:
    """Whether the road `name` for a template along `main` is one that bends."""
    return name == "curve" or (name != "straight" and not main.straight)


def draw_bent(name: str, tracks: tuple[Track, ...], frenet: FrenetTracks, config: RoadConfig) -> Road:
    """Draw a main road that follows the template's main line, with side arms at its middle.

    Raises:
        RefusedError: it has more cells than are allowed.
    """
    return draw_along(name, main_line(frenet, tracks), config.lanes or frenet.lanes, config)


def draw_along(name: str, main: MainLine, lanes: int, config: RoadConfig) -> Road:
    """Draw the road `name` along a main line, with so many lanes in each direction.

    Raises:
        RefusedError: it has more cells than are allowed.
    """
    half = lanes * config.lane_width
    line = main_axis(name, main, config)
    sketch = Sketch()
    sketch.strip(line, -half, half)
    arms = [_ArmPlan(line.points[k] + np.array([0.0, 0.0, np.pi if k == 0 else 0.0]), lanes, lanes) for k in (0, -1)]
    at = line.at(line.length / 2.0)
    reach = config.arm_length or _SHORTEST
    one = config.lanes or 1
    width = one * config.lane_width
    for side in (-1.0, 1.0)[: ARM_COUNT[name] - 2]:
        yaw = float(at[2] + side * np.pi / 2.0)
        out = np.array([exact.cos(yaw), exact.sin(yaw)])
        end = np.array([*(at[:2] + (half + reach) * out), yaw])
        sketch.strip(Curve(np.array([[*at[:2], yaw], end])), -width, width)
        arms.append(_ArmPlan(end, one, one))
        for way in (-1.0, 1.0):  # the corners with the main road, to both sides
            corner = at[:2] + half * out + way * width * np.array([exact.cos(at[2]), exact.sin(at[2])])
            along = float(at[2] + (0.0 if way > 0.0 else np.pi))
            pair = (along, yaw) if way * side > 0.0 else (yaw, along)
            sketch.corner(corner, *pair, config.corner_radius)
    return _finished(name, sketch, arms, config)


def main_axis(name: str, main: MainLine, config: RoadConfig) -> Curve:
    """The dividing line of the main road: straight on at both ends of the main line for its arms; a curve bends."""
    run = max(config.arm_length - main.shape.length / 2.0, _ROOM) if config.arm_length else _ROOM
    own = float(main.shape.points[-1, 2] - main.shape.points[0, 2])
    extra = float(np.copysign(_BEND, own)) - own if name == "curve" and abs(own) < _BEND else 0.0
    return extended(main.shape, extra, run)


@dataclass(frozen=True, eq=False)
class _ArmPlan:
    """The end (3,) of an arm's dividing line, heading out, and its numbers of lanes in and out."""

    pose: Floats
    inward: int
    outward: int

    def lane(self, k: int, config: RoadConfig, *, inward: bool) -> Floats:
        """The pose (3,) of lane k, counted from the dividing line, heading as its traffic does."""
        left = (k + 0.5) * config.lane_width * (1.0 if inward == (config.traffic_side == "right") else -1.0)
        yaw = self.pose[2]
        xy = self.pose[:2] + left * np.array([-exact.sin(yaw), exact.cos(yaw)])
        return np.array([*xy, yaw + np.pi if inward else yaw])


def draw_merge(tracks: tuple[Track, ...] | None, frenet: FrenetTracks | None, config: RoadConfig) -> Road:
    """Draw a straight main road and a ramp that joins it from the side of its outermost lane, where the template changes to it.

    Raises:
        RefusedError: nobody in the template changes from the outermost lane of its direction to the next, or others keep to it.
    """
    lanes, along, before, after, sharpness = max(config.lanes, 1), 1.0, 2.0 * _SHORTEST, 2.0 * _SHORTEST, 0.02
    if tracks is not None and frenet is not None:
        who = _merging(tracks, frenet)
        outermost = int(frenet.lane[who[0]].max())
        others = frenet.lane[[i for i in range(len(tracks)) if i not in who]]
        lanes = max(int(others.max(initial=0)) + 1, outermost, config.lanes)
        along = float(frenet.direction[who[0]])
        half = np.array([[track.vehicle.length / 2.0] for track in tracks])
        station = along * frenet.station
        join = float(np.median([station[i][np.argmax(frenet.change[i] >= 0.5)] for i in who]))
        before, after = join - float((station - half).min()), float((station + half).max()) - join
        sharpness = max(sharpness_of(tracks[i]) for i in who)
    reach = [config.arm_length or max(size + _ROOM + _SLACK, _SHORTEST) for size in (before, after)]
    width = config.lane_width
    side = -1.0 if config.traffic_side == "right" else 1.0  # of the dividing line on which the traffic to the east drives
    west, east = (_ArmPlan(np.array([x, 0.0, yaw]), lanes, lanes) for x, yaw in ((-reach[0], np.pi), (reach[1], 0.0)))
    joined = np.array([0.0, side * (lanes - 0.5) * width, 0.0])
    yaw = np.pi - side * _RAMP_ANGLE  # out along the ramp
    out = np.array([exact.cos(yaw), exact.sin(yaw)])
    ramp = np.array([*(joined[:2] + reach[0] * out), yaw + np.pi])
    sketch = Sketch()
    sketch.strip(Curve(np.array([[-reach[0], 0.0, 0.0], [reach[1], 0.0, 0.0]])), -lanes * width, lanes * width)
    sketch.strip(Curve(np.stack((ramp, np.array([*joined[:2], ramp[2]])))), -width / 2.0, width / 2.0)
    target = east.lane(lanes - 1, config, inward=False)
    way = draw_route(ramp, target, lambda _: True, sharpness)
    if way is not None:
        sketch.sweep(way, 1.0, width)
    entries = [arm.lane(k, config, inward=True) for arm in (west, east) for k in range(lanes)]
    exits = [arm.lane(k, config, inward=False) for arm in (west, east) for k in range(lanes)]
    return sketch.raster("merge", np.array([*entries, ramp]), np.array(exits), config)


def _merging(tracks: tuple[Track, ...], frenet: FrenetTracks) -> list[int]:
    """The vehicles that come from the outermost lane of their direction and leave it for the next."""
    for sign in (1, -1):
        own = [i for i in range(len(tracks)) if frenet.direction[i] == sign]
        outermost = max((int(frenet.lane[i].max()) for i in own), default=0)
        who = [i for i in own if frenet.lane[i, 0] == outermost and frenet.lane[i, 1] < outermost]
        if who and all(outermost not in frenet.lane[i] for i in own if i not in who):
            return who
    raise RefusedError(
        "road merge: nobody in the template leaves the outermost lane of its direction for the next one, so nobody would use the "
        "ramp; choose straight or curve"
    )


def _finished(name: str, sketch: Sketch, arms: list[_ArmPlan], config: RoadConfig) -> Road:
    entries = np.array([arm.lane(k, config, inward=True) for arm in arms for k in range(arm.inward)])
    exits = np.array([arm.lane(k, config, inward=False) for arm in arms for k in range(arm.outward)])
    return sketch.raster(name, entries, exits, config)


# --- junctions ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _End:
    """One end of a vehicle's path: where it comes from or goes to.

    Attributes:
        vehicle: its index.
        inward: True for the start.
        yaw: direction [rad] out of the junction.
        at: (2,) where the steady part of the path begins, seen from the junction.
        away: metres from the centre to the path's end, along `yaw`; negative if it is not reached.
        steady: metres near the end on which the path hardly turns.
        turning: how it goes on turning, seen along `yaw`: the sign of what an arm may differ; 0 for one that goes straight on.
    """

    vehicle: int
    inward: bool
    yaw: float
    at: Floats
    away: float
    steady: float
    turning: float


@dataclass(eq=False)
class _Plan:
    """An arm in the making: its direction [rad], its members."""

    yaw: float
    members: list[_End]


def draw_junction(name: str, tracks: tuple[Track, ...], centre: Floats, config: RoadConfig) -> Road:
    """Draw a junction whose arms are where the template comes and goes.

    Args:
        name: `t_intersection` or `four_way`.
        tracks: the template's.
        centre: (2,) [m] of the junction, in the template's frame.
        config: how it is drawn.

    Raises:
        RefusedError: the template needs more arms or lanes than the road has, or the grid would be too large.
    """
    ends = [end for i, track in enumerate(tracks) for end in _ends(i, track, centre)]
    plans = _arms(name, tracks, ends)
    lane_of: dict[tuple[int, bool], tuple[int, int]] = {}
    arms: list[_ArmPlan] = []
    main = max(range(len(plans)), key=lambda k: max((end.away for end in plans[k].members), default=0.0))
    turn = np.pi - plans[main].yaw  # the longest arm leads west
    for plan in plans:
        offset, lanes = _lanes(plan, centre, config)
        needs = [end.away + tracks[end.vehicle].vehicle.length / 2.0 for end in plan.members]
        reach = config.arm_length or max(max(needs, default=0.0) + _ROOM + _SLACK, _SHORTEST)
        yaw = plan.yaw + turn
        out, left = (np.array([exact.cos(a), exact.sin(a)]) for a in (yaw, yaw + np.pi / 2.0))
        most = [max([lane for end, lane in lanes.items() if end[1] == inward], default=0) + 1 for inward in (True, False)]
        if max(most) > _MOST_LANES:
            raise RefusedError(f"road {name} would need {max(most)} lanes in one direction; {_MOST_LANES} are drawn at most")
        most = [max(count, config.lanes) for count in most]
        for end, lane in lanes.items():
            lane_of[end] = (len(arms), lane)
        arms.append(_ArmPlan(np.array([*(reach * out + offset * left), yaw]), most[0], most[1]))
    sketch = Sketch()
    _draw_arms(sketch, arms, config)
    for i, track in enumerate(tracks):
        if (i, True) in lane_of and (i, False) in lane_of and not track.still:
            (a, k), (b, m) = lane_of[i, True], lane_of[i, False]
            way = draw_route(
                arms[a].lane(k, config, inward=True), arms[b].lane(m, config, inward=False), lambda _: True, sharpness_of(track)
            )
            if way is not None:
                inside = way.cut(track.vehicle.length / 2.0, way.length - track.vehicle.length / 2.0)
                sketch.sweep(inside, track.vehicle.length, track.vehicle.width + 2.0 * _SWEPT)
    return _finished(name, sketch, arms, config)


def draw_roundabout(tracks: tuple[Track, ...] | None, centre: Floats, config: RoadConfig) -> Road:
    """Draw a roundabout of one lane, as large as the template's speeds need, with arms where it comes and goes.

    Args:
        tracks: the template's; None: plain sizes.
        centre: (2,) [m] of the template's junction.
        config: how it is drawn.

    Raises:
        RefusedError: the template drives too fast for it, side by side, or by more than four arms.
    """
    fastest, plans = 6.0, [_Plan(k * np.pi / 2.0, []) for k in range(4)]
    if tracks is not None:
        fastest = max(float(track.speed[track.present[0] : track.present[1] + 1].max()) for track in tracks)
        plans = _arms("roundabout", tracks, [end for i, track in enumerate(tracks) for end in _ends(i, track, centre)])
    radius = float(np.clip(np.square(fastest) / _RING_LATERAL, *_RING))
    if fastest > np.sqrt(_RING_FASTEST * radius):
        possible = float(np.sqrt(_RING_FASTEST * _RING[1]))
        raise RefusedError(
            f"road roundabout: the template drives up to {fastest:.1f} m/s, and the largest one ({_RING[1]:g} m) allows "
            f"{possible:.1f} m/s; choose four_way or curve"
        )
    turn = np.pi - plans[0].yaw
    sketch, arms, width = Sketch(), [], config.lane_width
    for plan in plans:
        most = max((lane for lane in _lanes(plan, centre, config)[1].values()), default=0) if plan.members else 0
        both = len({end.inward for end in plan.members}) == 2
        if tracks is not None and most > 0 and not both:
            raise RefusedError(f"road roundabout has one lane, and the template drives in {most + 1} beside each other")
        needs = [end.away + tracks[end.vehicle].vehicle.length / 2.0 for end in plan.members] if tracks is not None else []
        reach = config.arm_length or max(max(needs, default=0.0) + _ROOM + 2.0 * _SLACK, radius + _SHORTEST)
        yaw = plan.yaw + turn
        out = np.array([exact.cos(yaw), exact.sin(yaw)])
        arm = _ArmPlan(np.array([*(reach * out), yaw]), 1, 1)
        sketch.strip(Curve(np.array([[*(radius * out), yaw], arm.pose])), -width, width)
        arms.append(arm)
    around = np.linspace(0.0, 2.0 * np.pi, 97)
    unit = np.column_stack((exact.cos(around), exact.sin(around)))
    half = width / 2.0 + RING_ROOM
    sketch.drivable.append((radius + half) * unit)
    sketch.islands.append((radius - half) * unit)
    length, wide = 5.0, 2.0
    if tracks is not None:
        length, wide = (max(getattr(track.vehicle, name) for track in tracks) for name in ("length", "width"))
    for a in arms:
        for b in arms:
            way = draw_ring_route(
                a.lane(0, config, inward=True), b.lane(0, config, inward=False), np.zeros(2), radius, lambda _: True
            )
            if way is not None:
                sketch.sweep(way.cut(length / 2.0, way.length - length / 2.0), length, wide + 2.0 * _SWEPT)
    return _finished("roundabout", sketch, arms, config)


def _ends(i: int, track: Track, centre: Floats) -> list[_End]:
    s = np.arange(0.0, max(track.travelled, 0.5) + 0.25, 0.5)
    poses = track.curve.at(s)
    found = []
    turn = turn_of(track)
    goes_on = 0.0 if abs(turn) < _THROUGH else float(np.sign(turn))
    for inward in (True, False):
        along = poses if inward else poses[::-1]
        steady = np.flatnonzero(np.abs(along[:, 2] - along[0, 2]) > _STEADY)
        last = int(steady[0]) if len(steady) else len(along) - 1
        nearest = int(np.argmin(np.square(along[:, :2] - centre).sum(axis=1)))
        last = min(last, nearest)  # not beyond the junction
        yaw = float(np.median(along[: last + 1, 2])) + (np.pi if inward else 0.0)
        out = np.array([exact.cos(yaw), exact.sin(yaw)])
        away = float(((along[0, :2] - centre) * out).sum())
        at = along[nearest if abs(turn) < _THROUGH else last, :2]
        found.append(_End(i, inward, yaw, at, away, last * 0.5, goes_on * (-1.0 if inward else 1.0)))
    if track.still:
        return [max(found, key=lambda end: end.away)]  # it stands on the arm on which it is
    return found


def _arms(name: str, tracks: tuple[Track, ...], ends: list[_End]) -> list[_Plan]:
    """Directions of the arms with their members, as many as the road has."""
    count = ARM_COUNT[name]
    plans: list[_Plan] = []
    reached = [end for end in ends if end.away > 0.0]
    for end in sorted(reached, key=lambda end: (-min(end.steady, 20.0), end.vehicle, end.inward)):
        near = [plan for plan in plans if _joins(end, plan)]
        if near:
            plan = min(near, key=lambda plan: abs(_off(plan.yaw, end.yaw)))
            plan.members.append(end)
            plan.yaw = _mean([m for m in plan.members if m.steady >= _SURE] or plan.members)
        else:
            plans.append(_Plan(end.yaw, [end]))
    while len(plans) > count:
        pairs = [(abs(_off(a.yaw, b.yaw)), j, k) for j, a in enumerate(plans) for k, b in enumerate(plans[:j])]
        apart, j, k = min(pairs)
        if apart > _MERGED:
            who = ", ".join(tracks[plan.members[0].vehicle].vehicle.id for plan in plans)
            raise RefusedError(
                f"road {name} has {count} arms, and the template comes and goes by {len(plans)} (one each: vehicles "
                f"{who}); choose another road"
            )
        plans[k].members += plans[j].members
        plans[k].yaw = _mean(plans[k].members)
        del plans[j]
    for end in ends:
        if end.away <= 0.0:  # not reached: any arm ahead will do
            near = [plan for plan in plans if _joins(end, plan)]
            if near:
                min(near, key=lambda plan: abs(_off(plan.yaw, end.yaw))).members.append(end)
            elif len(plans) < count and not any(abs(_off(plan.yaw, end.yaw)) < _MERGED for plan in plans):
                plans.append(_Plan(end.yaw, [end]))
    while len(plans) < count:
        wanted = [plan.yaw + k * np.pi / 2.0 for plan in plans for k in (2, 1, 3)]
        free = [min(abs(_off(yaw, plan.yaw)) for plan in plans) for yaw in wanted]
        plans.append(_Plan(wanted[int(np.argmax(np.round(np.minimum(free, np.pi / 2.0), 6)))], []))
    return plans


def _joins(end: _End, plan: _Plan) -> bool:
    off = _off(plan.yaw, end.yaw)
    if abs(off) < _SAME_ARM:
        return True
    return end.steady < _SURE and off * end.turning > 0.0 and abs(off) < _PART


def _off(yaw: float, other: float) -> float:
    return float(wrap_angle(np.asarray(yaw - other)))


def _mean(ends: list[_End]) -> float:
    first = ends[0].yaw
    weight = np.array([max(min(end.steady, 20.0), 0.5) for end in ends])
    off = np.array([_off(end.yaw, first) for end in ends])
    return first + float((weight * off).sum() / weight.sum())


def _lanes(plan: _Plan, centre: Floats, config: RoadConfig) -> tuple[float, dict[tuple[int, bool], int]]:
    """How far left of the centre, looking outward, the arm's dividing line lies, and the lane of each member."""
    left = np.array([-exact.sin(plan.yaw), exact.cos(plan.yaw)])
    keep = 1.0 if config.traffic_side == "right" else -1.0
    width = config.lane_width
    lanes: dict[tuple[int, bool], int] = {}
    lines: list[tuple[float, float]] = []  # offset, and where it lies in widths from the dividing line
    innermost = {}
    sure = [end for end in plan.members if end.away > 0.0 and end.steady >= _SURE / 2.0] or plan.members
    for inward in (True, False):
        sign = keep if inward else -keep  # lanes in lie to the left of who looks outward
        offsets = sorted((sign * float(((end.at - centre) * left).sum()), end.vehicle) for end in sure if end.inward == inward)
        lane = 0
        group: list[float] = []
        for offset, vehicle in offsets:
            if group and offset - float(np.mean(group)) > _LANE_GAP:
                lane += max(1, round((offset - float(np.mean(group))) / width))
                group = []
            group.append(offset)
            lanes[vehicle, inward] = lane
        if offsets:
            innermost[inward] = sign * offsets[0][0]
    if len(innermost) == 2:
        between = keep * (innermost[True] - innermost[False])
        free = min(max(round(between / width) - 1, 0), _MOST_BETWEEN)
        shift = {True: (free + 1) // 2, False: free // 2}
        lanes = {end: lane + shift[end[1]] for end, lane in lanes.items()}
    for end in sure:
        sign = keep if end.inward else -keep
        offset = float(((end.at - centre) * left).sum())
        lines.append((offset, sign * (lanes[end.vehicle, end.inward] + 0.5) * width))
    middle = float(np.mean([offset - own for offset, own in lines])) if lines else 0.0
    for end in plan.members:  # who has not come to its end of the junction takes the lane that is nearest to where it would
        if (end.vehicle, end.inward) not in lanes:
            sign = keep if end.inward else -keep
            nearest = round(sign * (float(((end.at - centre) * left).sum()) - middle) / width - 0.5)
            most = max([lane for (_, inward), lane in lanes.items() if inward == end.inward], default=0)
            lanes[end.vehicle, end.inward] = min(max(nearest, 0), most)
    return middle, lanes


def _draw_arms(sketch: Sketch, arms: list[_ArmPlan], config: RoadConfig) -> None:
    """Strips from the middle outwards, the corners between neighbours, and the middle itself."""
    width, keep_right = config.lane_width, config.traffic_side == "right"
    order = sorted(arms, key=lambda arm: arm.pose[2] % (2.0 * np.pi))
    inner = []
    for arm in order:
        out = np.array([exact.cos(arm.pose[2]), exact.sin(arm.pose[2]), 0.0])
        reach = float((arm.pose * out).sum())
        start = arm.pose - reach * out
        lefts = arm.inward if keep_right else arm.outward
        rights = arm.outward if keep_right else arm.inward
        sketch.strip(Curve(np.stack((start, arm.pose))), -rights * width, lefts * width)
        inner.append((start, float(-rights * width), float(lefts * width)))
    middle = []
    for k, (pose, right, high) in enumerate(inner):
        other, low, _ = inner[(k + 1) % len(inner)]
        one, two = pose[2], other[2]
        normal = np.array([-exact.sin(one), exact.cos(one)])
        a = pose[:2] + high * normal
        b = other[:2] + low * np.array([-exact.sin(two), exact.cos(two)])
        middle += [a, pose[:2] + right * normal]
        turn = float((two - one) % (2.0 * np.pi))
        if 0.05 < turn < np.radians(165.0):
            gap = b - a
            along = float(gap[0] * exact.sin(two) - gap[1] * exact.cos(two)) / exact.sin(turn)
            corner = a + along * np.array([exact.cos(one), exact.sin(one)])
            sketch.corner(corner, one, two, config.corner_radius)
            if abs(along) < _WIDE_JUNCTION:
                middle.append(corner)
    sketch.drivable.append(convex_hull(np.array(middle)))
