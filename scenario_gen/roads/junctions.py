# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Junctions and roundabouts shaped to a template: arms where it comes and goes, lanes where it drives, as wide as it needs.

Each arm has its dividing line and lanes where the recorded vehicles were, to the nearest lane; and every vehicle's way through,
with the template's own curvature, is swept into the road, so there is room for it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import Floats
from scenario_gen.numerics.plane import angle_between, unit, unit_left
from scenario_gen.roads.builtin import junction_centre
from scenario_gen.roads.config import RoadConfig
from scenario_gen.roads.drawn import aligned, Arm, draw_plan, Driven, Plan
from scenario_gen.roads.pavement import ARM_COUNT, LANE_GAP, ROOM, SHORTEST, SLACK
from scenario_gen.roads.shaped import fitting_width
from scenario_gen.roads.ways import draw_ring_route, draw_route
from scenario_gen.situation import (
    driver_rows,
    sharpness_of,
    Situation,
    Track,
    turn_of,
)
from scenario_gen.types import (
    Encounter,
    Note,
    NoteKind,
    Road,
    YIELD,
)

_RING = (
    13.0,
    45.0,
)  # metres, smallest and largest radius of a roundabout's lane where none was recorded
_LEAST_RING = 8.0  # metres, of one that was recorded
_RING_LATERAL, _RING_FASTEST = (
    3.0,
    4.0,
)  # m/s² at the template's fastest: as it is sized, and at most
_NEAR_RING = (
    4.0  # metres beyond the middle of its lane within which a vehicle's speed is one on the ring
)
_EVERY = 1.0  # metres between the poses of a path by which a ring is found
_WIDEST_RING = 60.0  # metres of its radius, in the template
_LEAST_ARC = 12.0  # metres that are driven about it
_OFF_RING = 2.5  # metres to its lane
_FLARED = np.radians(15.0)  # by which those who come or go turn away from it
_CIRCLED = np.radians(100.0)  # about it, from which on one who neither comes nor goes is on a ring
_SAME_ARM = np.radians(30.0)  # directions that differ by less are those of one arm
_MERGED = np.radians(45.0)  # and by so much if the road has too few arms otherwise
_PART = np.radians(75.0)  # a vehicle that is still turning may go on by so much to an arm
_STEADY = np.radians(6.0)  # a path that turns by less near its end shows the arm's direction
_THROUGH = np.radians(20.0)  # who turns by less goes straight through, on one line
_SURE = 5.0  # metres of such a path from which on its direction is sure
_MOST_BETWEEN = 4  # lanes left free between the two directions, at most
_MOST_LANES = 8
_SWEPT = 0.6  # metres of room beside a footprint on its way through the junction


@dataclass(frozen=True, eq=False)
class _End:
    """One end of a vehicle's path: where it comes from or goes to.

    Attributes:
        vehicle: its index.
        inward: True for the start.
        yaw: direction [rad] out of the junction.
        at: (2,) where the steady part of the path begins, seen from the junction, in metres from its centre.
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

    @property
    def key(self) -> tuple[int, bool]:
        """Its vehicle, and whether that comes in."""
        return self.vehicle, self.inward


@dataclass(eq=False)
class _Direction:
    """A direction [rad] in which an arm leads, and the ends of paths that lie on it."""

    yaw: float
    members: list[_End]

    def reach(self, tracks: tuple[Track, ...]) -> float:
        """How far [m] from the centre its members' footprints reach."""
        return max(
            [end.away + tracks[end.vehicle].vehicle.length / 2.0 for end in self.members],
            default=0.0,
        )


