# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The lanes of a road: their borders, what follows what, where one may change, how fast."""

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cached_property
import math
from typing import NamedTuple

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.base.road_users import CAR, LANE_USERS
from scenario_gen.numerics import edge_yaws, Floats, freeze, frozen, place
from scenario_gen.types.notes import Note
from scenario_gen.types.traffic_light import SignalSchedule

LEVEL_SPACING_M = 2.5  # height difference of two lanes of which one crosses above the other
OBSTACLE_HEIGHT_M = 1.5
"""Of obstacles in other formats."""
DRIVERS = LANE_USERS - {"pedestrian"}
CARS = frozenset((CAR,))


@dataclass(frozen=True, eq=False)
class Lane:
    """One lane, in the direction in which it is driven.

    Attributes:
        id: its name in the map: a lanelet's number, or road.section.lane of OpenDRIVE.
        left: (M, 2) metres, its left border from begin to end, M >= 2.
        right: (M, 2) metres, its right border; left[k] and right[k] are one cross-section.
        successors: indices of the lanes that its traffic drives into.
        neighbours: indices of the lanes of the same direction to which its traffic may change.
        speed_limit: m/s; NaN where the map does not say.
        junction: the junction that it is part of, "" if none.
        height: (M,) metres, of each cross-section; NaN where it is not known, as where none is
            given.
        users: who may use it, of `LANE_USERS`; (): all that drive.
        crossing: it leads people across the lanes of others, as a zebra crossing does.
        arm: number of its arm of a drawn road, from 1; a through road has one arm; 0: in no arm.
        inward: whether it leads from the end of its arm inwards.
    """

    id: str
    left: Floats
    right: Floats
    successors: tuple[int, ...] = ()
    neighbours: tuple[int, ...] = ()
    speed_limit: float = math.nan
    junction: str = ""
    height: Floats = field(default_factory=lambda: np.zeros(0))
    users: frozenset[str] = frozenset()
    crossing: bool = False
    arm: int = 0
    inward: bool = False

    def __post_init__(self) -> None:
        height = (
            self.height if len(self.height) == len(self.left) else np.full(len(self.left), np.nan)
        )
        users = frozenset() if self.users == DRIVERS else self.users
        freeze(
            self,
            left=frozen(self.left),
            right=frozen(self.right),
            height=frozen(height),
            users=users,
        )
        if not users <= LANE_USERS:
            raise InputError(
                f"lane {self.id}: users {', '.join(sorted(users))}; "
                f"choose of {', '.join(sorted(LANE_USERS))}"
            )
        if (
            self.left.shape != self.right.shape
            or self.left.shape[1:] != (2,)
            or len(self.left) < 2
        ):
            raise InputError(
                f"lane {self.id}: borders of shapes {self.left.shape} and {self.right.shape}; "
                "(M, 2), M >= 2, are needed"
            )
        if not (np.isfinite(self.left).all() and np.isfinite(self.right).all()):
            raise InputError(f"lane {self.id}: a border is not finite")

    def open_to(self, users: Set[str]) -> bool:
        """Return whether one of some users may use it."""
        return not (self.users or DRIVERS).isdisjoint(users)

    @cached_property
    def centre(self) -> Floats:
        """(M, 2) metres, the middle of each cross-section."""
        return frozen((self.left + self.right) / 2.0)

    @cached_property
    def width(self) -> Floats:
        """(M,) metres, the width of each cross-section."""
        return frozen(np.hypot(*(self.left - self.right).T))

    @cached_property
    def middle(self) -> Floats:
        """(M - 1, 2) metres, the middle between each two neighbouring cross-sections."""
        return frozen((self.centre[1:] + self.centre[:-1]) / 2.0)

    @cached_property
    def yaw(self) -> Floats:
        """(M - 1,) rad, the direction from each cross-section to the next."""
        return frozen(edge_yaws(self.centre))

    @cached_property
    def outline(self) -> Floats:
        """(2M, 2) metres: the left border forth and the right border back."""
        return frozen(np.concatenate((self.left, self.right[::-1])))

    @cached_property
    def box(self) -> Floats:
        """(2, 2) metres: the lowest and the highest x, y."""
        return frozen((self.outline.min(axis=0), self.outline.max(axis=0)))


class Obstacle(NamedTuple):
    """A rectangle that does not move, such as a parked car.

    Attributes:
        x: [m] of its centre.
        y: [m] of its centre.
        yaw: [rad] direction of its length.
        length: [m].
        width: [m].
    """

    x: float
    y: float
    yaw: float
    length: float
    width: float

    def __str__(self) -> str:
        return " ".join(f"{value:g}" for value in self)

    @property
    def is_car(self) -> bool:
        """Whether it has the size of a car."""
        return 3.0 <= self.length <= 6.0 and 1.4 <= self.width <= 2.2

    @property
    def outline(self) -> Floats:
        """(4, 2) [m]: its corners, counter-clockwise from the front left."""
        ahead = np.array([1.0, -1.0, -1.0, 1.0]) * self.length / 2.0
        left = np.array([1.0, 1.0, -1.0, -1.0]) * self.width / 2.0
        return place(np.array(self[:3]), ahead, left)


