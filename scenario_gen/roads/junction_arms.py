# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The arms of a junction that is drawn for a recording: where its vehicles come from and go to."""

from dataclasses import dataclass

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import angle_between, Floats, unit, unit_left
from scenario_gen.roads.config import RoadConfig
from scenario_gen.roads.pavement import ARM_COUNT, LANE_GAP_M
from scenario_gen.situation import pair_crossings, Track, turn_of

EndKey = tuple[int, bool]
"""A vehicle, and whether the end of its path is the start."""

SURE_LENGTH_M = 5.0
"""Of a steady path, from which its direction is certain."""
_SAME_ARM_RAD = np.radians(30.0)
_MERGED_ARMS_RAD = np.radians(45.0)  # if the road has too few arms otherwise
_MAX_REMAINING_TURN_RAD = np.radians(75.0)  # of a vehicle that is still turning into an arm
_UNNOTICED_TURN_RAD = np.radians(12.0)  # of an arm
_STEADY_TURN_RAD = np.radians(6.0)
_STRAIGHT_THROUGH_RAD = np.radians(20.0)
_U_TURN_WIDTH_M = 12.0  # between the lanes of a U-turn
_MAX_LANES_BETWEEN_COUNT = 4  # left free between the two directions


@dataclass(frozen=True, eq=False)
class PathEnd:
    """One end of a vehicle's path: where it comes from or goes to.

    Attributes:
        vehicle: its index.
        inward: whether it is the start.
        yaw: direction [rad] out of the junction.
        steady_begin: (2,) [m] from the junction's centre, where the steady part of the path
            begins, seen from the junction.
        distance: [m] from the centre to the path's end along `yaw`; negative if the vehicle does
            not get that far.
        steady: [m] near the end on which the path hardly turns.
        turning: the sign of the rest of its turn, seen along `yaw`; 0 if it goes straight on.
    """

    vehicle: int
    inward: bool
    yaw: float
    steady_begin: Floats
    distance: float
    steady: float
    turning: float

    @property
    def key(self) -> EndKey:
        """Its vehicle, and whether it is the start."""
        return self.vehicle, self.inward

    @property
    def reaches_arm(self) -> bool:
        """Whether the vehicle gets as far as the arm."""
        return self.distance > 0.0


@dataclass(eq=False)
class ArmDirection:
    """An arm of a junction.

    Attributes:
        yaw: the recorded direction [rad].
        ends: of the paths on it.
        turned: [rad] by which it is drawn in another direction.
        least_reach: [m] from the centre, without ends.
    """

    yaw: float
    ends: list[PathEnd]
    turned: float = 0.0
    least_reach: float = 0.0

    @property
    def drawn(self) -> float:
        """The direction [rad] in which it is drawn."""
        return self.yaw + self.turned

    def reach(self, tracks: tuple[Track, ...]) -> float:
        """Return how far [m] from the centre the footprints on it reach."""
        distances = [end.distance + tracks[end.vehicle].vehicle.rear for end in self.ends]
        return max(distances, default=self.least_reach)


@dataclass(frozen=True)
class ArmLanes:
    """The lanes of the ends on an arm.

    Attributes:
        offset: [m] of the dividing line to the left of the centre, looking outward.
        lane_of: the lane of each end, counted from the dividing line.
    """

    offset: float
    lane_of: dict[EndKey, int]

    def count(self, *, inward: bool) -> int:
        """Return how many lanes one direction needs."""
        lanes = (lane for key, lane in self.lane_of.items() if key[1] == inward)
        return max(lanes, default=0) + 1


def junction_centre(tracks: tuple[Track, ...]) -> Floats:
    """Return (2,) [m] the mean of the places where paths cross and turn.

    Without any it is the mean of all recorded positions.
    """
    crossings = list(pair_crossings(tracks))
    points: list[Floats] = []
    for i, track in enumerate(tracks):
        points += [track.curve.at(crossing.first)[:2] for k, _, crossing in crossings if k == i]
        if track.turns and not points:
            points.append(track.curve.points[_middle_of_turn(track), :2])
    if not points:
        points = [track.poses[:, :2].mean(axis=0) for track in tracks]
    return np.asarray(np.mean(points, axis=0))


def _middle_of_turn(track: Track) -> int:
    """Return the index of the path's point at which half of its turn is done."""
    yaw = track.curve.points[:, 2]
    return int(np.argmin(np.abs(yaw - (yaw[0] + yaw[-1]) / 2.0)))


