# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Roads shaped to a template that drives along one road: with its bends, side arms in their middle, or a ramp that joins.

Nobody turns as at a junction and nobody crosses, so the main road follows the template's own main line.
"""

from dataclasses import replace

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics.curve import Curve
from scenario_gen.numerics.plane import unit
from scenario_gen.roads.config import RoadConfig
from scenario_gen.roads.drawn import aligned, Arm, draw_plan, Driven, Plan
from scenario_gen.roads.pavement import ARM_COUNT, ROOM, SHORTEST, SIDE_ARMS, SLACK
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

_RAMP_ANGLE = np.radians(12.0)
_RAMP_LATERAL = 2.5  # m/s² across, at the most, for who joins as fast as in the template
_BEND = np.radians(20.0)  # of a curve whose template does not bend
_BESIDE = 0.4  # metres on each side of the widest vehicle in its lane

PLAIN_LINE = MainLine(
    Curve(np.array([[0.0, 0.0, 0.0], [120.0, 0.0, 0.0]])),
    np.array([0.0, 120.0]),
    np.array([0.0, 120.0]),
)
"""What `curve` is drawn along where there is no template."""


def fitting_width(tracks: tuple[Track, ...], config: RoadConfig) -> RoadConfig:
    """The configuration with lanes at least as wide as the template's widest vehicle needs."""
    widest = max(track.vehicle.width for track in tracks) + 2.0 * _BESIDE
    return replace(
        config, lane_width=max(config.lane_width, float(np.ceil(widest * 10.0 - 1e-6) / 10.0))
    )


def bends(name: str, main: MainLine) -> bool:
    """Whether the road `name` for a template along `main` is one that bends."""
    return name == "curve" or (name != "straight" and not main.straight)


def draw_along(name: str, main: MainLine, lanes: int, config: RoadConfig) -> Road:
    """Draw the road `name` along a main line, with so many lanes in each direction and side arms in the middle.

    Raises:
        RefusedError: it has more cells than are allowed.
    """
    line = main_axis(name, main, config)
    arms = [
        Arm(line.points[k] + np.array([0.0, 0.0, np.pi if k == 0 else 0.0]), lanes, lanes)
        for k in (0, -1)
    ]
    reach = lanes * config.lane_width + (config.arm_length or SHORTEST)
    across = float(line.at(line.length / 2.0)[2])
    arms += [
        Arm.towards(across + side, reach, config.lanes or 1)
        for side in SIDE_ARMS[: ARM_COUNT[name] - 2]
    ]
    return draw_plan(Plan(arms, line), name, config)


def main_axis(name: str, main: MainLine, config: RoadConfig) -> Curve:
    """The dividing line of the main road, its middle at the origin: straight on at both ends for its arms; a curve bends."""
    run = max(config.arm_length - main.shape.length / 2.0, ROOM) if config.arm_length else ROOM
    own = float(main.shape.points[-1, 2] - main.shape.points[0, 2])
    extra = float(np.copysign(_BEND, own)) - own if name == "curve" and abs(own) < _BEND else 0.0
    line = extended(main.shape, extra, run)
    return Curve(line.points - np.array([*line.at(line.length / 2.0)[:2], 0.0]))


def draw_merge(name: str, encounter: Encounter | None, config: RoadConfig) -> Road:
    """Draw a straight main road and a ramp that joins it from the side of its outermost lane, where the template changes to it.

    Raises:
        RefusedError: nobody in the template changes from the outermost lane of its direction to the next, or others keep to it,
            or the template needs a junction.
    """
    lanes, before, after, approach, yields = (
        max(config.lanes, 1),
        2.0 * SHORTEST,
        2.0 * SHORTEST,
        2.0 * SHORTEST,
        True,
    )
    sharpness = 0.02
    tracks: tuple[Track, ...] = ()
    who, joins = list[int](), np.zeros(3)  # where the template's vehicles join, heading as they do
    if encounter is not None:
        situation = Situation.of(encounter)
        tracks = situation.drivers
        config = fitting_width(tracks, config)
        frenet = to_frenet(tracks)
        who = _merging(tracks, frenet)
        others = frenet.lane[[i for i in range(len(tracks)) if i not in who]]
        lanes = max(
            int(others.max(initial=0)) + 1, int(frenet.lane[who, 1].max()) + 1, config.lanes
        )
        along = float(frenet.direction[who[0]])
        low, high = sorted(along * end for end in frenet.span(tracks))
        joining = [int(np.argmax(frenet.change[i] >= 0.5)) for i in who]
        join = float(
            np.median([along * frenet.station[i][at] for i, at in zip(who, joining, strict=True)])
        )
        before, after = join - low, high - join
        approach = join - min(
            along * float(frenet.station[i][0]) - tracks[i].vehicle.length / 2.0 for i in who
        )
        fastest = max(float(tracks[i].speed[at]) for i, at in zip(who, joining, strict=True))
        sharpness = min(
            max(sharpness_of(tracks[i]) for i in who), _RAMP_LATERAL / max(fastest, 1.0) ** 2
        )
        rows = driver_rows(encounter)
        yields = any(
            edge.kind == YIELD and rows.get(edge.who) in who for edge in situation.reactions.edges
        )
        joins = frenet.line.beside(np.array(along * join), float(np.mean(frenet.offset[who, -1])))
        joins[2] += 0.0 if along > 0.0 else np.pi
    reach = [
        config.arm_length or max(size + ROOM + SLACK, SHORTEST)
        for size in (before, after, approach)
    ]
    width = config.lane_width
    side = (
        -1.0 if config.traffic_side == "right" else 1.0
    )  # of the dividing line on which the traffic to the east drives
    arms = [
        Arm.towards(yaw, length, lanes) for yaw, length in ((np.pi, reach[0]), (0.0, reach[1]))
    ]
    yaw = np.pi - side * _RAMP_ANGLE  # out along the ramp
    joined = np.array([0.0, side * (lanes - 0.5) * width])
    ramp = np.array([*(joined + reach[2] * unit(yaw)), yaw + np.pi])
    axis = Curve(np.array([[-reach[0], 0.0, 0.0], [reach[1], 0.0, 0.0]]))
    way = draw_route(ramp, arms[1].lane(lanes - 1, config, inward=False), sharpness=sharpness)
    driven = () if way is None else (Driven((2, 0, 1, lanes - 1), way, 1.0, width),)
    lane_of = {
        (i, inward): (2, 0) if inward else (1, lanes - 1) for i in who for inward in (True, False)
    }
    aim = aligned(tracks, lane_of, joins, np.array([*joined, 0.0]))
    plan = Plan(
        [*arms, Arm.ramp(ramp, config)],
        axis,
        driven,
        yielding=(2,) if yields else (),
        drawn_for=aim,
    )
    return draw_plan(plan, name, config)


def _merging(tracks: tuple[Track, ...], frenet: FrenetTracks) -> list[int]:
    """The vehicles that come from the outermost lane of their direction and leave it for the next."""
    for sign in (1, -1):
        own = [i for i in range(len(tracks)) if frenet.direction[i] == sign]
        outermost = max((int(frenet.lane[i].max()) for i in own), default=0)
        who = [i for i in own if frenet.lane[i, 0] == outermost and frenet.lane[i, 1] < outermost]
        if who and all(outermost not in frenet.lane[i] for i in own if i not in who):
            return who
    raise RefusedError(
        "road merge: no recorded vehicle leaves the outermost lane of its direction for the next one, so none would use the ramp"
    )