def draw_junction(name: str, situation: Situation, config: RoadConfig) -> Road:
    """Draw a junction whose arms are where the template comes and goes.

    Args:
        name: `t_intersection` or `four_way`.
        situation: of the template.
        config: how it is drawn.

    Raises:
        RefusedError: the template needs more arms or lanes than the road has, or the grid would be too large.
    """
    tracks = situation.drivers
    centre = junction_centre(tracks)
    directions = _directions(name, tracks, centre)
    longest = max(
        directions, key=lambda direction: max((end.away for end in direction.members), default=0.0)
    )
    turn = np.pi - longest.yaw  # the longest arm leads west
    lane_of: dict[tuple[int, bool], tuple[int, int]] = {}  # arm and lane of each end
    arms: list[Arm] = []
    for direction in directions:
        offset, lanes = _lanes(direction, config)
        reach = config.arm_length or max(direction.reach(tracks) + ROOM + SLACK, SHORTEST)
        yaw = direction.yaw + turn
        most = [_most(lanes, inward=inward) + 1 for inward in (True, False)]
        if max(most) > _MOST_LANES:
            raise RefusedError(
                f"road {name} would need {max(most)} lanes in one direction; {_MOST_LANES} are drawn at most"
            )
        arm = Arm.towards(yaw, reach, 0, offset)
        arms.append(Arm(arm.pose, *(max(count, config.lanes) for count in most)))
        lane_of.update({key: (len(arms) - 1, lane) for key, lane in lanes.items()})
    driven = []
    for i, track in enumerate(tracks):
        if (i, True) in lane_of and (i, False) in lane_of and not track.still:
            (a, first), (b, last) = lane_of[i, True], lane_of[i, False]
            ends = (
                arms[a].lane(first, config, inward=True),
                arms[b].lane(last, config, inward=False),
            )
            way = draw_route(*ends, sharpness=sharpness_of(track))
            if way is not None:
                driven.append(
                    Driven(
                        (a, first, b, last),
                        way,
                        track.vehicle.length,
                        track.vehicle.width + 2.0 * _SWEPT,
                    )
                )
    aim = aligned(tracks, lane_of, np.array([*centre, 0.0]), np.array([0.0, 0.0, turn]))
    yielding = _yielding_arms(situation, lane_of, config)
    return draw_plan(Plan(arms, driven=driven, yielding=yielding, drawn_for=aim), name, config)


def _yielding_arms(
    situation: Situation, lane_of: Mapping[tuple[int, bool], tuple[int, int]], config: RoadConfig
) -> set[int]:
    """Return the arms of those who yield to others of other arms, but for those to whom somebody yields.

    Args:
        situation: of the template.
        lane_of: arm and lane of the ends of the tracks of those who drive, by vehicle and whether it comes in.
        config: whether priorities are shown.
    """
    came_by = {vehicle: arm for (vehicle, inward), (arm, _) in lane_of.items() if inward}
    edges, rows = (
        situation.reactions.edges if config.priority == "auto" else (),
        driver_rows(situation.encounter),
    )
    yields = [(rows.get(e.who, -1), rows.get(e.whom, -1)) for e in edges if e.kind == YIELD]
    ways = [(came_by[who], came_by[whom]) for who, whom in yields if {who, whom} <= came_by.keys()]
    pairs = [(arm, other) for arm, other in ways if arm != other]
    return {arm for arm, _ in pairs} - {other for _, other in pairs}


