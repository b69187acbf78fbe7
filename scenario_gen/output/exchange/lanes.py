# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Lanes for other formats: numbered, with neighbours, and grouped into strips."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from shapely import make_valid, Polygon, union_all
from shapely.geometry.base import BaseGeometry

from scenario_gen.numerics import edge_lengths, Floats
from scenario_gen.types import CARS, DRIVERS, LaneNetwork, Road, RuleKind

SIGN_IDS = {
    RuleKind.STOP: "206",
    RuleKind.GIVE_WAY: "205",
    RuleKind.PRIORITY: "301",
}  # German numbers
MAX_STRAIGHT_TURN_RAD = 0.52  # 30°: a junction lane that turns by less counts as straight


@dataclass(frozen=True, eq=False)
class LaneMap:
    """All lanes of a road; lane k of the network has the id k + 1.

    Attributes:
        network: the lanes, of all users; a grid has none.
        origin: origin of the lanes, for people.
    """

    network: LaneNetwork
    origin: str

    @classmethod
    def of(cls, road: Road | None, run_out: float) -> "LaneMap":
        """Return the lanes of a road; those of a built-in one are extended by `run_out` [m]."""
        if road is None or road.lanes is None:
            return cls(LaneNetwork("", ()), "the road is a grid without lanes")
        network = road.lanes.whole
        if road.lanes.drawn:
            return cls(with_run_out(network, run_out), f"the true lanes of {network.name}")
        return cls(network, f"the lanes of map {network.name}")

    @property
    def area(self) -> BaseGeometry:
        """The union of all lanes."""
        return union_all(make_valid([Polygon(lane.outline) for lane in self.network.lanes]))

    @cached_property
    def side(self) -> str:
        """The side of traffic, "right" or "left"."""
        return self.network.open_to(CARS).traffic_side or "right"

    def turn(self, k: int) -> str:
        """Return the turn of lane k in the junction of a drawn road: left, straight or right.

        Other lanes have the turn "".
        """
        lane = self.network.lanes[k]
        if not (self.network.drawn and lane.junction):
            return ""
        first, last = np.unwrap(lane.yaw)[[0, -1]].tolist()
        turn = last - first
        if abs(turn) < MAX_STRAIGHT_TURN_RAD:
            return "straight"
        return "left" if turn > 0.0 else "right"

    @cached_property
    def strips(self) -> tuple[tuple[tuple[int, ...], tuple[int, ...]], ...]:
        """The strips: pairs of the lanes in each direction, from the road centre outwards.

        Each arm of a drawn road is a strip; every other lane is a strip of its own. Crossings are
        in no strip.
        """
        lanes = self.network.lanes
        strips = []
        single = [k for k, lane in enumerate(lanes) if not lane.arm and not lane.crossing]
        for arm in self.network.arms.values():
            inward = tuple(k for k in arm if lanes[k].inward)
            outward = tuple(k for k in arm if not lanes[k].inward)
            if inward:
                strips.append((inward, outward))
            else:
                single += outward  # a ramp
        return tuple(sorted([*strips, *(((k,), ()) for k in single)]))

    @cached_property
    def _across(self) -> dict[int, int]:
        """The oncoming lane beside each lane that has one."""
        pairs = [(along[0], against[0]) for along, against in self.strips if against]
        return dict(pairs) | {b: a for a, b in pairs}

    def neighbours(self, k: int) -> dict[str, tuple[int, bool]]:
        """Return the lanes "left" and "right" of lane k, and whether they have its direction."""
        lane, sides = self.network.lanes[k], dict[str, tuple[int, bool]]()
        across = lane.left[0] - lane.right[0]
        for other in lane.neighbours:
            gap = self.network.lanes[other].centre - lane.centre[0]
            nearest = gap[int(np.argmin(np.square(gap).sum(axis=1)))]
            sides["left" if float((nearest * across).sum()) > 0.0 else "right"] = (other, True)
        if k in self._across:
            sides.setdefault("left" if self.side == "right" else "right", (self._across[k], False))
        return sides


def with_run_out(network: LaneNetwork, metres: float) -> LaneNetwork:
    """Return a network with lanes extended straight before entries and beyond exits."""
    if metres <= 0.0:
        return network
    lanes = list(network.lanes)
    entries, exits = (
        [k for k in ends if lanes[k].open_to(DRIVERS)] for ends in (network.entries, network.exits)
    )
    for k in entries:
        lanes[k] = replace(
            lanes[k],
            left=_longer(lanes[k].left[::-1], metres)[::-1],
            right=_longer(lanes[k].right[::-1], metres)[::-1],
        )
    for k in exits:
        lanes[k] = replace(
            lanes[k], left=_longer(lanes[k].left, metres), right=_longer(lanes[k].right, metres)
        )
    return replace(network, lanes=tuple(lanes))


def _longer(border: Floats, metres: float) -> Floats:
    step = border[-1] - border[-2]
    end = border[-1] + step / edge_lengths(border[-2:])[0] * metres
    return np.concatenate((border, end[None]))