class RuleKind(StrEnum):
    """What traffic has to do."""

    STOP = "stop"  # stop at the line, then give way
    GIVE_WAY = "give_way"
    PRIORITY = "priority"  # go first
    TRAFFIC_LIGHT = "traffic_light"


@dataclass(frozen=True, eq=False)
class TrafficRule:
    """What a sign, a light or a right of way means for the traffic of some lanes.

    Attributes:
        id: its name in the map.
        kind: what they have to do.
        lanes: indices of the lanes whose traffic it concerns.
        over: indices of the lanes whose traffic goes first.
        line: (K, 2) metres, K >= 2, the stop line; (0, 2): there is none.
        schedule: what a light shows, on the clock of the template that the road is drawn for, or
            as a cycle; None: its states are not known.
        turns: the movements that a light is for, as of `TrafficLight`.
    """

    id: str
    kind: RuleKind
    lanes: tuple[int, ...]
    over: tuple[int, ...] = ()
    line: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    schedule: SignalSchedule | None = None
    turns: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        freeze(self, line=frozen(np.reshape(self.line, (-1, 2))))
        if len(self.line) == 1 or not np.isfinite(self.line).all():
            raise InputError(
                f"traffic rule {self.id}: its stop line is a single point, or not finite"
            )


@dataclass(frozen=True, eq=False)
class DrawnFor:
    """How a road was drawn for a template.

    Attributes:
        frame: (3,) x, y [m], yaw [rad] on the road of the template's own frame.
        lanes: by vehicle, the ids of the lanes by which it comes and goes, "" where any may be.
    """

    frame: Floats
    lanes: tuple[tuple[str, str], ...]

    def __post_init__(self) -> None:
        freeze(self, frame=frozen(self.frame))


