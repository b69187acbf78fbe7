# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Junctions and roundabouts that are drawn for a recording.

They have arms where its vehicles come from and go to, and lanes where they drive, to the nearest
lane. Every vehicle's route through the junction has its recorded curvature and is swept into the
road, so there is room for it.
"""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import Floats, place
from scenario_gen.roads.config import RoadConfig
from scenario_gen.roads.drawn import draw_plan
from scenario_gen.roads.junction_arms import (
    ArmDirection,
    ArmLanes,
    EndKey,
    find_arms,
    junction_centre,
    lanes_of_arm,
)
from scenario_gen.roads.lights import recorded_lights
from scenario_gen.roads.pavement import END_ROOM_M, JUNCTION_SLACK_M, MIN_ARM_M
from scenario_gen.roads.plan import aligned, Arm, Connection, Driven, Plan
from scenario_gen.roads.shaped import fitting_width
from scenario_gen.roads.ways import draw_ring_route, draw_route, draw_u_turn
from scenario_gen.situation import driver_rows, sharpness_of, Situation, to_frenet, Track
from scenario_gen.types import Encounter, Note, NoteKind, Road, YIELD

_MAX_LANES_COUNT = 8
_FACING = np.cos(np.radians(170.0))  # arms opposite
_SWEPT_MARGIN_M = 0.6  # on each side of a footprint on its route


def draw_junction(name: str, situation: Situation, config: RoadConfig) -> Road:
    """Draw a junction with arms where the recorded vehicles come from and go to.

    Args:
        name: of a built-in road.
        situation: of the recording.
        config: how it is drawn.

    Raises:
        RefusedError: the recording needs more arms or lanes than the road has, or the grid would
            be too large.
    """
    tracks = situation.drivers
    centre = junction_centre(tracks)
    directions = find_arms(name, tracks, centre)
    longest = max(directions, key=lambda direction: direction.reach(tracks))
    frame = _westwards(centre, longest)
    arms, lane_of = _arms_of(name, directions, tracks, frame[2], config)
    driven = []
    for i, track in enumerate(tracks):
        if not track.still and {(i, True), (i, False)} <= lane_of.keys():
            connection = Connection(*lane_of[i, True], *lane_of[i, False])
            start = arms[connection.from_arm].lane(connection.from_lane, config, inward=True)
            goal = arms[connection.to_arm].lane(connection.to_lane, config, inward=False)
            if connection.from_arm == connection.to_arm:
                route = draw_u_turn(start, goal, np.zeros(2))
            else:
                route = draw_route(start, goal, sharpness=sharpness_of(track))
            if route is not None:
                vehicle = track.vehicle
                width = vehicle.width + 2.0 * _SWEPT_MARGIN_M
                size = vehicle.length, width, vehicle.trailer
                driven.append(Driven(connection, route, *size))
    plan = Plan(
        arms,
        driven,
        yielding=_yielding_arms(situation, lane_of, config),
        drawn_for=aligned(tracks, lane_of, frame),
    )
    lights = recorded_lights(situation, lane_of, plan.drawn_for)
    return draw_plan(replace(plan, lights=lights), name, config)


def _westwards(centre: Floats, direction: ArmDirection) -> Floats:
    """Return the recording's frame (3,) on a road about the origin, with an arm to the west."""
    turn = np.pi - direction.drawn
    return np.array([*place(np.array([0.0, 0.0, turn]), -centre[0], -centre[1]), turn])


def _arms_of(
    name: str,
    directions: list[ArmDirection],
    tracks: tuple[Track, ...],
    turn: float,
    config: RoadConfig,
    ring: float = 0.0,
) -> tuple[list[Arm], dict[EndKey, tuple[int, int]]]:
    """Return arms in some directions, turned [rad], and the arm and lane of each path's end.

    Arms of a roundabout with a radius `ring` [m] have one lane per direction.

    Raises:
        RefusedError: they would have too many lanes.
    """
    lane_of: dict[EndKey, tuple[int, int]] = {}
    arms: list[Arm] = []
    offsets: list[float] = []
    least = 1 if ring else config.lanes
    for direction in directions:
        lanes = lanes_of_arm(direction, config)
        if ring:
            lanes = ArmLanes(0.0, dict.fromkeys(lanes.lane_of, 0))
        inward, outward = (max(lanes.count(inward=side), least) for side in (True, False))
        if max(inward, outward) > _MAX_LANES_COUNT:
            raise RefusedError(
                f"road {name} would need {max(inward, outward)} lanes in one direction; at most "
                f"{_MAX_LANES_COUNT} are drawn"
            )
        needed = direction.reach(tracks) + END_ROOM_M + max(JUNCTION_SLACK_M, ring)
        reach = config.arm_length or max(needed, ring + MIN_ARM_M)
        lane_of.update({key: (len(arms), lane) for key, lane in lanes.lane_of.items()})
        offset = lanes.offset if direction.ends else _straight_on(direction, directions, offsets)
        offsets.append(offset)
        arm = Arm.towards(direction.drawn + turn, reach, inward, offset)
        arms.append(replace(arm, outward=outward))
    return arms, lane_of


