# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The lines and shapes painted on a road, for all pictures of lanes."""

from collections.abc import Iterator, Mapping, Sequence
from enum import StrEnum
from typing import Any

import numpy as np
import shapely
from shapely import LineString

from scenario_gen.numerics import Floats, place
from scenario_gen.numerics.curve import Curve
from scenario_gen.types.lanes import CARS, DRIVERS, Lane, LaneNetwork, RuleKind

_MAX_SHARED_GAP_M = 0.3  # between the borders of two lanes that are one line
_DIRECTION_STEP_M = 0.2  # along a line, to find its direction
_ZEBRA_SPACING_M = 1.0
_MIN_LANE_WITH_ARROW_M = 8.0
# Ahead and to the left of the arrow's middle.
_ARROW_OUTLINE_M = np.array(
    [
        [-1.6, 0.1],
        [0.2, 0.1],
        [0.2, 0.45],
        [1.6, 0.0],
        [0.2, -0.45],
        [0.2, -0.1],
        [-1.6, -0.1],
        [-1.6, 0.1],
    ]
)


class Marking(StrEnum):
    """A kind of line or shape."""

    EDGE = "edge"  # without a lane on the other side
    LANE = "lane"  # between lanes in one direction, dashed
    CENTRE = "centre"  # between the two directions, dashed
    STOP = "stop"
    GIVE_WAY = "give_way"  # dashed
    ARROW = "arrow"  # a closed shape
    ZEBRA = "zebra"  # a bar of a crossing; missing without crossings
    OBSTACLE = "obstacle"  # its outline, a closed shape; missing without obstacles


_MARKING_OF_RULE = {
    RuleKind.STOP: Marking.STOP,
    RuleKind.TRAFFIC_LIGHT: Marking.STOP,
    RuleKind.GIVE_WAY: Marking.GIVE_WAY,
}


def markings(network: LaneNetwork) -> Mapping[Marking, tuple[Floats, ...]]:
    """Return the lines (M, 2) [m] of each kind.

    The junction of a drawn road has none.
    """
    lanes, crossings = _painted_lanes(network)
    # Without a junction, a crossing is in the middle of a drawn road.
    has_junction = len(lanes) + len(crossings) < len(network.every_lane)
    crossed = network.drawn and bool(crossings) and not has_junction
    arrows = _arrows(lanes, share=0.25 if crossed else 0.5)
    lines = [
        *_edges(lanes),
        *_rule_lines(network),
        *((Marking.ARROW, arrow) for arrow in arrows),
        *((Marking.ZEBRA, bar) for bar in _zebras(crossings)),
        *((Marking.OBSTACLE, each.outline[[0, 1, 2, 3, 0]]) for each in network.obstacles),
    ]
    missing = {Marking.ZEBRA, Marking.OBSTACLE}.difference(kind for kind, _ in lines)
    kinds = [kind for kind in Marking if kind not in missing]
    return {kind: tuple(line for each, line in lines if each == kind) for kind in kinds}


def _painted_lanes(network: LaneNetwork) -> tuple[list[Lane], list[Lane]]:
    """Return the lanes with markings, and the crossings."""
    shown = [lane for lane in network.every_lane if not (network.drawn and lane.junction)]
    lanes = [lane for lane in shown if not lane.crossing]
    return lanes, [lane for lane in shown if lane.crossing]


def _rule_lines(network: LaneNetwork) -> Iterator[tuple[Marking, Floats]]:
    """Yield the lines of traffic rules."""
    for rule in network.rules:
        if rule.kind in _MARKING_OF_RULE and len(rule.line):
            yield _MARKING_OF_RULE[rule.kind], rule.line


def _edges(lanes: Sequence[Lane]) -> Iterator[tuple[Marking, Floats]]:
    """Yield the borders of lanes; a line that two lanes share is yielded once."""
    borders = [border for lane in lanes for border in (lane.left, lane.right)]
    neighbours = _neighbours(borders)
    for k, border in enumerate(borders):
        if any(other < k and k in neighbours[other] for other in neighbours[k]):
            continue
        for_cars = lanes[k // 2].open_to(CARS)
        alike = [
            same_direction
            for other, same_direction in neighbours[k].items()
            if lanes[other // 2].open_to(CARS) == for_cars
        ]
        if any(alike):
            yield Marking.LANE, border
        else:
            yield (Marking.CENTRE if alike else Marking.EDGE), border


def _neighbours(borders: Sequence[Floats]) -> list[dict[int, bool]]:
    """Return the borders of other lanes at the middle of each border, two of each lane.

    They are given by their index, with whether they have the same direction.
    """
    lines = np.array([LineString(border) for border in borders])
    half = shapely.length(lines) / 2.0
    middle = shapely.line_interpolate_point(lines, half)
    tree = shapely.STRtree(lines)
    first, other = tree.query(middle, predicate="dwithin", distance=_MAX_SHARED_GAP_M)
    of_two_lanes = first // 2 != other // 2
    first, other = first[of_two_lanes], other[of_two_lanes]
    station = shapely.line_locate_point(lines[other], middle[first])
    turn = _yaw(lines[first], half[first]) - _yaw(lines[other], station)
    neighbours: list[dict[int, bool]] = [{} for _ in borders]
    for k, n, cosine in zip(first.tolist(), other.tolist(), np.cos(turn).tolist(), strict=True):
        neighbours[k][n] = cosine > 0.0
    return neighbours


def _yaw(lines: Any, station: Floats) -> Floats:
    """Return (K,) [rad] the directions of lines at a station [m] of each."""
    behind = shapely.line_interpolate_point(lines, np.maximum(station - _DIRECTION_STEP_M, 0.0))
    ahead = shapely.line_interpolate_point(lines, station + _DIRECTION_STEP_M)
    x, y = (shapely.get_coordinates(ahead) - shapely.get_coordinates(behind)).T
    return np.asarray(np.arctan2(y, x))


def _arrows(lanes: Sequence[Lane], share: float) -> Iterator[Floats]:
    """Yield the arrow of each driven lane outside of junctions, at a share of its length."""
    for lane in lanes:
        centre = Curve.through(lane.centre)
        is_long = centre.length >= _MIN_LANE_WITH_ARROW_M
        if is_long and not lane.junction and lane.open_to(DRIVERS):
            yield place(centre.at(centre.length * share), *_ARROW_OUTLINE_M.T)


def _zebras(crossings: Sequence[Lane]) -> Iterator[Floats]:
    """Yield the bars (2, 2) [m] of crossings."""
    for lane in crossings:
        left, right = Curve.through(lane.left), Curve.through(lane.right)
        length = min(left.length, right.length)
        at = np.arange(_ZEBRA_SPACING_M / 2.0, length, _ZEBRA_SPACING_M)
        yield from np.stack((left.at(at)[:, :2], right.at(at)[:, :2]), axis=1)