def draw_roundabout(name: str, encounter: Encounter | None, config: RoadConfig) -> Road:
    """Draw a roundabout of one lane, as large as the template's speeds need, with arms where it comes and goes.

    Raises:
        RefusedError: the template drives too fast for it, side by side, or by more than four arms.
    """
    radius, fastest, length, wide, notes = _RING[0], 0.0, 5.0, 2.0, list[Note]()
    directions = [_Direction(k * np.pi / 2.0, []) for k in range(4)]
    tracks: tuple[Track, ...] = ()
    situation: Situation | None = None
    centre = np.zeros(2)
    if encounter is not None:
        situation = Situation.of(encounter)
        tracks = situation.drivers
        config = fitting_width(tracks, config)
        driven_about = _ring_driven(tracks, config)
        centre = junction_centre(tracks) if driven_about is None else driven_about[0]
        radius, fastest = _ring(tracks, centre, None if driven_about is None else driven_about[1])
        length, wide = (
            max(getattr(track.vehicle, size) for track in tracks) for size in ("length", "width")
        )
        directions = _directions(name, tracks, centre, radius + _NEAR_RING)
        if driven_about is None:
            notes.append(Note.of(NoteKind.NO_RING, radius=radius))
    if fastest > np.sqrt(_RING_FASTEST * radius):
        possible = float(np.sqrt(_RING_FASTEST * _RING[1]))
        raise RefusedError(
            f"road roundabout: the recording drives up to {fastest:.1f} m/s where the ring would be, and the largest one "
            f"({_RING[1]:g} m) allows {possible:.1f} m/s"
        )
    turn = np.pi - directions[0].yaw
    arms = []
    for direction in directions:
        straight = replace(
            direction, members=[end for end in direction.members if end.steady >= 2.0 * _SURE]
        )
        most = max(_lanes(straight, config)[1].values(), default=0)
        if most > 0 and len({end.inward for end in direction.members}) < 2:
            raise RefusedError(
                f"road roundabout has one lane, and the recording drives in {most + 1} beside each other"
            )
        reach = config.arm_length or max(
            direction.reach(tracks) + ROOM + 2.0 * SLACK, radius + SHORTEST
        )
        yaw = direction.yaw + turn
        arms.append(Arm.towards(yaw, reach, 1))
    driven = []
    for a, b in product(range(len(arms)), repeat=2):
        ends = arms[a].lane(0, config, inward=True), arms[b].lane(0, config, inward=False)
        way = draw_ring_route(*ends, np.zeros(2), radius)
        if way is not None:
            driven.append(Driven((a, 0, b, 0), way, length, wide + 2.0 * _SWEPT))
    lane_of = {
        end.key: (a, 0) for a, direction in enumerate(directions) for end in direction.members
    }
    aim = aligned(tracks, lane_of, np.array([*centre, 0.0]), np.array([0.0, 0.0, turn]))
    yielding = set(range(len(arms))) - {arm for (_, inward), (arm, _) in lane_of.items() if inward}
    yielding |= set() if situation is None else _yielding_arms(situation, lane_of, config)
    plan = Plan(
        arms, driven=driven, ring=radius, yielding=yielding, drawn_for=aim, notes=tuple(notes)
    )
    return draw_plan(plan, name, config)


def drives_about_ring(situation: Situation, config: RoadConfig) -> bool:
    """Whether somebody in the template drives about the ring of a roundabout."""
    return _ring_driven(situation.drivers, config) is not None


def _ring_driven(tracks: tuple[Track, ...], config: RoadConfig) -> tuple[Floats, float] | None:
    """Centre (2,) and radius [m] of the circle about which those drive who bend to the other side before or after, or go far.

    None where nobody does.
    """
    sign, points = 1.0 if config.traffic_side == "right" else -1.0, np.zeros((0, 2))
    for track in tracks:
        poses = track.curve.at(np.arange(0.0, track.travelled, _EVERY))
        turned = (
            sign * np.gradient(np.convolve(poses[:, 2], np.full(5, 0.2), "same"))
            if len(poses) > 9
            else np.zeros(len(poses))
        )
        turned[:3] = turned[-3:] = 0.0
        about = turned > _EVERY / _WIDEST_RING
        if -turned[turned < 0.0].sum() > _FLARED or turned[about].sum() > _CIRCLED:
            points = np.concatenate((points, poses[about, :2]))
    for _ in range(3):
        if len(points) < _LEAST_ARC / _EVERY:
            break
        rows = np.column_stack((2.0 * points, np.ones(len(points))))
        x, y, rest = np.linalg.lstsq(rows, np.square(points).sum(axis=1), rcond=None)[0]
        centre, radius = np.array([x, y]), float(np.sqrt(rest + x * x + y * y))
        near = np.abs(np.hypot(*(points - centre).T) - radius) < _OFF_RING
        if near.all() and radius < _WIDEST_RING:
            return centre, max(radius, _LEAST_RING)
        points = points[near]
    return None