def _straight_on(
    direction: ArmDirection, directions: list[ArmDirection], offsets: list[float]
) -> float:
    """Return the offset [m] with which an arm leads straight on from the arm opposite, or 0."""
    facing = (np.cos(other.drawn - direction.drawn) < _FACING for other in directions)
    return -sum(at for at, faces in zip(offsets, facing, strict=False) if faces)


def _yielding_arms(
    situation: Situation, lane_of: Mapping[EndKey, tuple[int, int]], config: RoadConfig
) -> set[int]:
    """Return the arms whose traffic yields to other arms, without those that it yields to.

    Args:
        situation: of the recording.
        lane_of: arm and lane of the ends of the drivers' tracks.
        config: whether priorities are shown.
    """
    if config.priority != "auto":
        return set()
    arm_of = {vehicle: arm for (vehicle, inward), (arm, _) in lane_of.items() if inward}
    rows = driver_rows(situation.encounter)
    pairs = []
    for reaction in situation.reactions.edges:
        arm = arm_of.get(rows.get(reaction.who, -1))
        other = arm_of.get(rows.get(reaction.whom, -1))
        if reaction.kind == YIELD and arm is not None and other is not None and arm != other:
            pairs.append((arm, other))
    return {arm for arm, _ in pairs} - {other for _, other in pairs}


@dataclass(frozen=True)
class _RingLimits:
    """The size of roundabouts, and the recorded paths that count as driven around a ring."""

    min_radius_m: float = 13.0  # without a recorded ring
    max_radius_m: float = 45.0
    min_recorded_radius_m: float = 8.0
    max_recorded_radius_m: float = 60.0
    usual_lateral_mps2: float = 3.0  # at the highest recorded speed
    max_lateral_mps2: float = 4.0
    near_ring_m: float = 4.0  # beyond the lane's centre, where a speed is one on the ring
    off_ring_m: float = 2.5  # from the lane's centre of a recorded ring
    pose_step_m: float = 1.0
    min_arc_m: float = 12.0
    flare_rad: float = float(np.radians(15.0))  # by which vehicles turn away from the ring
    circled_rad: float = float(np.radians(100.0))  # without a flare


_RING = _RingLimits()


class _Ring(NamedTuple):
    """A roundabout's lane.

    Attributes:
        centre: (2,) [m] in the recording's frame.
        radius: [m].
        speed: [m/s] the highest recorded one there.
    """

    centre: Floats
    radius: float
    speed: float = 0.0


def _ring_for_speed(tracks: tuple[Track, ...]) -> _Ring:
    """Return the ring for a recording without one: the smallest for its speeds, or the largest."""
    centre = junction_centre(tracks)
    radii = np.arange(_RING.min_radius_m, _RING.max_radius_m, 0.25)
    for radius in np.append(radii, _RING.max_radius_m).tolist():
        speed = _highest_speed(tracks, centre, radius + _RING.near_ring_m)
        if speed**2 <= _RING.usual_lateral_mps2 * radius:
            break
    return _Ring(centre, radius, speed)


def draw_roundabout(name: str, encounter: Encounter | None, config: RoadConfig) -> Road:
    """Draw a roundabout with one lane, sized for the recorded speeds, with arms where needed.

    A recorded ring is drawn as it was, if cars can drive around it as fast. If the vehicles drive
    too fast for a ring, or would not leave it, one arm is long enough for the recording.

    Raises:
        RefusedError: the recorded vehicles use more than four arms.
    """
    if encounter is None:
        ring = _Ring(np.zeros(2), _RING.min_radius_m)
        return draw_plan(_ring_plan(name, config, ring, _regular_arms(), ()), name, config)

    situation = Situation.of(encounter)
    tracks = situation.drivers
    config = fitting_width(tracks, config)
    recorded = _recorded_ring(tracks, config)
    ring = recorded or _ring_for_speed(tracks)
    notes = () if recorded else (Note.of(NoteKind.NO_RING, radius=ring.radius),)
    directions = find_arms(name, tracks, ring.centre, ring.radius + _RING.near_ring_m)
    if recorded is None and not _suits_ring(tracks, directions, ring):
        directions = _regular_arms()
        with suppress(RefusedError):  # the recording needs a junction
            low, high = to_frenet(tracks).span(tracks)
            directions = _regular_arms(ring.radius + high - low)
    plan = _ring_plan(name, config, ring, directions, tracks)
    lane_of = {end.key: (a, 0) for a, arm in enumerate(directions) for end in arm.ends}
    used = {arm for (_, inward), (arm, _) in lane_of.items() if inward}
    yielding = set(range(len(plan.arms))) - used | _yielding_arms(situation, lane_of, config)
    drawn_for = None
    if recorded or lane_of:
        drawn_for = aligned(tracks, lane_of, _westwards(ring.centre, directions[0]))
    plan = replace(plan, yielding=yielding, notes=notes, drawn_for=drawn_for)
    return draw_plan(plan, name, config)


