# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Types of road users: sizes, limits of motion, and names in other formats.

A new type is an entry here or in a plugin.

Sources: sizes: the defaults of SUMO's vehicle classes (Vehicle Type Parameter Defaults), a car's
as of a European estate.
Motion: limits, not what is usual. Turning: a bus and a truck keep to the annulus of 12.5 m and 5.3
    m of UN Regulation 107 and
Regulation (EU) 1230/2012, so that the middle of the footprint turns with 8 m; a car's turning
circle between kerbs is 10.5 m.
Walking: Weidmann 1993 (1.34 m/s, to 2 m/s); running ends at 5 m/s. Bicycles: 45 km/h (L1e-B) is
    the fastest that is one.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
import math

from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.base.registry import Registry

CAR, TRUCK, OTHER = "car", "truck", "other"
TRUCK_LENGTH = 7.0  # m, from which on a vehicle of unknown type counts as a truck
LANE_USERS = frozenset(
    (CAR, "van", TRUCK, "bus", "motorcycle", "bicycle", "pedestrian")
)  # whom lanes can be for
ON_THE_SPOT = 2.0  # 1/m: who turns on the spot is planned to walk so sharp a curve


@dataclass(frozen=True)
class Dynamics(Parameters):
    """Limits of a type's motion, to which a valid scenario keeps."""

    max_speed: float = parameter(45.0, "highest speed", unit="m/s", low=0.0)
    max_acceleration: float = parameter(5.0, "strongest speeding up", unit="m/s²", low=0.0)
    max_deceleration: float = parameter(9.0, "strongest braking", unit="m/s²", low=0.0)
    max_lateral_acceleration: float = parameter(
        6.0, "largest product of speed and yaw rate", unit="m/s²", low=0.0
    )
    max_curvature: float = parameter(
        0.25,
        "largest change of heading per metre driven; 0: turns on the spot",
        unit="1/m",
        low=0.0,
    )

    @property
    def sharpest(self) -> float:
        """The largest curvature [1/m]; infinite for who turns on the spot."""
        return self.max_curvature or math.inf

    @property
    def planned(self) -> "Dynamics":
        """What routes and speeds are planned with.

        Somewhat less, so that what is drawn about them keeps to the limits.
        """
        return replace(
            self,
            max_speed=self.max_speed * 8.0 / 9.0,
            max_acceleration=self.max_acceleration * 0.9,
            max_deceleration=self.max_deceleration * 8.0 / 9.0,
            max_lateral_acceleration=self.max_lateral_acceleration * 5.0 / 6.0,
            max_curvature=min(self.sharpest * 0.9, ON_THE_SPOT),
        )


@dataclass(frozen=True)
class VehicleType:
    """A type of road users.

    Attributes:
        length, width, height: usual ones, metres.
        dynamics: its limits, unless parameters `limits.<type>.…` say otherwise.
        words: what logs call it, in small letters.
        autoware: its label in ObjectClassification.
        commonroad: its obstacle type.
        openscenario: its VehicleCategory, or "pedestrian".
        osi: its name in MovingObject.VehicleClassification.Type, or "PEDESTRIAN".
        scenarionet: its type in MetaDrive's and ScenarioNet's descriptions.
        waits_below: speed [m/s] below which it waits.
        speed_noise: differences of speed [m/s] that say nothing of what it is about; on foot those
            of a step.
        varies: share of the spread of a car's end speeds, and places at a time, with which
            scenarios are drawn.
    """

    length: float
    width: float
    height: float
    dynamics: Dynamics
    words: tuple[str, ...] = ()
    autoware: int = 0
    commonroad: str = "unknown"
    openscenario: str = "car"
    osi: str = "OTHER"
    scenarionet: str = "VEHICLE"
    waits_below: float = 0.5
    speed_noise: float = 0.1
    varies: float = 1.0

    @property
    def least_course(self) -> float:
        """Speed [m/s] above which positions say where it is going."""
        return 2.0 * self.waits_below

    @property
    def walks(self) -> bool:
        """Whether it is on foot."""
        return self.openscenario == "pedestrian"

    @property
    def lane_user(self) -> frozenset[str]:
        """As what it may use lanes, one of `LANE_USERS`.

        A type of a plugin as the one with its category in OpenSCENARIO.
        """
        own = {"motorbike": "motorcycle"}.get(self.openscenario, self.openscenario)
        return frozenset((own if own in LANE_USERS else CAR,))