def _ring(
    tracks: tuple[Track, ...], centre: Floats, recorded: float | None
) -> tuple[float, float]:
    """The radius [m] of a roundabout's lane that suits the template's speeds on it, not on its arms; the fastest [m/s] there.

    One that was recorded is drawn as it was, if cars can drive it so fast.
    """
    there = [slice(track.present[0], track.present[1] + 1) for track in tracks]
    speed = np.concatenate([track.speed[own] for track, own in zip(tracks, there, strict=True)])
    place = np.concatenate(
        [track.poses[own, :2] for track, own in zip(tracks, there, strict=True)]
    )
    away = np.hypot(*(place - centre).T)
    if recorded is not None:
        fastest = float(speed[away < recorded + _OFF_RING].max(initial=0.0))
        return min(max(recorded, fastest**2 / _RING_FASTEST), _RING[1]), fastest
    for radius in np.append(np.arange(*_RING, 0.25), _RING[1]):
        fastest = float(speed[away < radius + _NEAR_RING].max(initial=0.0))
        if np.square(fastest) <= _RING_LATERAL * radius:
            break
    return float(radius), fastest


def _ends(i: int, track: Track, centre: Floats, ring: float) -> list[_End]:
    s = np.arange(0.0, max(track.travelled, 0.5) + 0.25, 0.5)
    poses = track.curve.at(s) - np.array([*centre, 0.0])
    ends = []
    turn = turn_of(track)
    goes_on = 0.0 if ring or abs(turn) < _THROUGH else float(np.sign(turn))
    for inward in (True, False):
        along = poses if inward else poses[::-1]
        turning = np.flatnonzero(np.abs(along[:, 2] - along[0, 2]) > _STEADY)
        nearest = int(np.argmin(np.square(along[:, :2]).sum(axis=1)))
        last = min(
            int(turning[0]) if len(turning) else len(along) - 1, nearest
        )  # not beyond the junction
        yaw = float(np.median(along[: last + 1, 2])) + (np.pi if inward else 0.0)
        if ring and last * 0.5 < 2.0 * _SURE:  # still bending: arms lead straight to the middle
            yaw = float(np.arctan2(*along[0, 1::-1]))
        away = float((along[0, :2] * unit(yaw)).sum())
        at = along[nearest if abs(turn) < _THROUGH and not ring else last, :2]
        ends.append(
            _End(i, inward, yaw, at, away, last * 0.5, goes_on * (-1.0 if inward else 1.0))
        )
    if track.still:
        return [max(ends, key=lambda end: end.away)]  # it stands on the arm on which it is
    return ends


def _directions(
    name: str, tracks: tuple[Track, ...], centre: Floats, ring: float = 0.0
) -> list[_Direction]:
    """Directions of the arms about a centre (2,) [m] with their members, as many as the road has; an end on a ring is on none."""
    count = ARM_COUNT[name]
    ends = [
        end
        for i, track in enumerate(tracks)
        for end in _ends(i, track, centre, ring)
        if not ring or end.away > ring
    ]
    directions: list[_Direction] = []
    reached = [end for end in ends if end.away > 0.0]
    for end in sorted(reached, key=lambda end: (-min(end.steady, 20.0), end.vehicle, end.inward)):
        nearest = _nearest(end, directions)
        if nearest is None:
            directions.append(_Direction(end.yaw, [end]))
        else:
            nearest.members.append(end)
            nearest.yaw = _mean(
                [m for m in nearest.members if m.steady >= _SURE] or nearest.members
            )
    while len(directions) > count:
        pairs = [
            (abs(angle_between(a.yaw, b.yaw)), j, k)
            for j, a in enumerate(directions)
            for k, b in enumerate(directions[:j])
        ]
        apart, j, k = min(pairs)
        if apart > _MERGED:
            who = ", ".join(
                tracks[direction.members[0].vehicle].vehicle.id for direction in directions
            )
            raise RefusedError(
                f"road {name} has {count} arms, and the recorded vehicles enter and leave by {len(directions)} (one each: "
                f"vehicles {who}); choose another road"
            )
        directions[k].members += directions[j].members
        directions[k].yaw = _mean(directions[k].members)
        del directions[j]
    for end in ends:
        if end.away <= 0.0:  # not reached: any arm ahead will do
            nearest = _nearest(end, directions)
            if nearest is not None:
                nearest.members.append(end)
            elif len(directions) < count and not any(
                abs(angle_between(other.yaw, end.yaw)) < _MERGED for other in directions
            ):
                directions.append(_Direction(end.yaw, [end]))
    directions = directions or [_Direction(0.0, [])]  # all ends are on the ring
    while len(directions) < count:
        yaws = [direction.yaw + k * np.pi / 2.0 for direction in directions for k in (2, 1, 3)]
        free = [
            min(abs(angle_between(yaw, direction.yaw)) for direction in directions) for yaw in yaws
        ]
        directions.append(
            _Direction(yaws[int(np.argmax(np.round(np.minimum(free, np.pi / 2.0), 6)))], [])
        )
    return directions