@dataclass(frozen=True, eq=False)
class LaneNetwork:
    """The lanes that cars may use, of a map or of a part of it; in metres in the road's frame.

    Attributes:
        name: of the map, for people.
        lanes: the lanes; `Lane.successors` and `Lane.neighbours` count in here.
        notes: how it was read: projection, what was left out, which part it is.
        rules: its signs, lights and rights of way.
        rules_kept: whether scenarios keep to the rules.
        drawn: whether it was drawn with its road: it is shown and exported, and nobody is held to
            it.
        drawn_for: how it was drawn for a template; None: for none, or without a place for it.
        origin: latitude and longitude [degrees] about which the frame is `geodesy`'s; (): the map
            says metres.
        obstacles: what stands on the road, or of a whole map, anywhere.
        of_all: the lanes of all users, those of cars first, in the order of `lanes`; their
            `successors` and `neighbours` count in here. (): no lane is closed to cars.
    """

    name: str
    lanes: tuple[Lane, ...]
    notes: tuple[Note, ...] = field(default=())
    rules: tuple[TrafficRule, ...] = ()
    rules_kept: bool = True
    drawn: bool = False
    drawn_for: DrawnFor | None = None
    origin: tuple[float, ...] = ()
    of_all: tuple[Lane, ...] = ()
    obstacles: tuple[Obstacle, ...] = ()

    def __post_init__(self) -> None:
        if len(self.origin) not in (0, 2):
            raise InputError(
                f"lanes of {self.name!r}: origin {self.origin}; latitude and longitude are needed"
            )
        count = len(self.lanes)
        for rule in self.rules:
            if any(not 0 <= k < count for k in (*rule.lanes, *rule.over)):
                raise InputError(
                    f"traffic rule {rule.id} of {self.name!r} names a lane that is not there"
                )
        for lanes in (self.lanes, self.of_all):
            for lane in lanes:
                if any(not 0 <= k < len(lanes) for k in (*lane.successors, *lane.neighbours)):
                    raise InputError(
                        f"lane {lane.id} of {self.name!r} leads to a lane that is not there"
                    )

    def with_lanes(self, lanes: Sequence[Lane]) -> "LaneNetwork":
        """Return the network with these lanes, of all users, in place of its own."""
        order = sorted(range(len(lanes)), key=lambda k: not lanes[k].open_to(CARS))
        of_all = _chosen(lanes, order)
        cars = [k for k, lane in enumerate(of_all) if lane.open_to(CARS)]
        return replace(
            self, lanes=_chosen(of_all, cars), of_all=of_all if len(cars) < len(of_all) else ()
        )

    @property
    def every_lane(self) -> tuple[Lane, ...]:
        """The lanes of all users, those of cars first."""
        return self.of_all or self.lanes

    @property
    def others(self) -> tuple[Lane, ...]:
        """The lanes that are closed to cars: bus lanes, cycle lanes, footways, crossings."""
        return self.of_all[len(self.lanes) :]

    @property
    def whole(self) -> "LaneNetwork":
        """The network whose lanes are those of all users."""
        return replace(self, lanes=self.of_all, of_all=()) if self.of_all else self

    def open_to(self, users: frozenset[str]) -> "LaneNetwork":
        """Return the lanes that one of some users may use; itself if these are its own."""
        lanes = self.every_lane
        kept = [k for k, lane in enumerate(lanes) if lane.open_to(users)]
        if kept == list(range(len(self.lanes))):
            return self
        index = {k: n for n, k in enumerate(kept)}

        rules = (
            replace(rule, lanes=_renumbered(rule.lanes, index), over=_renumbered(rule.over, index))
            for rule in self.rules
        )
        return replace(
            self,
            lanes=_chosen(lanes, kept),
            rules=tuple(rule for rule in rules if rule.lanes),
            of_all=(),
        )

    def for_users(self, users: frozenset[str]) -> "LaneNetwork":
        """Return the lanes of cars, the same ones first, and those that some users may use."""
        return self.open_to(users | CARS) if self.of_all else self

    @cached_property
    def users_of_car_lanes(self) -> frozenset[str]:
        """The users who may use all lanes of cars, and no others."""
        return frozenset(user for user in LANE_USERS if self.open_to(frozenset((user,))) is self)

    def moved(self, by: Floats) -> "LaneNetwork":
        """The same lanes (2,) [m] farther."""
        lanes = [
            replace(lane, left=lane.left + by, right=lane.right + by) for lane in self.every_lane
        ]
        rules = (replace(rule, line=rule.line + by) for rule in self.rules)
        aim = self.drawn_for and replace(
            self.drawn_for, frame=self.drawn_for.frame + np.array([*by, 0.0])
        )
        return replace(self.with_lanes(lanes), rules=tuple(rules), drawn_for=aim)

    @cached_property
    def has_levels(self) -> bool:
        """Whether some lanes may lie above others."""
        height = (
            np.concatenate([lane.height[np.isfinite(lane.height)] for lane in self.lanes])
            if self.lanes
            else np.zeros(0)
        )
        return bool(len(height) and np.ptp(height) > LEVEL_SPACING_M)

    @cached_property
    def predecessors(self) -> tuple[tuple[int, ...], ...]:
        """The lanes that lead into each lane."""
        before: list[list[int]] = [[] for _ in self.lanes]
        for k, lane in enumerate(self.lanes):
            for after in lane.successors:
                before[after].append(k)
        return tuple(map(tuple, before))

    @cached_property
    def entries(self) -> tuple[int, ...]:
        """The lanes by which traffic comes in: no lane leads into them."""
        return tuple(k for k, before in enumerate(self.predecessors) if not before)

    @cached_property
    def exits(self) -> tuple[int, ...]:
        """The lanes by which traffic leaves: they lead nowhere."""
        return tuple(k for k, lane in enumerate(self.lanes) if not lane.successors)

    @cached_property
    def arms(self) -> dict[int, tuple[int, ...]]:
        """The lanes of each arm of a drawn road."""
        arms: dict[int, tuple[int, ...]] = {}
        for k, lane in enumerate(self.lanes):
            if lane.arm:
                arms[lane.arm] = (*arms.get(lane.arm, ()), k)
        return arms

    @cached_property
    def traffic_side(self) -> str:
        """The side on which traffic drives: "right" or "left"; "" without oncoming lanes.

        In right-hand traffic the oncoming lane has the same left border.
        """
        left, right = (
            _shared([getattr(lane, side) for lane in self.lanes]) for side in ("left", "right")
        )
        return "right" if left > right else "left" if right > left else ""

    @cached_property
    def box(self) -> Floats:
        """(2, 2) metres: lowest and highest x, y of all borders."""
        points = np.concatenate([lane.outline for lane in self.lanes])
        return frozen(np.stack((points.min(axis=0), points.max(axis=0))))


def _chosen(lanes: Sequence[Lane], kept: Sequence[int]) -> tuple[Lane, ...]:
    """Return some of the lanes, and of their neighbours those that are among these."""
    index = {k: n for n, k in enumerate(kept)}
    chosen = []
    for lane in (lanes[k] for k in kept):
        successors = _renumbered(lane.successors, index)
        neighbours = _renumbered(lane.neighbours, index)
        is_same = (successors, neighbours) == (lane.successors, lane.neighbours)
        changed = replace(lane, successors=successors, neighbours=neighbours)
        chosen.append(lane if is_same else changed)
    return tuple(chosen)


def _renumbered(lanes: Sequence[int], index: Mapping[int, int]) -> tuple[int, ...]:
    """Return the new indices of those lanes that have one."""
    return tuple(index[k] for k in lanes if k in index)


def _shared(borders: Sequence[Floats]) -> int:
    """Count points of borders (M, 2) [m] with an opposite border in the same square metre."""
    directions: dict[tuple[int, int], list[Floats]] = {}
    count = 0
    for border in borders:
        step = np.gradient(border, axis=0)
        step = step / np.maximum(np.sqrt(np.square(step).sum(axis=1)), 1e-9)[:, None]
        cells = map(tuple, np.floor(border).astype(np.int64).tolist())
        for cell, direction in dict(zip(cells, step, strict=True)).items():
            others = directions.setdefault(cell, [])
            count += any(float((other * direction).sum()) < -0.9 for other in others)  # cosines
            others.append(direction)
    return count