def _regular_arms(least_reach: float = 0.0) -> list[ArmDirection]:
    """Return four arms at right angles, of which the first is as long as wanted [m]."""
    first = ArmDirection(0.0, [], least_reach=least_reach)
    return [first, *(ArmDirection(k * np.pi / 2.0, []) for k in (1, 2, 3))]


def _suits_ring(tracks: tuple[Track, ...], directions: list[ArmDirection], ring: _Ring) -> bool:
    """Return whether vehicles can drive around a ring as fast as recorded, and get to its arms."""
    reaching = {end.vehicle for direction in directions for end in direction.ends}
    moving = {i for i, track in enumerate(tracks) if not track.still}
    return moving <= reaching and ring.speed**2 <= _RING.max_lateral_mps2 * ring.radius


def _ring_plan(
    name: str,
    config: RoadConfig,
    ring: _Ring,
    directions: list[ArmDirection],
    tracks: tuple[Track, ...],
) -> Plan:
    """Return the plan of a roundabout with arms in some directions, which all give way."""
    turn = np.pi - directions[0].drawn
    arms, _ = _arms_of(name, directions, tracks, turn, config, ring.radius)
    length = max((track.vehicle.length for track in tracks), default=5.0)
    width = max((track.vehicle.width for track in tracks), default=2.0) + 2.0 * _SWEPT_MARGIN_M
    trailers = [track.vehicle.trailer for track in tracks if track.vehicle.trailer is not None]
    trailer = max(trailers, key=lambda each: each.hitch + each.reach, default=None)
    driven = []
    for a, b in product(range(len(arms)), repeat=2):
        start, goal = arms[a].lane(0, config, inward=True), arms[b].lane(0, config, inward=False)
        route = draw_ring_route(start, goal, np.zeros(2), ring.radius)
        if route is not None:
            driven.append(Driven(Connection(a, 0, b, 0), route, length, width, trailer))
    return Plan(arms, driven, ring=ring.radius, yielding=range(len(arms)))


def drives_about_ring(situation: Situation, config: RoadConfig) -> bool:
    """Return whether a recorded vehicle drives around the ring of a roundabout."""
    return _recorded_ring(situation.drivers, config) is not None


def _recorded_ring(tracks: tuple[Track, ...], config: RoadConfig) -> _Ring | None:
    """Return the circle that recorded vehicles drive around, if they do.

    Only vehicles count that bend to the other side before or after, or go far around.
    """
    side = 1.0 if config.traffic_side == "right" else -1.0
    points = np.concatenate([np.zeros((0, 2)), *(_ring_points(track, side) for track in tracks)])
    for _ in range(3):
        if len(points) < _RING.min_arc_m / _RING.pose_step_m:
            break
        # Least squares for the centre c and r² - |c|².
        rows = np.column_stack((2.0 * points, np.ones(len(points))))
        x, y, rest = np.linalg.lstsq(rows, np.square(points).sum(axis=1), rcond=None)[0]
        centre, radius = np.array([x, y]), float(np.sqrt(rest + x * x + y * y))
        near = np.abs(np.hypot(*(points - centre).T) - radius) < _RING.off_ring_m
        if near.all() and radius < _RING.max_recorded_radius_m:
            speed = _highest_speed(tracks, centre, radius + _RING.off_ring_m)
            needed = max(speed**2 / _RING.max_lateral_mps2, _RING.min_recorded_radius_m)
            return _Ring(centre, min(max(radius, needed), _RING.max_radius_m), speed)
        points = points[near]
    return None


def _ring_points(track: Track, side: float) -> Floats:
    """Return the places (P, 2) [m] at which a vehicle may drive around a ring."""
    poses = track.curve.at(np.arange(0.0, track.travelled, _RING.pose_step_m))
    if len(poses) < 10:
        return np.zeros((0, 2))
    smoothed = np.convolve(poses[:, 2], np.full(5, 0.2), "same")
    turned = side * np.gradient(smoothed)
    turned[:3] = turned[-3:] = 0.0
    around = turned > _RING.pose_step_m / _RING.max_recorded_radius_m
    flared = -turned[turned < 0.0].sum() > _RING.flare_rad
    if flared or turned[around].sum() > _RING.circled_rad:
        return poses[around, :2]
    return np.zeros((0, 2))


def _highest_speed(tracks: tuple[Track, ...], centre: Floats, radius: float) -> float:
    """Return the highest recorded speed [m/s] within a radius [m] of a centre (2,) [m]."""
    highest = 0.0
    for track in tracks:
        distance = np.hypot(*(track.poses[:, :2] - centre).T)
        inside = track.is_present & (distance < radius)
        highest = max(highest, float(track.speed[inside].max(initial=0.0)))
    return highest