def _nearest(end: _End, directions: list[_Direction]) -> _Direction | None:
    """The direction that an end of a path belongs to; None if it has one of its own."""

    def joins(direction: _Direction) -> bool:
        off = angle_between(direction.yaw, end.yaw)
        return abs(off) < _SAME_ARM or (
            end.steady < _SURE and off * end.turning > 0.0 and abs(off) < _PART
        )

    return min(
        filter(joins, directions),
        key=lambda near: abs(angle_between(near.yaw, end.yaw)),
        default=None,
    )


def _mean(ends: list[_End]) -> float:
    first = ends[0].yaw
    weight = np.array([max(min(end.steady, 20.0), 0.5) for end in ends])
    off = np.array([angle_between(end.yaw, first) for end in ends])
    return first + float((weight * off).sum() / weight.sum())


def _lanes(direction: _Direction, config: RoadConfig) -> tuple[float, dict[tuple[int, bool], int]]:
    """How far left of the centre, looking outward, the arm's dividing line lies, and the lane of each member."""
    keep = 1.0 if config.traffic_side == "right" else -1.0
    sign = {True: keep, False: -keep}  # lanes in lie to the left of who looks outward
    left, width = unit_left(direction.yaw), config.lane_width
    offset = {end.key: float((end.at * left).sum()) for end in direction.members}
    sure = [
        end.key for end in direction.members if end.away > 0.0 and end.steady >= _SURE / 2.0
    ] or list(offset)
    lanes: dict[tuple[int, bool], int] = {}
    innermost = {}
    for inward in (True, False):
        own = sorted((sign[inward] * offset[key], key[0]) for key in sure if key[1] == inward)
        lane = 0
        group: list[float] = []
        for aside, vehicle in own:
            if group and aside - float(np.mean(group)) > LANE_GAP:
                lane += max(1, round((aside - float(np.mean(group))) / width))
                group = []
            group.append(aside)
            lanes[vehicle, inward] = lane
        if own:
            innermost[inward] = sign[inward] * own[0][0]
    if len(innermost) == 2:
        between = keep * (innermost[True] - innermost[False])
        free = min(max(round(between / width) - 1, 0), _MOST_BETWEEN)
        lanes = {
            key: lane + ((free + 1) // 2 if key[1] else free // 2) for key, lane in lanes.items()
        }
    lines = [offset[key] - sign[key[1]] * (lanes[key] + 0.5) * width for key in sure]
    middle = float(np.mean(lines)) if lines else 0.0
    for (
        key,
        aside,
    ) in (
        offset.items()
    ):  # who has not reached the junction's end takes the lane nearest to where it would
        if key not in lanes:
            nearest = round(sign[key[1]] * (aside - middle) / width - 0.5)
            lanes[key] = min(max(nearest, 0), _most(lanes, inward=key[1]))
    return middle, lanes


def _most(lanes: dict[tuple[int, bool], int], *, inward: bool) -> int:
    """The outermost lane in one direction."""
    return max([lane for (_, own), lane in lanes.items() if own == inward], default=0)
