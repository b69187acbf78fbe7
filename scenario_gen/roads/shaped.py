# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Roads along the main line of a recording: with its bends, side arms in the middle, or a ramp.

They are for recordings without crossings and turns at a junction.
"""

from dataclasses import replace

import numpy as np

from scenario_gen.numerics import Floats, place, unit
from scenario_gen.numerics.curve import Curve
from scenario_gen.roads.config import RoadConfig
from scenario_gen.roads.drawn import draw_plan
from scenario_gen.roads.pavement import (
    ARM_COUNT,
    END_ROOM_M,
    JUNCTION_SLACK_M,
    MIN_ARM_M,
    SIDE_ARM_YAWS_RAD,
)
from scenario_gen.roads.plan import aligned, Arm, Connection, Driven, Plan
from scenario_gen.roads.ways import draw_route, with_turn
from scenario_gen.situation import (
    driver_rows,
    FrenetTracks,
    main_line,
    sharpness_of,
    Situation,
    to_frenet,
    Track,
)
from scenario_gen.types import Encounter, Road, YIELD

_RAMP_ANGLE_RAD = np.radians(12.0)
_RAMP_CURVATURE_PER_M = 0.02  # of the bend into the main road, without a recorded one
_MAX_RAMP_LATERAL_MPS2 = 2.5  # at the recorded speed
_MIN_CURVE_RAD = np.radians(20.0)  # of the road `curve`
_LANE_MARGIN_M = 0.4  # on each side of the widest vehicle

_DEFAULT_ARM_M = 60.0  # without a recording


def fitting_width(tracks: tuple[Track, ...], config: RoadConfig) -> RoadConfig:
    """Return the configuration with lanes that are wide enough for the widest vehicle."""
    needed = max(track.vehicle.width for track in tracks) + 2.0 * _LANE_MARGIN_M
    rounded_up = float(np.ceil(needed * 10.0 - 1e-6) / 10.0)
    return replace(config, lane_width=max(config.lane_width, rounded_up))


def main_shape(name: str, tracks: tuple[Track, ...], config: RoadConfig) -> tuple[Curve, int]:
    """Return the line that a road follows, and how many lanes it needs per direction.

    Args:
        name: of a built-in road; `straight` never bends.
        tracks: of the recording; (): a straight line, as long as the configuration says.
        config: lengths of arms.

    Raises:
        RefusedError: the recording needs a junction.
    """
    if not tracks:
        reach = max(config.arm_length or _DEFAULT_ARM_M, _least_arm(1, config))
        return _straight(2.0 * (reach - END_ROOM_M)), 1
    frenet = to_frenet(tracks).spread()
    low, high = frenet.span(tracks)
    shape = _straight(high - low) if name == "straight" else main_line(frenet, tracks).shape
    return shape, frenet.lanes


def _straight(length: float) -> Curve:
    return Curve(np.array([[0.0, 0.0, 0.0], [length, 0.0, 0.0]]))


def draw_along(name: str, shape: Curve, lanes: int, config: RoadConfig) -> Road:
    """Draw a road along a line, with side arms at right angles in the middle.

    Args:
        name: of a built-in road.
        shape: the line on which vehicles drive.
        lanes: per direction of the main road.
        config: how it is drawn.

    Raises:
        RefusedError: it has more cells than are allowed.
    """
    line = _main_axis(name, shape, config)
    sides = SIDE_ARM_YAWS_RAD[: ARM_COUNT[name] - 2]
    if not sides:
        return draw_plan(Plan([Arm(line, lanes, lanes)]), name, config)
    half = lanes * config.lane_width
    reach = np.ceil(max(config.arm_length or half + MIN_ARM_M, _least_arm(lanes, config)))
    yaw = float(line.at(line.length / 2.0)[2])
    arms = [
        Arm(half_way.cut(0.0, line.length / 2.0, 1.0), lanes, lanes)
        for half_way in (line, line.reversed())
    ]
    arms += [Arm.towards(yaw + side, reach, config.lanes or 1) for side in sides]
    return draw_plan(Plan(arms), name, config)


def _least_arm(lanes: int, config: RoadConfig) -> float:
    """Return the least length [m] of an arm beside a road with lanes, from its middle."""
    return lanes * config.lane_width + config.corner_radius + 5.0


def _main_axis(name: str, shape: Curve, config: RoadConfig) -> Curve:
    """Return the dividing line of the main road with its middle at the origin.

    It goes straight on at both ends for its arms. `curve` bends at least a little.
    """
    turn = float(shape.points[-1, 2] - shape.points[0, 2])
    if name == "curve" and abs(turn) < _MIN_CURVE_RAD:
        shape = with_turn(shape, float(np.copysign(_MIN_CURVE_RAD, turn)))
    middle = shape.length / 2.0
    half = config.arm_length or max(middle + END_ROOM_M, MIN_ARM_M)
    line = shape.cut(middle - half, middle + half, 0.25)
    return Curve(line.points - np.array([*line.at(half)[:2], 0.0]))


def draw_merge(name: str, encounter: Encounter | None, config: RoadConfig) -> Road:
    """Draw a straight main road and a ramp that joins its outermost lane, as recorded.

    The main road from above::

        |--------------------------------------|-------------------------|
        ------------------------------------------------------------------
        main road                                                    lanes
        ---------------------------------------*--------------------------
                                     /    /     join
                        ramp    /    /
                           /    /

    Vehicles that change from the outermost lane of their direction, in which nobody stays, to the
    next come from the ramp. Without any, the ramp is beside the main road.

    Raises:
        RefusedError: the recording needs a junction.
    """
    if encounter is None:
        return draw_plan(
            _merge_plan(1, (2.0 * MIN_ARM_M,) * 3, _RAMP_CURVATURE_PER_M, config)[0], name, config
        )
    situation = Situation.of(encounter)
    tracks = situation.drivers
    config = fitting_width(tracks, config)
    frenet = to_frenet(tracks)
    merging = _merging_vehicles(frenet)
    if not merging:
        low, high = frenet.span(tracks)
        half = max((high - low) / 2.0 + END_ROOM_M + JUNCTION_SLACK_M, MIN_ARM_M)
        lengths = half, half, 2.0 * MIN_ARM_M
        plan, _ = _merge_plan(frenet.spread().lanes, lengths, _RAMP_CURVATURE_PER_M, config)
        return draw_plan(plan, name, config)
    on_main_road = frenet.lane[[i for i in range(len(tracks)) if i not in merging]]
    lanes = max(int(on_main_road.max(initial=0)), int(frenet.lane[merging, 1].max())) + 1

    # Stations in the direction of the merging vehicles.
    sign = float(frenet.direction[merging[0]])
    low, high = sorted(sign * end for end in frenet.span(tracks))
    samples = {i: int(np.argmax(frenet.change[i] >= 0.5)) for i in merging}
    join = float(np.median([sign * frenet.station[i][k] for i, k in samples.items()]))
    first = min(sign * frenet.station[i][0] - tracks[i].vehicle.length / 2.0 for i in merging)
    fastest = max(float(tracks[i].speed[k]) for i, k in samples.items())
    sharpest = max(sharpness_of(tracks[i]) for i in merging)
    sharpest = min(sharpest, _MAX_RAMP_LATERAL_MPS2 / max(fastest, 1.0) ** 2)
    recorded_lengths = (
        max(length + END_ROOM_M + JUNCTION_SLACK_M, MIN_ARM_M)
        for length in (join - low, high - join, join - first)
    )
    plan, on_road = _merge_plan(lanes, tuple(recorded_lengths), sharpest, config)

    rows = driver_rows(encounter)
    yields = {rows.get(edge.who) for edge in situation.reactions.edges if edge.kind == YIELD}
    pose = frenet.line.at_offset(np.array(sign * join), frenet.offset[merging, -1].mean())
    turn = on_road[2] - pose[2] - (0.0 if sign > 0.0 else np.pi)
    frame = np.array([*place(np.array([*on_road[:2], turn]), -pose[0], -pose[1]), turn])
    lane_of = {(i, True): (2, 0) for i in merging}
    lane_of |= {(i, False): (1, plan.arms[1].outward - 1) for i in merging}
    drawn_for = aligned(tracks, lane_of, frame)
    yielding = () if yields.isdisjoint(merging) else plan.yielding
    return draw_plan(replace(plan, yielding=yielding, drawn_for=drawn_for), name, config)


def _merge_plan(
    lanes: int, lengths: tuple[float, ...], sharpness: float, config: RoadConfig
) -> tuple[Plan, Floats]:
    """Return the plan of a main road and a ramp, and the pose (3,) of the join.

    Args:
        lanes: of the main road per direction, at least.
        lengths: [m] of the main road to the join and from there, and of the ramp.
        sharpness: [1/m] of the bend from the ramp into the main road.
        config: lane width and traffic side.
    """
    west, east, ramp = (config.arm_length or length for length in lengths)
    lanes = max(lanes, config.lanes)
    outermost = lanes - 1
    # The side of the dividing line on which traffic to the east drives.
    side = -1.0 if config.traffic_side == "right" else 1.0
    join = np.array([0.0, side * (outermost + 0.5) * config.lane_width, 0.0])
    out = np.pi - side * _RAMP_ANGLE_RAD
    entry = np.array([*(join[:2] + ramp * unit(out)), out + np.pi])
    arms = [
        Arm.towards(np.pi, west, lanes),
        Arm.towards(0.0, east, lanes),
        Arm.ramp(entry, config),
    ]
    route = draw_route(entry, arms[1].lane(outermost, config, inward=False), sharpness=sharpness)
    driven = []
    if route is not None:
        driven.append(Driven(Connection(2, 0, 1, outermost), route, 1.0, config.lane_width))
    return Plan(arms, driven, yielding=(2,)), join


def _merging_vehicles(frenet: FrenetTracks) -> list[int]:
    """Return the vehicles that leave the outermost lane of their direction for the next one.

    There are none if others stay in the outermost lane.
    """
    for sign in (1, -1):
        vehicles = np.flatnonzero(frenet.direction == sign)
        lanes = frenet.lane[vehicles]
        outermost = lanes.max(initial=0)
        merges = (lanes[:, 0] == outermost) & (lanes[:, 1] < outermost)
        if merges.any() and not (lanes[~merges] == outermost).any():
            return [int(vehicle) for vehicle in vehicles[merges]]
    return []
