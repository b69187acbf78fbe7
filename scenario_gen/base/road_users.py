# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Types of road users: sizes, limits of motion, and names in other formats.

A new type is an entry here or in a plugin.

Sources:

- Sizes: the defaults of SUMO's vehicle classes (Vehicle Type Parameter Defaults), a car's as of a
  European estate.
- Motion: limits, not what is usual. Turning: a bus and a truck keep to the annulus of 12.5 m and
  5.3 m of UN Regulation 107 and Regulation (EU) 1230/2012, so that the middle of the footprint
  turns with 8 m; a car's turning circle between kerbs is 10.5 m.
- Walking: Weidmann 1993 (1.34 m/s, to 2 m/s); running ends at 5 m/s. Bicycles: 45 km/h (L1e-B) is
  the fastest that is one. E-scooters: those of German law (eKFV) reach 20 km/h, others 25 km/h.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
import math

from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.base.registry import Registry

CAR, TRUCK, TRAILER, OTHER = "car", "truck", "trailer", "other"
MIN_TRUCK_LENGTH_M = 7.0  # of a vehicle of unknown type
LANE_USERS = frozenset(
    (CAR, "van", TRUCK, "bus", "motorcycle", "bicycle", "pedestrian")
)  # whom lanes can be for
MAX_PLANNED_CURVATURE_PER_M = 2.0  # for a type that can turn on the spot


@dataclass(frozen=True)
class Dynamics(Parameters):
    """Limits of a type's motion, which valid scenarios satisfy."""

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
        """The largest curvature [1/m], infinite for a type that turns on the spot."""
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
            max_curvature=min(self.sharpest * 0.9, MAX_PLANNED_CURVATURE_PER_M),
        )


@dataclass(frozen=True)
class VehicleType:
    """A type of road users.

    Attributes:
        length: usual length [m].
        width: usual width [m].
        height: usual height [m].
        dynamics: its limits; the parameters `limits.<type>.…` have precedence.
        words: its names in logs, in lower case.
        autoware: its label in ObjectClassification.
        commonroad: its obstacle type.
        openscenario: its VehicleCategory, or "pedestrian".
        scenarionet: its type in MetaDrive's and ScenarioNet's descriptions.
        waits_below: speed [m/s] below which it waits.
        speed_noise: meaningless differences of speed [m/s], on foot those of a step.
        varies: factor of a car's standard deviations of end speeds, of places at a time and of
            the strength of braking.
    """

    length: float
    width: float
    height: float
    dynamics: Dynamics
    words: tuple[str, ...] = ()
    autoware: int = 0
    commonroad: str = "unknown"
    openscenario: str = "car"
    scenarionet: str = "VEHICLE"
    waits_below: float = 0.5
    speed_noise: float = 0.1
    varies: float = 1.0

    @property
    def least_course(self) -> float:
        """Speed [m/s] above which its positions determine its direction."""
        return 2.0 * self.waits_below

    @property
    def walks(self) -> bool:
        """Whether it is on foot."""
        return self.openscenario == "pedestrian"

    @property
    def lane_user(self) -> frozenset[str]:
        """The one of `LANE_USERS` as which it may use lanes, by its category in OpenSCENARIO."""
        user = {"motorbike": "motorcycle", TRAILER: TRUCK}.get(
            self.openscenario, self.openscenario
        )
        return frozenset((user if user in LANE_USERS else CAR,))


