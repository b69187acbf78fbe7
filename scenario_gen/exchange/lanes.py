# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Lanes as other formats want them: strips of neighbouring lanes along a reference line, and how they join."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from scenario_gen import exact
from scenario_gen.arrays import Floats, frozen

DECIMALS = 6
"""Of the metres of a lane's edges: rounded, lanes that follow or lie beside each other have the very same points there."""


@dataclass(frozen=True, eq=False)
class Strip:
    """Neighbouring lanes along a reference line, as a road of OpenDRIVE: lanes on the right of it, and on the left.

    Attributes:
        name: for people.
        reference: (M, 3) x [m], y [m], yaw [rad, unwrapped] of the reference line; no two points equal.
        offset: (M,) metres by which the line between left and right lanes lies to the left of the reference line.
        right: (R, M) widths [m] of the lanes on the right, from that line outwards.
        left: (L, M) widths [m] of the lanes on the left, likewise.
    """

    name: str
    reference: Floats
    offset: Floats
    right: Floats
    left: Floats

    def __post_init__(self) -> None:
        object.__setattr__(self, "reference", frozen(self.reference))
        count = len(self.reference)
        object.__setattr__(self, "offset", frozen(np.broadcast_to(self.offset, count)))
        for side in ("right", "left"):
            object.__setattr__(self, side, frozen(np.reshape(getattr(self, side), (-1, count))))

    def beside(self, distance: Floats) -> Floats:
        """Return points (M, 2) at distances (M,) [m] to the left of the reference line."""
        x, y, yaw = self.reference.T
        return np.column_stack((x - distance * exact.sin(yaw), y + distance * exact.cos(yaw)))

    def edges(self, side: str) -> Floats:
        """Return the edges (L, M, 2) [m] of one side's L - 1 lanes, "right" or "left", from the middle outwards."""
        sign = -1.0 if side == "right" else 1.0
        widths = getattr(self, side)
        beside = np.concatenate([self.offset[None], self.offset + sign * np.cumsum(widths, axis=0)])
        return frozen(np.round(np.stack([self.beside(row) for row in beside]), DECIMALS))


@dataclass(frozen=True)
class Joint:
    """Strip `by` leads through the junction from the end of strip `start` to the end of strip `goal`; `turn` says which way."""

    by: int
    start: int
    goal: int
    turn: str


@dataclass(frozen=True, eq=False)
class LaneMap:
    """All lanes of a road.

    Attributes:
        strips: those that are not in `joints` run from where traffic comes in to the junction, if there is one.
        joints: the ways through the junction.
        side: of traffic, "right" or "left": on that side of a strip's middle lanes run with the reference line.
        origin: what the lanes are: true ones of a road, or derived from what; for people.
        derived: whether they are derived.
    """

    strips: tuple[Strip, ...]
    joints: tuple[Joint, ...]
    side: str
    origin: str
    derived: bool

    @property
    def along(self) -> str:
        """The side of a strip whose lanes run along its reference line."""
        return self.side

    @property
    def against(self) -> str:
        """The side of a strip whose lanes run against its reference line."""
        return "left" if self.side == "right" else "right"


@dataclass(frozen=True, eq=False)
class Lane:
    """One lane in its own direction of travel.

    Attributes:
        id: from 1.
        strip: index of its strip.
        side, place: of the strip, and the lane's place on it from the middle outwards.
        left, right: (M, 2) its bounds [m], point by point opposite each other.
        successors, predecessors: ids.
        left_of, right_of: id of the lane beside it and whether that has the same direction; None if there is none.
        turn: "left", "straight" or "right" through a junction; "" elsewhere.
    """

    id: int
    strip: int
    side: str
    place: int
    left: Floats
    right: Floats
    successors: tuple[int, ...]
    predecessors: tuple[int, ...]
    left_of: tuple[int, bool] | None
    right_of: tuple[int, bool] | None
    turn: str

    @property
    def middle(self) -> Floats:
        """(M, 2) the lane's middle [m]."""
        return (self.left + self.right) / 2.0


Place = tuple[int, str, int]  # strip, side, place


def lanes_of(lane_map: LaneMap) -> tuple[Lane, ...]:
    """Return every lane of a map, joined as its strips are: lanes of one place from the middle follow each other."""
    places = list(_places(lane_map))
    number = {place: k + 1 for k, place in enumerate(places)}
    after: dict[Place, list[int]] = {place: [] for place in places}
    before: dict[Place, list[int]] = {place: [] for place in places}
    turns = {joint.by: joint.turn for joint in lane_map.joints}
    for joint in lane_map.joints:
        for start, by, goal in joined(lane_map, joint):
            for one, other in pairwise((start, by, goal)):
                after[one].append(number[other])
                before[other].append(number[one])
    found = []
    for place in places:
        strip, side, k = place
        edges = lane_map.strips[strip].edges(side)[k : k + 2]
        if side == lane_map.against:
            edges = edges[:, ::-1]
        inner, outer = edges if lane_map.side == "right" else edges[::-1]
        across = number.get((strip, lane_map.against if side == lane_map.along else lane_map.along, 0))
        inward = (number[strip, side, k - 1], True) if k else (across, False) if across else None
        further = number.get((strip, side, k + 1))
        outward = (further, True) if further else None
        left_of, right_of = (inward, outward) if lane_map.side == "right" else (outward, inward)
        found.append(
            Lane(
                id=number[place],
                strip=strip,
                side=side,
                place=k,
                left=frozen(inner),
                right=frozen(outer),
                successors=tuple(sorted(after[place])),
                predecessors=tuple(sorted(before[place])),
                left_of=left_of,
                right_of=right_of,
                turn=turns.get(strip, ""),
            )
        )
    return tuple(found)


def joined(lane_map: LaneMap, joint: Joint) -> Iterator[tuple[Place, Place, Place]]:
    """Yield, for each lane of a way through the junction, the lane it comes from, itself, and the one it leads to."""
    along, against = lane_map.along, lane_map.against
    counts = [len(getattr(lane_map.strips[joint.start], along)), len(getattr(lane_map.strips[joint.by], along))]
    counts.append(len(getattr(lane_map.strips[joint.goal], against)))
    for k in range(min(counts)):
        yield (joint.start, along, k), (joint.by, along, k), (joint.goal, against, k)


def _places(lane_map: LaneMap) -> Iterator[Place]:
    for k, strip in enumerate(lane_map.strips):
        for side in ("right", "left"):
            for place in range(len(getattr(strip, side))):
                yield k, side, place


def stations(reference: Floats) -> Floats:
    """Return (M,) the length [m] along a polyline (M, 2+) to each of its points."""
    steps = np.diff(reference[:, :2], axis=0)
    return np.concatenate([[0.0], np.cumsum(exact.hypot(steps[:, 0], steps[:, 1]))])