VEHICLE_TYPES = Registry[VehicleType](
    "scenario_gen.vehicle_types",
    {
        CAR: VehicleType(
            4.8, 1.9, 1.5, Dynamics(),
            ("auto", "automobile", "passenger", "taxi", "suv", "priorityvehicle", "pickup"),
            1, "car", "car", "CAR",
        ),
        "van": VehicleType(
            6.5, 2.2, 2.5, Dynamics(45.0, 4.0, 9.0, 5.5, 0.22), ("delivery", "minibus"), 1, "car", "van", "DELIVERY_VAN"
        ),
        TRUCK: VehicleType(
            7.1, 2.4, 3.2, Dynamics(36.0, 3.0, 7.5, 4.5, 0.16),
            ("lorry", "semitractor", "semitrailer", "trailer", "heavy", "hgv"), 2, "truck", "truck", "HEAVY_TRUCK",
        ),
        "bus": VehicleType(
            12.0, 2.55, 3.2, Dynamics(30.0, 3.0, 7.0, 4.0, 0.125), ("coach",), 3, "bus", "bus", "BUS"
        ),
        "motorcycle": VehicleType(
            2.2, 0.9, 1.5, Dynamics(50.0, 7.0, 9.0, 8.0, 0.4),
            ("motorcyclist", "motorbike", "moped", "scooter"), 5, "motorcycle", "motorbike", "MOTORBIKE", "CYCLIST",
        ),
        "bicycle": VehicleType(
            1.8, 0.65, 1.7, Dynamics(14.0, 3.0, 6.0, 4.5, 0.7),
            ("bicyclist", "cyclist", "cycle", "bike", "biker", "biketype", "standup", "micromobility"),
            6, "bicycle", "bicycle", "BICYCLE", "CYCLIST",
        ),
        "pedestrian": VehicleType(
            0.5, 0.5, 1.7, Dynamics(5.0, 4.0, 5.0, 4.0, 0.0),
            ("ped", "pedtype", "person", "people", "human", "walker", "adult", "child", "wheelchair", "stroller", "skater"),
            7, "pedestrian", "pedestrian", "PEDESTRIAN", "PEDESTRIAN", 0.2, 0.15, 0.3,
        ),
        OTHER: VehicleType(4.8, 1.9, 1.5, Dynamics()),
    },
    VehicleType,
)  # fmt: skip
"""By name; those of installed packages come last."""


_BUILT_IN = VEHICLE_TYPES.built_in


@dataclass(frozen=True)
class TypeLimits(Parameters):
    """The limits of motion by type, for all stages.

    Attributes:
        plugins: of types of installed packages, what was set, by name; the last one counts. Else
            they keep those of their entry.
    """

    car: Dynamics = _BUILT_IN[CAR].dynamics
    van: Dynamics = _BUILT_IN["van"].dynamics
    truck: Dynamics = _BUILT_IN[TRUCK].dynamics
    bus: Dynamics = _BUILT_IN["bus"].dynamics
    motorcycle: Dynamics = _BUILT_IN["motorcycle"].dynamics
    bicycle: Dynamics = _BUILT_IN["bicycle"].dynamics
    pedestrian: Dynamics = _BUILT_IN["pedestrian"].dynamics
    other: Dynamics = _BUILT_IN[OTHER].dynamics
    plugins: tuple[tuple[str, Dynamics], ...] = ()

    @property
    def of_plugins(self) -> Mapping[str, Dynamics]:
        """Those of types of installed packages."""
        return {
            name: self.of(name)
            for name in VEHICLE_TYPES.names()
            if name not in VEHICLE_TYPES.built_in
        }

    def of(self, name: str) -> Dynamics:
        """Return the limits of a type.

        Raises:
            InputError: there is no type of this name.
        """
        own: Dynamics | None = (
            getattr(self, name, None) if name in VEHICLE_TYPES.built_in else None
        )
        return own or dict(self.plugins).get(name) or VEHICLE_TYPES[name].dynamics


def usual_type(length: float) -> str:
    """Return the type of a vehicle of which no more is known than its length [m]."""
    return TRUCK if length >= TRUCK_LENGTH else CAR


def words() -> Mapping[str, str]:
    """Return what logs call types, of installed packages too, and the types."""
    return {
        word: name for name in VEHICLE_TYPES.names() for word in (name, *VEHICLE_TYPES[name].words)
    }