_BUILT_IN = {
    CAR: VehicleType(
        length=4.8,
        width=1.9,
        height=1.5,
        dynamics=Dynamics(),
        words=("auto", "automobile", "passenger", "taxi", "suv", "priorityvehicle", "pickup"),
        autoware=1,
        commonroad="car",
        openscenario="car",
    ),
    "van": VehicleType(
        length=6.5,
        width=2.2,
        height=2.5,
        dynamics=Dynamics(45.0, 4.0, 9.0, 5.5, 0.22),
        words=("delivery", "minibus"),
        autoware=1,
        commonroad="car",
        openscenario="van",
    ),
    TRUCK: VehicleType(
        length=7.1,
        width=2.4,
        height=3.2,
        dynamics=Dynamics(36.0, 3.0, 7.5, 4.5, 0.16),
        words=("lorry", "semitractor", "heavy", "hgv"),
        autoware=2,
        commonroad="truck",
        openscenario="truck",
    ),
    TRAILER: VehicleType(
        length=8.0,
        width=2.4,
        height=3.2,
        dynamics=Dynamics(36.0, 3.0, 7.5, 4.5, 0.16),
        words=("semitrailer",),
        autoware=4,
        commonroad="truck",
        openscenario=TRAILER,
    ),
    "bus": VehicleType(
        length=12.0,
        width=2.55,
        height=3.2,
        dynamics=Dynamics(30.0, 3.0, 7.0, 4.0, 0.125),
        words=("coach",),
        autoware=3,
        commonroad="bus",
        openscenario="bus",
    ),
    "motorcycle": VehicleType(
        length=2.2,
        width=0.9,
        height=1.5,
        dynamics=Dynamics(50.0, 7.0, 9.0, 8.0, 0.4),
        words=("motorcyclist", "motorbike", "moped", "scooter"),
        autoware=5,
        commonroad="motorcycle",
        openscenario="motorbike",
        scenarionet="CYCLIST",
    ),
    "bicycle": VehicleType(
        length=1.8,
        width=0.65,
        height=1.7,
        dynamics=Dynamics(14.0, 3.0, 6.0, 4.5, 0.7),
        words=(
            "bicyclist",
            "cyclist",
            "cycle",
            "bike",
            "biker",
            "biketype",
            "pedelec",
        ),
        autoware=6,
        commonroad="bicycle",
        openscenario="bicycle",
        scenarionet="CYCLIST",
    ),
    "e_scooter": VehicleType(
        length=1.2,
        width=0.6,
        height=1.8,
        dynamics=Dynamics(8.0, 3.0, 5.0, 4.0, 1.0),
        words=(
            "escooter",
            "electric scooter",
            "kick scooter",
            "standup scooter",
            "standup",
            "micromobility",
        ),
        autoware=6,
        commonroad="bicycle",
        openscenario="bicycle",
        scenarionet="CYCLIST",
    ),
    "pedestrian": VehicleType(
        length=0.5,
        width=0.5,
        height=1.7,
        dynamics=Dynamics(5.0, 4.0, 5.0, 4.0, 0.0),
        words=(
            "ped",
            "pedtype",
            "person",
            "people",
            "human",
            "walker",
            "adult",
            "child",
            "wheelchair",
            "mobility scooter",
            "stroller",
            "skater",
        ),
        autoware=7,
        commonroad="pedestrian",
        openscenario="pedestrian",
        scenarionet="PEDESTRIAN",
        waits_below=0.2,
        speed_noise=0.15,
        varies=0.06,
    ),
    OTHER: VehicleType(length=4.8, width=1.9, height=1.5, dynamics=Dynamics()),
}
VEHICLE_TYPES = Registry[VehicleType]("scenario_gen.vehicle_types", _BUILT_IN, VehicleType)
"""The types by name, those of installed packages last."""


@dataclass(frozen=True)
class TypeLimits(Parameters):
    """The limits of motion by type, for all stages.

    Attributes:
        plugins: changed limits of types in installed packages, by name; the last one counts.
    """

    car: Dynamics = _BUILT_IN[CAR].dynamics
    van: Dynamics = _BUILT_IN["van"].dynamics
    truck: Dynamics = _BUILT_IN[TRUCK].dynamics
    trailer: Dynamics = _BUILT_IN[TRAILER].dynamics
    bus: Dynamics = _BUILT_IN["bus"].dynamics
    motorcycle: Dynamics = _BUILT_IN["motorcycle"].dynamics
    bicycle: Dynamics = _BUILT_IN["bicycle"].dynamics
    e_scooter: Dynamics = _BUILT_IN["e_scooter"].dynamics
    pedestrian: Dynamics = _BUILT_IN["pedestrian"].dynamics
    other: Dynamics = _BUILT_IN[OTHER].dynamics
    plugins: tuple[tuple[str, Dynamics], ...] = ()

    @property
    def of_plugins(self) -> Mapping[str, Dynamics]:
        """The limits of types in installed packages."""
        return {
            name: self.of(name)
            for name in VEHICLE_TYPES.names()
            if name not in VEHICLE_TYPES.built_in
        }

    def of(self, name: str) -> Dynamics:
        """Return the limits of a type.

        Raises:
            InputError: no type has this name.
        """
        if name in VEHICLE_TYPES.built_in:
            built_in: Dynamics = getattr(self, name)
            return built_in
        return dict(self.plugins).get(name) or VEHICLE_TYPES[name].dynamics


def usual_type(length: float) -> str:
    """Return the type of a vehicle with only its length [m] known."""
    return TRUCK if length >= MIN_TRUCK_LENGTH_M else CAR


def words() -> Mapping[str, str]:
    """Return the types by their names in logs."""
    types: dict[str, str] = {}
    for name in VEHICLE_TYPES.names():
        types |= dict.fromkeys((name, *VEHICLE_TYPES[name].words), name)
    return types