def find_arms(
    name: str, tracks: tuple[Track, ...], centre: Floats, ring: float = 0.0
) -> list[ArmDirection]:
    """Return the arms of a road about a centre (2,) [m], as many as it has.

    Ends of paths within `ring` [m] of a roundabout's centre are on no arm.

    Raises:
        RefusedError: the recording needs more arms.
    """
    ends = [
        end
        for i, track in enumerate(tracks)
        for end in _path_ends(i, track, centre, ring)
        if not ring or end.distance > ring
    ]
    arms = _cluster([end for end in ends if end.reaches_arm])
    _merge_to_count(name, arms, tracks)
    _assign_unreached(name, arms, [end for end in ends if not end.reaches_arm])
    _make_regular(arms, tracks)
    if not arms:  # all ends are on the ring
        arms.append(ArmDirection(0.0, []))
    _fill_to_count(name, arms)
    return arms


def _path_ends(i: int, track: Track, centre: Floats, ring: float) -> list[PathEnd]:
    """Return both ends of a track; of a vehicle that stands throughout the outer one."""
    stations = np.arange(0.0, max(track.travelled, 0.5) + 0.25, 0.5)
    poses = track.curve.at(stations) - np.array([*centre, 0.0])
    is_straight = abs(turn_of(track)) < _STRAIGHT_THROUGH_RAD
    remaining_turn = 0.0 if ring or is_straight else float(np.sign(turn_of(track)))
    ends = []
    for inward in (True, False):
        along = poses if inward else poses[::-1]
        turning = np.flatnonzero(np.abs(along[:, 2] - along[0, 2]) > _STEADY_TURN_RAD)
        nearest = int(np.argmin(np.square(along[:, :2]).sum(axis=1)))
        first_turn = int(turning[0]) if len(turning) else len(along) - 1
        last = min(first_turn, nearest)
        steady = last * 0.5
        yaw = float(np.median(along[: last + 1, 2])) + (np.pi if inward else 0.0)
        if ring and steady < 2.0 * SURE_LENGTH_M:  # still bending: arms lead to the centre
            yaw = float(np.arctan2(*along[0, 1::-1]))
        end = PathEnd(
            vehicle=i,
            inward=inward,
            yaw=yaw,
            steady_begin=along[nearest if is_straight and not ring else last, :2],
            distance=float((along[0, :2] * unit(yaw)).sum()),
            steady=steady,
            turning=remaining_turn * (-1.0 if inward else 1.0),
        )
        ends.append(end)
    return [max(ends, key=lambda end: end.distance)] if track.still else ends


def _cluster(ends: list[PathEnd]) -> list[ArmDirection]:
    """Return the directions of some ends, those with the longest steady part first."""
    arms: list[ArmDirection] = []
    for end in sorted(ends, key=lambda end: (-min(end.steady, 20.0), end.vehicle, end.inward)):
        arm = _arm_of(end, arms)
        if arm is None:
            arms.append(ArmDirection(end.yaw, [end]))
        else:
            arm.ends.append(end)
            sure = [each for each in arm.ends if each.steady >= SURE_LENGTH_M]
            arm.yaw = _mean_yaw(sure or arm.ends)
    return arms


def _merge_to_count(name: str, arms: list[ArmDirection], tracks: tuple[Track, ...]) -> None:
    """Merge the nearest arms until a road has no more than its number."""
    while len(arms) > ARM_COUNT[name]:
        pairs = [
            (abs(angle_between(arm.yaw, other.yaw)), j, k)
            for j, arm in enumerate(arms)
            for k, other in enumerate(arms[:j])
        ]
        angle, j, k = min(pairs)
        if angle > _MERGED_ARMS_RAD:
            ids = dict.fromkeys(tracks[arm.ends[0].vehicle].vehicle.id for arm in arms)
            raise RefusedError(
                f"road {name} has {ARM_COUNT[name]} arms, but the recorded vehicles use "
                f"{len(arms)} (for example vehicles {', '.join(ids)}); choose another road"
            )
        arms[k].ends += arms[j].ends
        arms[k].yaw = _mean_yaw(arms[k].ends)
        del arms[j]


def _assign_unreached(name: str, arms: list[ArmDirection], ends: list[PathEnd]) -> None:
    """Assign ends that do not reach an arm to one ahead, or to a new one."""
    for end in ends:
        arm = _arm_of(end, arms)
        if arm is not None:
            arm.ends.append(end)
        elif len(arms) < ARM_COUNT[name]:
            angles = [abs(angle_between(other.yaw, end.yaw)) for other in arms]
            if min(angles, default=np.pi) >= _MERGED_ARMS_RAD:
                arms.append(ArmDirection(end.yaw, [end]))


def _make_regular(arms: list[ArmDirection], tracks: tuple[Track, ...]) -> None:
    """Turn arms towards right angles with the longest one, as far as paths hardly notice it."""
    longest = max(arms, key=lambda arm: arm.reach(tracks), default=None)
    for arm in arms:
        assert longest is not None
        off = angle_between(arm.yaw, longest.yaw)
        deviation = off - np.round(off / (np.pi / 2.0)) * np.pi / 2.0
        arm.turned = -float(np.clip(deviation, -_UNNOTICED_TURN_RAD, _UNNOTICED_TURN_RAD))


