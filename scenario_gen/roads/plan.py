# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The plan of a drawn road: its arms, and the routes that it is drawn for."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from scenario_gen.numerics import Floats, unit, unit_left
from scenario_gen.numerics.curve import Curve
from scenario_gen.roads.config import RoadConfig
from scenario_gen.roads.ways import reverse
from scenario_gen.situation import Track
from scenario_gen.types import DrawnFor, Note, TrafficLight, Trailer


class Connection(NamedTuple):
    """The arms and lanes that a route joins; lanes count from the dividing line."""

    from_arm: int
    from_lane: int
    to_arm: int
    to_lane: int


@dataclass(frozen=True, eq=False)
class Arm:
    """An arm of a road.

    Attributes:
        line: its dividing line, from its end to the middle of the road.
        inward: its number of lanes towards the junction.
        outward: its number of lanes away from it.
    """

    line: Curve
    inward: int
    outward: int

    @classmethod
    def towards(cls, yaw: float, reach: float, lanes: int, offset: float = 0.0) -> "Arm":
        """Return an arm from the origin in a direction [rad] with a length [m].

        Its dividing line is `offset` [m] to the left of the origin.
        """
        foot = offset * unit_left(yaw)
        ends = np.stack((foot + reach * unit(yaw), foot))
        return cls(Curve(np.column_stack((ends, np.full(2, yaw + np.pi)))), lanes, lanes)

    @classmethod
    def ramp(cls, entry: Floats, config: RoadConfig) -> "Arm":
        """Return an arm with one lane, in only, whose traffic enters at a pose (3,)."""
        yaw = entry[2] + np.pi
        left = float((entry[:2] * unit_left(yaw)).sum())
        half = 0.5 * config.lane_width * (1.0 if config.traffic_side == "right" else -1.0)
        arm = cls.towards(yaw, float((entry[:2] * unit(yaw)).sum()), 1, left - half)
        return replace(arm, outward=0)

    def lane(self, k: int, config: RoadConfig, *, inward: bool) -> Floats:
        """Return the pose (3,) x, y [m], yaw [rad] of lane k, in the direction of its traffic."""
        is_left = inward != (config.traffic_side == "right")
        left = (k + 0.5) * config.lane_width * (1.0 if is_left else -1.0)
        pose = self.line.at_offset(np.array(0.0), left)
        return pose if inward else reverse(pose)


@dataclass(frozen=True, eq=False)
class Driven:
    """A route that a road is drawn for.

    Attributes:
        connection: the arms and lanes that it joins.
        curve: from the end of one lane to that of the other.
        length: [m] of the vehicle that drives it.
        width: [m] that the vehicle needs.
        trailer: that it tows.
    """

    connection: Connection
    curve: Curve
    length: float
    width: float
    trailer: Trailer | None = None


@dataclass(frozen=True, eq=False)
class Plan:
    """The plan of a road about the origin.

    Attributes:
        arms: its arms; one without lanes outward is a ramp. A single arm is a road through.
        driven: routes through the junction.
        ring: radius [m] of a roundabout's lane about the origin; 0: there is none.
        yielding: the arms that give way if priorities are shown.
        drawn_for: where the recording lies that the road is drawn for.
        lights: recorded lights about the plan's origin, by arm and lane.
        notes: on decisions.
    """

    arms: Sequence[Arm]
    driven: Sequence[Driven] = ()
    ring: float = 0.0
    yielding: Collection[int] = ()
    drawn_for: DrawnFor | None = None
    lights: Mapping[tuple[int, int], TrafficLight] = field(default_factory=dict)
    notes: tuple[Note, ...] = ()

    @property
    def has_junction(self) -> bool:
        """Whether it is more than one road through."""
        return len(self.arms) > 1

    @property
    def has_ramp(self) -> bool:
        """Whether one of its arms is a ramp."""
        return not all(arm.outward for arm in self.arms)


def lane_id(arm: int, lane: int, *, inward: bool) -> str:
    """Return the id of a lane of an arm; lanes count from the dividing line."""
    return f"{arm + 1}.{-lane - 1 if inward else lane + 1}"


def aligned(
    tracks: Sequence[Track],
    lane_of: Mapping[tuple[int, bool], tuple[int, int]],
    frame: Floats,
) -> DrawnFor:
    """Return where a recording lies on the road that is drawn for it.

    Args:
        tracks: of the recording.
        lane_of: arm and lane of the ends of its tracks, as far as they are known, by vehicle and
            whether it is the start.
        frame: (3,) x, y [m], yaw [rad] of the recording's frame, about the plan's origin.
    """
    ids = {key: lane_id(*arm_and_lane, inward=key[1]) for key, arm_and_lane in lane_of.items()}
    lanes = tuple((ids.get((i, True), ""), ids.get((i, False), "")) for i in range(len(tracks)))
    return DrawnFor(frame, lanes)
