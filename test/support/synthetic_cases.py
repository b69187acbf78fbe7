# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The bundled log: the paper's three cases (V-A, Fig. 3), made up and named synthetic everywhere.

Each case is a drive on roads with lanes of 3.5 m, right-hand traffic, with constant acceleration between known changepoints:

- a: one vehicle waits at the side road throughout; the other brakes for 7 s to a stop, both stand for 3 s, then it turns right.
- b: opposite directions; one accelerates, the other slows down, lets it pass and turns left, speeding up.
- c: opposite directions on a straight road, with changes of speed.

What is recorded of it is what a receiver of basic safety messages records: NavSatFix and TwistStamped per vehicle, with
coloured GPS noise, a speed sensor off by a percent, jittered stamps, lost and repeated messages.
"""

from dataclasses import dataclass

import numpy as np

from scenario_gen.bags.storage.definitions import type_store
from scenario_gen.bags.vehicles import FIX, TWIST
from scenario_gen.logs.synthetic import CASES
from scenario_gen.numerics.arrays import Floats
from scenario_gen.types import Vehicle

STORES = type_store()
ORIGIN = (42.3, -83.7)  # degrees; the roads are invented, nothing was recorded there
START_NS = 1_767_225_600 * 10**9  # 2026-01-01 00:00:00 UTC
LANE = 3.5  # m


@dataclass(frozen=True)
class Leg:
    """`metres` of path with constant curvature [1/m], positive to the left."""

    metres: float
    curvature: float = 0.0


@dataclass(frozen=True)
class Phase:
    """`seconds` of driving with constant acceleration [m/s²]."""

    seconds: float
    acceleration: float = 0.0


@dataclass(frozen=True)
class Drive:
    """A vehicle's true motion: from a pose (x, y, heading) at a speed, along legs, through phases; it begins at `begin` [s]."""

    vehicle: Vehicle
    pose: tuple[float, float, float]
    speed: float
    legs: tuple[Leg, ...]
    phases: tuple[Phase, ...]
    begin: float = 0.0

    def state(self, time: Floats) -> Floats:
        """(T, 4) true x, y, heading and speed at times [s] since the start."""
        distance, speed = self._motion(time)
        out = np.empty((len(time), 4))
        out[:, 3] = speed
        x, y, heading = self.pose
        begin = 0.0
        for number, leg in enumerate(self.legs):
            last = number == len(self.legs) - 1
            here = (distance >= begin) & ((distance < begin + leg.metres) | last)
            out[here, :3] = along(x, y, heading, leg.curvature, distance[here] - begin)
            x, y, heading = along(x, y, heading, leg.curvature, np.array([leg.metres]))[0]
            begin += leg.metres
        return out

    def _motion(self, time: Floats) -> tuple[Floats, Floats]:
        """Distance driven and speed."""
        distance, speed = np.zeros(len(time)), np.full(len(time), self.speed)
        entry, begin = self.speed, self.begin
        for phase in self.phases:
            during = np.clip(time - begin, 0.0, phase.seconds)
            distance += entry * during + 0.5 * phase.acceleration * during**2
            speed += phase.acceleration * during
            entry += phase.acceleration * phase.seconds
            begin += phase.seconds
        return distance, np.where(speed < 1e-9, 0.0, speed)

    @property
    def end(self) -> float:
        """The time [s] at which the last phase ends."""
        return self.begin + sum(phase.seconds for phase in self.phases)


def along(x: float, y: float, heading: float, curvature: float, metres: Floats) -> Floats:
    """(K, 3) poses at distances along a straight line or an arc."""
    end = heading + curvature * metres
    if curvature == 0.0:
        return np.column_stack([x + metres * np.cos(heading), y + metres * np.sin(heading), end])
    return np.column_stack(
        [
            x + (np.sin(end) - np.sin(heading)) / curvature,
            y - (np.cos(end) - np.cos(heading)) / curvature,
            end,
        ]
    )


