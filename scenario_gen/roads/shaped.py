# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Roads along the main line of a recording: with its bends, side arms in the middle, or a ramp.

They are for recordings without crossings and turns at a junction.
"""

from dataclasses import dataclass, replace

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import Floats
from scenario_gen.numerics.curve import Curve
from scenario_gen.numerics.plane import unit
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
from scenario_gen.roads.ways import draw_route, extended
from scenario_gen.situation import (
    driver_rows,
    FrenetTracks,
    MainLine,
    sharpness_of,
    Situation,
    to_frenet,
    Track,
)
from scenario_gen.types import Encounter, Road, YIELD

_RAMP_ANGLE_RAD = np.radians(12.0)
_MAX_RAMP_LATERAL_MPS2 = 2.5  # at the recorded speed
_MIN_CURVE_RAD = np.radians(20.0)  # of the road `curve`
_LANE_MARGIN_M = 0.4  # on each side of the widest vehicle

STRAIGHT_LINE = MainLine(
    Curve(np.array([[0.0, 0.0, 0.0], [120.0, 0.0, 0.0]])),
    np.array([0.0, 120.0]),
    np.array([0.0, 120.0]),
)
"""The main line of `curve` without a recording."""


def fitting_width(tracks: tuple[Track, ...], config: RoadConfig) -> RoadConfig:
    """Return the configuration with lanes that are wide enough for the widest vehicle."""
    needed = max(track.vehicle.width for track in tracks) + 2.0 * _LANE_MARGIN_M
    rounded_up = float(np.ceil(needed * 10.0 - 1e-6) / 10.0)
    return replace(config, lane_width=max(config.lane_width, rounded_up))


def bends(name: str, main: MainLine) -> bool:
    """Return whether a road along a main line bends."""
    return name == "curve" or (name != "straight" and not main.straight)


def draw_along(name: str, main: MainLine, lanes: int, config: RoadConfig) -> Road:
    """Draw a road along a main line, with side arms in the middle.

    Args:
        name: of a built-in road.
        main: the main line.
        lanes: per direction of the main road.
        config: how it is drawn.

    Raises:
        RefusedError: it has more cells than are allowed.
    """
    line = main_axis(name, main, config)
    turned_back = np.array([0.0, 0.0, np.pi])
    arms = [
        Arm(line.points[0] + turned_back, lanes, lanes),
        Arm(line.points[-1], lanes, lanes),
    ]
    reach = lanes * config.lane_width + (config.arm_length or MIN_ARM_M)
    yaw = float(line.at(line.length / 2.0)[2])
    sides = SIDE_ARM_YAWS_RAD[: ARM_COUNT[name] - 2]
    arms += [Arm.towards(yaw + side, reach, config.lanes or 1) for side in sides]
    return draw_plan(Plan(arms, line), name, config)


def main_axis(name: str, main: MainLine, config: RoadConfig) -> Curve:
    """Return the dividing line of the main road with its middle at the origin.

    It goes straight on at both ends for its arms. `curve` bends at least a little.
    """
    run = END_ROOM_M
    if config.arm_length:
        run = max(config.arm_length - main.shape.length / 2.0, END_ROOM_M)
    turn = float(main.shape.points[-1, 2] - main.shape.points[0, 2])
    extra = 0.0
    if name == "curve" and abs(turn) < _MIN_CURVE_RAD:
        extra = float(np.copysign(_MIN_CURVE_RAD, turn)) - turn
    line = extended(main.shape, extra, run)
    return Curve(line.points - np.array([*line.at(line.length / 2.0)[:2], 0.0]))


@dataclass(frozen=True, eq=False)
class MergeLayout:
    """The layout of a main road and a ramp; lengths in metres.

    The main road from above::

                        before_m                        after_m
        |--------------------------------------|-------------------------|
        ------------------------------------------------------------------
        main road                                                    lanes
        ---------------------------------------*--------------------------
                                     /    /     join
                        ramp    /    /    approach_m, to the ramp's end
                           /    /

    Attributes:
        lanes: of the main road per direction.
        before_m: from the beginning of the main road to the join.
        after_m: from the join to the end of the main road.
        approach_m: of the ramp.
        curvature_per_m: of the bend from the ramp into the main road.
        yields: whether vehicles on the ramp give way.
        merging: the recorded vehicles on the ramp.
        join: (3,) x, y [m], yaw [rad] of the join in the recording's frame.
    """

    lanes: int
    before_m: float = 2.0 * MIN_ARM_M
    after_m: float = 2.0 * MIN_ARM_M
    approach_m: float = 2.0 * MIN_ARM_M
    curvature_per_m: float = 0.02
    yields: bool = True
    merging: tuple[int, ...] = ()
    join: Floats | None = None

    @classmethod
    def of(cls, situation: Situation, config: RoadConfig) -> "MergeLayout":
        """Return the layout for a recording, in which a vehicle leaves the outermost lane.

        Raises:
            RefusedError: no vehicle does, others stay in it, or the recording needs a junction.
        """
        tracks = situation.drivers
        frenet = to_frenet(tracks)
        merging = _merging_vehicles(frenet)
        on_main_road = frenet.lane[[i for i in range(len(tracks)) if i not in merging]]
        lanes = max(int(on_main_road.max(initial=0)), int(frenet.lane[merging, 1].max())) + 1

        # Stations in the direction of the merging vehicles.
        sign = float(frenet.direction[merging[0]])
        low, high = sorted(sign * end for end in frenet.span(tracks))
        samples = {i: int(np.argmax(frenet.change[i] >= 0.5)) for i in merging}
        join = float(np.median([sign * frenet.station[i][k] for i, k in samples.items()]))
        first = min(
            sign * float(frenet.station[i][0]) - tracks[i].vehicle.length / 2.0 for i in merging
        )
        fastest = max(float(tracks[i].speed[k]) for i, k in samples.items())
        sharpest = max(sharpness_of(tracks[i]) for i in merging)
        offset = float(np.mean(frenet.offset[merging, -1]))
        pose = frenet.line.at_offset(np.array(sign * join), offset)
        pose[2] += 0.0 if sign > 0.0 else np.pi
        rows = driver_rows(situation.encounter)
        yields = [
            rows.get(reaction.who)
            for reaction in situation.reactions.edges
            if reaction.kind == YIELD
        ]
        return cls(
            lanes=max(lanes, config.lanes),
            before_m=join - low,
            after_m=high - join,
            approach_m=join - first,
            curvature_per_m=min(sharpest, _MAX_RAMP_LATERAL_MPS2 / max(fastest, 1.0) ** 2),
            yields=not set(merging).isdisjoint(yields),
            merging=tuple(merging),
            join=pose,
        )

    def plan(self, tracks: tuple[Track, ...], config: RoadConfig) -> Plan:
        """Return the plan of the road for the tracks of a recording."""
        west, east, ramp = (
            config.arm_length or max(length + END_ROOM_M + JUNCTION_SLACK_M, MIN_ARM_M)
            for length in (self.before_m, self.after_m, self.approach_m)
        )
        outermost = self.lanes - 1
        # The side of the dividing line on which traffic to the east drives.
        side = -1.0 if config.traffic_side == "right" else 1.0
        join = np.array([0.0, side * (outermost + 0.5) * config.lane_width])
        out = np.pi - side * _RAMP_ANGLE_RAD
        entry = np.array([*(join + ramp * unit(out)), out + np.pi])
        arms = [
            Arm.towards(np.pi, west, self.lanes),
            Arm.towards(0.0, east, self.lanes),
            Arm.ramp(entry, config),
        ]
        goal = arms[1].lane(outermost, config, inward=False)
        route = draw_route(entry, goal, sharpness=self.curvature_per_m)
        driven = []
        if route is not None:
            driven.append(Driven(Connection(2, 0, 1, outermost), route, 1.0, config.lane_width))
        lane_of = {(i, True): (2, 0) for i in self.merging}
        lane_of |= {(i, False): (1, outermost) for i in self.merging}
        recorded_join = np.zeros(3) if self.join is None else self.join
        return Plan(
            arms,
            Curve(np.array([[-west, 0.0, 0.0], [east, 0.0, 0.0]])),
            driven,
            yielding=(2,) if self.yields else (),
            drawn_for=aligned(tracks, lane_of, recorded_join, np.array([*join, 0.0])),
        )


def draw_merge(name: str, encounter: Encounter | None, config: RoadConfig) -> Road:
    """Draw a straight main road and a ramp that joins its outermost lane, as recorded.

    Raises:
        RefusedError: no recorded vehicle changes from the outermost lane of its direction to the
            next, others stay in it, or the recording needs a junction.
    """
    if encounter is None:
        layout = MergeLayout(max(config.lanes, 1))
        return draw_plan(layout.plan((), config), name, config)
    situation = Situation.of(encounter)
    config = fitting_width(situation.drivers, config)
    layout = MergeLayout.of(situation, config)
    return draw_plan(layout.plan(situation.drivers, config), name, config)


def _merging_vehicles(frenet: FrenetTracks) -> list[int]:
    """Return the vehicles that leave the outermost lane of their direction for the next one.

    Raises:
        RefusedError: there is none, or others stay in the outermost lane.
    """
    for sign in (1, -1):
        vehicles = np.flatnonzero(frenet.direction == sign)
        lanes = frenet.lane[vehicles]
        outermost = lanes.max(initial=0)
        merges = (lanes[:, 0] == outermost) & (lanes[:, 1] < outermost)
        if merges.any() and not (lanes[~merges] == outermost).any():
            return [int(vehicle) for vehicle in vehicles[merges]]
    raise RefusedError(
        "road merge: no recorded vehicle changes from the outermost lane of its direction to the "
        "next one, so none would use the ramp"
    )
