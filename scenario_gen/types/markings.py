# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What is painted on a road: the lines that every picture of lanes draws."""

from collections.abc import Mapping, Sequence
from enum import StrEnum
from typing import Any

import numpy as np
import shapely
from shapely import LineString

from scenario_gen.numerics import Floats
from scenario_gen.numerics.curve import Curve
from scenario_gen.numerics.plane import place
from scenario_gen.types.derived import once_per_object
from scenario_gen.types.lanes import CARS, DRIVERS, LaneNetwork, RuleKind

_SHARED_M = 0.3  # between the borders of two lanes that are one line
_STEP_M = 0.2  # before and behind a place on a line by which its direction is seen
_BARS_M = 1.0  # between the middles of two bars of a crossing
_SHORTEST_M = 8.0  # of a lane with an arrow
_ARROW_M = np.array(
    [
        (-1.6, 0.1),
        (0.2, 0.1),
        (0.2, 0.45),
        (1.6, 0.0),
        (0.2, -0.45),
        (0.2, -0.1),
        (-1.6, -0.1),
        (-1.6, 0.1),
    ]
)  # ahead and to the left
_PAINTED = {RuleKind.STOP: "stop", RuleKind.TRAFFIC_LIGHT: "stop", RuleKind.GIVE_WAY: "give_way"}


class Marking(StrEnum):
    """A kind of line or shape."""

    EDGE = "edge"  # beside which no lane lies
    LANE = "lane"  # between lanes of one direction, dashed
    CENTRE = "centre"  # between the two directions, dashed
    STOP = "stop"
    GIVE_WAY = "give_way"  # dashed
    ARROW = "arrow"  # a closed shape
    ZEBRA = "zebra"  # a bar of a crossing; only where there are some


@once_per_object
def markings(network: LaneNetwork) -> Mapping[Marking, tuple[Floats, ...]]:
    """Return the lines (M, 2) [m] of each kind; nothing is painted inside the junction of a drawn road."""
    shown = [lane for lane in network.every_lane if not (network.drawn and lane.junction)]
    lanes = [lane for lane in shown if not lane.crossing]
    painted: dict[Marking, list[Floats]] = {kind: [] for kind in Marking}
    borders = [border for lane in lanes for border in (lane.left, lane.right)]
    beside = _beside(borders)
    for k, border in enumerate(borders):
        along = [
            same
            for n, same in beside[k].items()
            if lanes[n // 2].open_to(CARS) == lanes[k // 2].open_to(CARS)
        ]
        if not any(
            other < k and k in beside[other] for other in beside[k]
        ):  # else it is painted already
            painted[
                Marking.LANE if any(along) else Marking.CENTRE if along else Marking.EDGE
            ].append(border)
    for rule in network.rules:
        if rule.kind in _PAINTED and len(rule.line):
            painted[Marking(_PAINTED[rule.kind])].append(rule.line)
    crossed = network.drawn and len(lanes) < len(shown) == len(
        network.every_lane
    )  # in the middle: there is no junction
    for lane in lanes:
        middle = Curve.through(lane.centre)
        if middle.length >= _SHORTEST_M and not lane.junction and lane.open_to(DRIVERS):
            painted[Marking.ARROW].append(
                place(middle.at(middle.length / (4.0 if crossed else 2.0)), *_ARROW_M.T)
            )
    for left, right in (
        (Curve.through(lane.left), Curve.through(lane.right)) for lane in shown if lane.crossing
    ):
        at = np.arange(_BARS_M / 2.0, min(left.length, right.length), _BARS_M)
        painted[Marking.ZEBRA].extend(np.stack((left.at(at)[:, :2], right.at(at)[:, :2]), axis=1))
    return {
        kind: tuple(lines) for kind, lines in painted.items() if lines or kind != Marking.ZEBRA
    }


def _beside(borders: Sequence[Floats]) -> list[dict[int, bool]]:
    """Of each border, two of a lane, those of other lanes at its middle: by number whether they have its direction."""
    lines = np.array([LineString(border) for border in borders])
    half = shapely.length(lines) / 2.0
    middle = shapely.line_interpolate_point(lines, half)
    own, other = shapely.STRtree(lines).query(middle, predicate="dwithin", distance=_SHARED_M)
    own, other = (numbers[own // 2 != other // 2] for numbers in (own, other))
    turn = _yaw(lines[own], half[own]) - _yaw(
        lines[other], shapely.line_locate_point(lines[other], middle[own])
    )
    beside: list[dict[int, bool]] = [{} for _ in borders]
    for k, number, same in zip(
        own.tolist(), other.tolist(), (np.cos(turn) > 0.0).tolist(), strict=True
    ):
        beside[k][number] = same
    return beside


def _yaw(lines: Any, station: Floats) -> Floats:
    """(K,) rad, the directions of lines at a station [m] of each."""
    before, behind = (
        shapely.get_coordinates(
            shapely.line_interpolate_point(lines, np.maximum(station + step, 0.0))
        )
        for step in (-_STEP_M, _STEP_M)
    )
    return np.asarray(np.arctan2(*(behind - before).T[::-1]))