def _fill_to_count(name: str, arms: list[ArmDirection]) -> None:
    """Add arms opposite or at right angles to others until a road has its number."""
    while len(arms) < ARM_COUNT[name]:
        yaws = [arm.drawn + k * np.pi / 2.0 for arm in arms for k in (2, 1, 3)]
        free = [min(abs(angle_between(yaw, arm.drawn)) for arm in arms) for yaw in yaws]
        widest = int(np.argmax(np.round(np.minimum(free, np.pi / 2.0), 6)))
        arms.append(ArmDirection(yaws[widest], []))


def _arm_of(end: PathEnd, arms: list[ArmDirection]) -> ArmDirection | None:
    """Return the arm that an end of a path belongs to, if there is one."""

    def belongs(arm: ArmDirection) -> bool:
        off = angle_between(arm.yaw, end.yaw)
        still_turns = end.steady < SURE_LENGTH_M and off * end.turning > 0.0
        return abs(off) < _SAME_ARM_RAD or (still_turns and abs(off) < _MAX_REMAINING_TURN_RAD)

    candidates = filter(belongs, arms)
    return min(candidates, key=lambda arm: abs(angle_between(arm.yaw, end.yaw)), default=None)


def _mean_yaw(ends: list[PathEnd]) -> float:
    """Return the mean direction [rad] of ends, weighted by their steady lengths."""
    first = ends[0].yaw
    weight = np.array([max(min(end.steady, 20.0), 0.5) for end in ends])
    off = np.array([angle_between(end.yaw, first) for end in ends])
    return first + float((weight * off).sum() / weight.sum())


def lanes_of_arm(arm: ArmDirection, config: RoadConfig) -> ArmLanes:
    """Return the lanes of an arm, in which its vehicles are where they were recorded."""
    width = config.lane_width
    # Offsets to the outside of each direction: lanes inward lie to the left, looking outward.
    keeps_right = 1.0 if config.traffic_side == "right" else -1.0
    side = {True: keeps_right, False: -keeps_right}
    outside = {
        end.key: side[end.inward] * float((end.steady_begin * unit_left(arm.yaw)).sum())
        for end in arm.ends
    }
    sure = [end.key for end in arm.ends if end.reaches_arm and end.steady >= SURE_LENGTH_M / 2.0]
    sure = sure or list(outside)
    makes_u_turn = len({end.vehicle for end in arm.ends}) < len(arm.ends)
    least = int(np.ceil(_U_TURN_WIDTH_M / width)) if makes_u_turn else 0
    lane_of = _lanes_of_ends({key: outside[key] for key in sure}, width, least)
    lines = [side[key[1]] * (outside[key] - (lane_of[key] + 0.5) * width) for key in sure]
    dividing_line = float(np.mean(lines or [0.0]))
    for key in outside.keys() - lane_of.keys():  # the nearest lane that the arm already has
        used = [lane_of[other] for other in sure if other[1] is key[1]] or [0]
        nearest = round((outside[key] - side[key[1]] * dividing_line) / width - 0.5)
        lane_of[key] = min(max(nearest, min(used)), max(used))
    return ArmLanes(dividing_line, lane_of)


def _lanes_of_ends(offset: dict[EndKey, float], width: float, least: int) -> dict[EndKey, int]:
    """Return the lane of each end; lanes between the two directions may be left free.

    Their centres are `least` widths apart or more.
    """
    inward = {key: at for key, at in offset.items() if key[1]}
    outward = {key: at for key, at in offset.items() if not key[1]}
    free = 0
    if inward and outward:
        between = max(round((min(inward.values()) + min(outward.values())) / width), least)
        free = min(max(between - 1, 0), _MAX_LANES_BETWEEN_COUNT)
    lanes_in, lanes_out = _numbered_lanes(inward, width), _numbered_lanes(outward, width)
    return {
        **{key: lane + (free + 1) // 2 for key, lane in lanes_in.items()},
        **{key: lane + free // 2 for key, lane in lanes_out.items()},
    }


def _numbered_lanes(offset: dict[EndKey, float], width: float) -> dict[EndKey, int]:
    """Return the lane of each end, from offsets [m] that grow outward."""
    lanes: dict[EndKey, int] = {}
    lane = 0
    group: list[float] = []
    for key in sorted(offset, key=lambda key: (offset[key], key)):
        if group and offset[key] - float(np.mean(group)) > LANE_GAP_M:
            lane += max(1, round((offset[key] - float(np.mean(group))) / width))
            group = []
        group.append(offset[key])
        lanes[key] = lane
    return lanes
