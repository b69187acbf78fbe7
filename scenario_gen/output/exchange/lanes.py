# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Lanes as other formats want them: numbered, with their neighbours, and gathered into strips of lanes that lie side by side."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from scenario_gen.numerics import Floats
from scenario_gen.numerics.plane import edge_lengths
from scenario_gen.types import CARS, DRIVERS, LaneNetwork, RuleKind

SIGN_IDS = {
    RuleKind.STOP: "206",
    RuleKind.GIVE_WAY: "205",
    RuleKind.PRIORITY: "301",
}  # German numbers
STRAIGHT_ON = 0.52  # rad, 30°: a way through a junction that turns by less goes straight on


@dataclass(frozen=True, eq=False)
class LaneMap:
    """All lanes of a road; lane k of the network has the id k + 1.

    Attributes:
        network: the lanes, of all users.
        added: how many at the end are derived: along what is driven, and no lane of the road.
        origin: what the lanes are: true ones of a road, or derived from what; for people.
    """

    network: LaneNetwork
    added: int
    origin: str

    @property
    def derived(self) -> bool:
        """Whether all are derived."""
        return self.added == len(self.network.lanes)

    def is_derived(self, k: int) -> bool:
        """Whether lane k is."""
        return k >= len(self.network.lanes) - self.added

    @cached_property
    def side(self) -> str:
        """The side of traffic, "right" or "left"."""
        return self.network.open_to(CARS).traffic_side or "right"

    def turn(self, k: int) -> str:
        """Where lane k leads through the junction of a drawn road, "left", "straight" or "right"; "" elsewhere."""
        lane = self.network.lanes[k]
        if not (self.network.drawn and lane.junction):
            return ""
        first, last = np.unwrap(lane.yaw)[[0, -1]].tolist()
        turn = last - first
        return "straight" if abs(turn) < STRAIGHT_ON else "left" if turn > 0.0 else "right"

    @cached_property
    def strips(self) -> tuple[tuple[tuple[int, ...], tuple[int, ...]], ...]:
        """The lanes of each arm of a drawn road, in and out, from the middle outwards; of a road through, in both directions.

        Every other lane is alone; crossings are in none.
        """
        lanes, strips = self.network.lanes, dict[int, tuple[tuple[int, ...], tuple[int, ...]]]()
        for arm in self.network.arms.values():
            inward = tuple(k for k in arm if ".-" in lanes[k].id)
            if inward:
                strips[inward[0]] = inward, tuple(k for k in arm if k not in inward)
        taken = {k for strip in strips.values() for side in strip for k in side}
        strips |= {
            k: ((k,), ()) for k in range(len(lanes)) if k not in taken and not lanes[k].crossing
        }
        return tuple(strips[k] for k in sorted(strips))

    @cached_property
    def _across(self) -> dict[int, int]:
        """The oncoming lane beside each lane that has one."""
        pairs = [(along[0], against[0]) for along, against in self.strips if against]
        return dict(pairs) | {b: a for a, b in pairs}

    def neighbours(self, k: int) -> dict[str, tuple[int, bool]]:
        """The lanes "left" and "right" of lane k, and whether they have its direction."""
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
    """Return a network whose lanes go on straight before the road's entries and beyond its exits."""
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
