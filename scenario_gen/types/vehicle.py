# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The identity, footprint and type of a road user."""

from collections.abc import Iterable
from dataclasses import dataclass
import math
from typing import Any

import numpy as np

from scenario_gen.base.errors import did_you_mean, InputError
from scenario_gen.base.road_users import (
    CAR,
    OTHER,
    usual_type,
    VEHICLE_TYPES,
    VehicleType,
)
from scenario_gen.numerics import edge_lengths, edge_yaws, Floats, unit


@dataclass(frozen=True)
class Trailer:
    """A trailer, whose axle lies below its centre.

    Attributes:
        id: unique among the vehicles, too.
        length, width: of its footprint [m].
        hitch: from the centre of the vehicle that tows it back to the hitch [m].
        reach: from the hitch back to its own centre [m].
    """

    id: str
    length: float
    width: float
    hitch: float
    reach: float


@dataclass(frozen=True)
class Vehicle:
    """A road user.

    Attributes:
        id: unique within an encounter or a scenario.
        length, width: of the footprint [m].
        type: a name in `VEHICLE_TYPES`; the default follows from the length: a car or a truck.
        trailer: what it tows; None: nothing. See `Motion.with_trailers`.

    Raises:
        InputError: the type is not known.

    Example:
        >>> Vehicle("12", 12.0, 2.5, "bus").label
        'bus 12'
    """

    id: str
    length: float = 4.8
    width: float = 1.9
    type: str = ""
    trailer: Trailer | None = None

    def __post_init__(self) -> None:
        if not self.type:
            object.__setattr__(self, "type", usual_type(self.length))
        elif self.type not in VEHICLE_TYPES:
            raise InputError(
                f"vehicle {self.id} is of type {self.type!r}; known are "
                f"{', '.join(VEHICLE_TYPES.names())}: install the package that has it"
            )

    @property
    def kind(self) -> VehicleType:
        """The properties of its type."""
        return VEHICLE_TYPES[self.type]

    @property
    def label(self) -> str:
        """Type and id, such as "bus 7"; a car and a vehicle of unspecified type is a "vehicle"."""
        return f"{'vehicle' if self.type in (CAR, OTHER) else self.type} {self.id}"

    @property
    def is_narrow(self) -> bool:
        """Whether it is as narrow as a two-wheeler, which shares lanes."""
        return self.width <= 1.2

    @property
    def half(self) -> tuple[float, float]:
        """Half its length and half its width [m]."""
        return 0.5 * self.length, 0.5 * self.width

    @property
    def rear(self) -> float:
        """From its centre back to its rear bumper, or to that of its trailer [m]."""
        if self.trailer is None:
            return 0.5 * self.length
        return self.trailer.hitch + self.trailer.reach + 0.5 * self.trailer.length


def most_exposed(vehicles: Iterable[Vehicle]) -> str:
    """Return the type of the most exposed road user: the type with the smallest usual width."""
    types = {vehicle.type for vehicle in vehicles}
    return min(types, key=lambda name: (VEHICLE_TYPES[name].width, name))


REAR_AXLE_SHARE = 0.3  # of the length, from the footprint's centre back: 1.44 m of a car of 4.8 m
WHEELBASE_SHARE = 0.6  # of the length


def height(vehicle: Vehicle) -> float:
    """Height in metres, by type; logs do not hold it."""
    return vehicle.kind.height


def rear_axle(vehicle: Vehicle) -> float:
    """Metres from the footprint's centre back to the rear axle's middle, as a share of the length.

    Who walks is placed by the middle.
    """
    return 0.0 if vehicle.kind.walks else REAR_AXLE_SHARE * vehicle.length


def shifted(position: Floats, heading: Floats, ahead: float) -> Floats:
    """Return positions (..., 2) [m] shifted by `ahead` [m] along headings (...) [rad]."""
    return np.asarray(position + ahead * unit(heading))


def trailer_poses(poses: Floats, trailer: Trailer, first: float | None = None) -> Floats:
    """Return the poses (T, 3) x, y [m], yaw [rad] of a trailer behind those of its vehicle.

    It begins with the yaw `first` [rad], or else straight behind, and follows the hitch without
    side slip: on a straight way s [m] of the hitch, the tangent of half the angle from the trailer
    to the way falls with exp(-s / reach) (tractrix).
    """
    hitch = shifted(poses[:, :2], poses[:, 2], -trailer.hitch)
    remaining = np.exp(-edge_lengths(hitch) / trailer.reach)
    yaw = [float(poses[0, 2]) if first is None else first]
    for way, share in zip(edge_yaws(hitch).tolist(), remaining.tolist(), strict=True):
        angle = math.remainder(way - yaw[-1], 2.0 * math.pi)
        yaw.append(yaw[-1] + angle - 2.0 * math.atan(math.tan(0.5 * angle) * share))
    heading = np.array(yaw)
    return np.column_stack([shifted(hitch, heading, -trailer.reach), heading])


class Vehicles(tuple[Vehicle, ...]):
    """The vehicles of a motion, by index or by id.

    Example:
        >>> Vehicles([Vehicle("12", 12.0, 2.5), Vehicle("7", 4.5, 1.8)])["7"].length
        4.5
    """

    __slots__ = ()

    def __getitem__(self, key: Any) -> Any:
        """Return the vehicle with an id, or as a tuple does.

        Raises:
            InputError: no vehicle has this id.
        """
        if not isinstance(key, str):
            return super().__getitem__(key)
        for vehicle in self:
            if vehicle.id == key:
                return vehicle
        ids = [vehicle.id for vehicle in self]
        raise InputError(f"no vehicle {key}; there are {', '.join(ids)}{did_you_mean(key, ids)}")