@dataclass(frozen=True)
class Case:
    """A case with its ground truth; its time runs from 0, when all vehicles are within radio range, to `duration`."""

    name: str
    drives: tuple[Drive, ...]

    @property
    def duration(self) -> float:
        """Seconds."""
        return min(drive.end for drive in self.drives)


def quarter(radius: float, side: int) -> Leg:
    """A right-angled turn to the left (side 1) or the right (-1)."""
    return Leg(radius * np.pi / 2.0, side / radius)


def make_case(name: str) -> Case:
    """Return one of the three cases; the main road runs east, a side road joins from the south at x = 0."""
    east, west, north = 0.0, np.pi, np.pi / 2.0
    near, far = (
        -LANE / 2.0,
        LANE / 2.0,
    )  # y of the eastbound and the westbound lane; x of the lanes of the side road
    first, second = Vehicle("1"), Vehicle("2")
    if name == "a":
        arrives = (
            Phase(2.0),
            Phase(4.0, -1.25),
            Phase(20.0),
        )  # heard before the other comes into range, so its heading is known
        waits = Drive(first, (far, -9.0 - 20.0, north), 5.0, (Leg(1.0),), arrives, begin=-8.0)
        brakes = 11.0 / 7.0
        stop = near - 8.0 - 2.0  # 2 m before the turn of radius 8 m begins
        turns = Drive(
            second,
            (stop - 38.5, near, east),
            11.0,
            (Leg(40.5), quarter(8.0, -1), Leg(1.0)),
            (Phase(7.0, -brakes), Phase(3.0), Phase(8.0, 0.7)),
        )
        return Case("synthetic_a", (waits, turns))
    if name == "b":
        passes = Drive(first, (-36.0, near, east), 5.0, (Leg(1.0),), (Phase(15.0, 0.45),))
        turns = Drive(
            second,
            (near + 12.0 + 50.0, far, west),
            10.5,
            (Leg(50.0), quarter(12.0, 1), Leg(1.0)),
            (Phase(7.0, -1.0), Phase(8.0, 0.5)),
        )
        return Case("synthetic_b", (passes, turns))
    if name != "c":
        raise ValueError(f"there is no case {name!r}; choose one of {', '.join(CASES)}")
    slows = Drive(
        first,
        (-46.0, near, east),
        8.0,
        (Leg(1.0),),
        (Phase(4.0), Phase(4.0, -1.25), Phase(4.0), Phase(4.0, 1.5)),
    )
    speeds_up = Drive(
        second,
        (47.0, far, west),
        4.0,
        (Leg(1.0),),
        (Phase(4.0), Phase(4.0, 1.0), Phase(4.0), Phase(4.0, -1.0)),
    )
    return Case("synthetic_c", (slows, speeds_up))


def nanoseconds_to_time(stamp: int) -> object:
    """A builtin_interfaces/Time."""
    return STORES.types["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9)


def fix_message(header: object, latitude: float, longitude: float) -> object:
    """A NavSatFix of a receiver with noise of 0.3 m."""
    variance = 0.3**2
    return STORES.types[FIX](
        header=header,
        status=STORES.types["sensor_msgs/msg/NavSatStatus"](status=0, service=1),
        latitude=latitude,
        longitude=longitude,
        altitude=260.0,
        position_covariance=np.array(
            [variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, 4.0 * variance]
        ),
        position_covariance_type=2,
    )


def twist_message(header: object, speed: float) -> object:
    """A TwistStamped with the speed along the vehicle's x axis."""
    vector = STORES.types["geometry_msgs/msg/Vector3"]
    twist = STORES.types["geometry_msgs/msg/Twist"]
    linear, angular = vector(x=speed, y=0.0, z=0.0), vector(x=0.0, y=0.0, z=0.0)
    return STORES.types[TWIST](header=header, twist=twist(linear=linear, angular=angular))
