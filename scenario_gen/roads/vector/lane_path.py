# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The path of one vehicle along lanes, and how well vehicles can drive their paths."""

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import NamedTuple

import numpy as np

from scenario_gen.numerics import Floats
from scenario_gen.numerics.curve import Curve
from scenario_gen.roads.vector.lane_graph import LaneChain, LaneGraph
from scenario_gen.situation import Track
from scenario_gen.types import LaneNetwork


@dataclass(frozen=True)
class MatchCosts:
    """The costs of differences between a recording and its lanes."""

    max_squared_distance_m2: float = 100.0  # so that one far pose does not decide
    yaw_m2: float = 20.0  # per unit of 1 - cos: 60° count as 3 m
    turn_m2_per_rad2: float = 40.0  # of the turn from start to end
    not_reserved_m2: float = 25.0  # for a bicycle beside its cycle lane
    lost_crossing_m2: float = 6.0  # paths that would cross beyond their recorded ends
    lost_driven_crossing_m2: float = 18.0
    speeding_m2_per_mps2: float = 0.1  # (m/s)² above the speed limit
    lateral_m2_per_mps2: float = 1.0  # m/s² above `comfortable_lateral_mps2`
    comfortable_lateral_mps2: float = 3.0
    max_lateral_excess_mps2: float = 10.0  # that costs
    lane_change_gain_m2: float = 1.5  # that justifies a lane change
    narrow_m2_per_m: float = 30.0  # of side distance for which a lane is too narrow,
    max_missing_m: float = 0.5  # up to this


@dataclass(frozen=True)
class StartWeights:
    """The weights of the equations for the starts, in units of 1/m."""

    placement: float = 0.5  # stay where the rigid placement puts the vehicle
    beyond_crossing: float = 0.25  # keep the distance to a crossing beyond the recorded ends
    driven_crossing: float = 1.0
    met_crossing: float = 3.0  # a crossing at which the two vehicles meet
    gap: float = 2.0  # keep the gap to a vehicle in the same lane
    stop_line: float = 4.0  # stop before the line
    turn: float = 20.0  # turn as far as recorded


@dataclass(frozen=True)
class MatchLimits:
    """Where two things count as the same, and what cars can drive."""

    samples: int = 24  # of a path that are compared with a chain
    chains: int = 96  # tried for a vehicle: recorded maps have at most 15
    changing_chains: int = 4  # the best, between which lane changes are tried
    noticeable_turn_error_rad: float = math.radians(12.0)  # from which another start is tried
    crossing_angle_rad: float = math.radians(15.0)  # less is a merge
    same_lane_m: float = 2.0  # sideways
    end_room_m: float = 1.0  # between a footprint and the end of the lanes
    before_stop_line_m: float = 0.7
    past_stop_line_m: float = 6.0  # a stop within this distance is a stop at the line
    lane_change_curvature_per_m: float = 0.02
    braking_mps2: float = 4.0  # before a bend
    accelerating_mps2: float = 2.5  # after a bend
    grip_mps2: float = 9.0  # more lateral acceleration is impossible for cars


COSTS = MatchCosts()
WEIGHTS = StartWeights()
LIMITS = MatchLimits()
STEP_M = 0.5


@dataclass(frozen=True, eq=False)
class LanePath:
    """The path of one vehicle along lanes.

    Attributes:
        lanes: the chain of lanes.
        curve: their centre line around the driven part.
        start: arc length [m] on the curve at which the recording begins.
        progress: (T,) [m] from there at each recorded sample.
    """

    lanes: LaneChain
    curve: Curve
    start: float
    progress: Floats

    @property
    def end(self) -> float:
        """Arc length [m] on the curve at which the recording ends."""
        return self.start + float(self.progress[-1])

    @property
    def turn(self) -> float:
        """How far [rad, left positive] it turns."""
        start, end = self.curve.at(np.array([self.start, self.end]))[:, 2]
        return float(end - start)


class LateralAcceleration(NamedTuple):
    """The largest lateral acceleration [m/s²], v² times curvature, of a vehicle on its lane path.

    Attributes:
        recorded: at the recorded speeds.
        forced: at the lowest speeds that the recorded ones at both ends allow. A bend may be
            driven more slowly than recorded, the ends may not.
    """

    recorded: float
    forced: float


def lane_change_length(width: float) -> float:
    """Return the length [m] of a change by a width [m] with the curvature of a lane change.

    The largest second derivative of the blend x³(10 - 15x + 6x²) is 5.7735.
    """
    return math.sqrt(max(abs(width), 0.1) * 5.7735 / LIMITS.lane_change_curvature_per_m)


def off_reserved_cost(
    graph: LaneGraph, paths: Sequence[LanePath], tracks: Sequence[Track]
) -> float:
    """Return the cost [m²] of vehicles with reserved lanes that do not follow them."""
    off = 0
    for path, track in zip(paths, tracks, strict=True):
        reserved = graph.reserved_for(track)
        off += bool(reserved) and reserved.isdisjoint(path.lanes)
    return COSTS.not_reserved_m2 * off / len(tracks)


def lateral_acceleration(path: LanePath, track: Track) -> LateralAcceleration:
    """Return the largest lateral accelerations [m/s²] of a vehicle on its lane path."""
    driven = float(path.progress[-1])
    if track.still or driven < STEP_M:
        return LateralAcceleration(0.0, 0.0)
    at = np.linspace(0.0, driven, max(math.ceil(driven), 1) + 1)
    turned = np.abs(np.diff(path.curve.at(path.start + at)[:, 2]))
    curvature = turned / np.diff(at)
    middle = (at[1:] + at[:-1]) / 2.0
    speed = track.speed * (driven / float(track.progress[-1]))
    recorded = np.square(np.interp(middle, path.progress, speed))
    first, last = float(np.square(speed[0])), float(np.square(speed[-1]))
    lowest = np.maximum(
        first - 2.0 * LIMITS.braking_mps2 * middle,
        last - 2.0 * LIMITS.accelerating_mps2 * (driven - middle),
    ).clip(min=0.0)
    return LateralAcceleration(
        float((curvature * recorded).max()), float((curvature * lowest).max())
    )


def bend_cost(lateral: Sequence[LateralAcceleration]) -> float:
    """Return the cost [m²] of bends that the recorded speeds make uncomfortable."""
    excess = np.array([each.recorded for each in lateral]) - COSTS.comfortable_lateral_mps2
    capped = np.clip(excess, 0.0, COSTS.max_lateral_excess_mps2)
    return COSTS.lateral_m2_per_mps2 * float(np.mean(capped))


def narrow_cost(missing: float) -> float:
    """Return the cost [m²] of lanes that are too narrow for a recorded side distance by some m."""
    return COSTS.narrow_m2_per_m * min(missing, COSTS.max_missing_m)


def speeding_cost(
    network: LaneNetwork, paths: Sequence[LanePath], tracks: Sequence[Track]
) -> float:
    """Return the cost [m²] of vehicles that are faster than the highest limit of their lanes."""
    excess = []
    for path, track in zip(paths, tracks, strict=True):
        limit = max((network.lanes[k].speed_limit for k in path.lanes), default=math.nan)
        excess.append(max(float(track.speed.max()) - limit, 0.0) if limit > 0.0 else 0.0)
    return COSTS.speeding_m2_per_mps2 * float(np.mean(np.square(excess)))
