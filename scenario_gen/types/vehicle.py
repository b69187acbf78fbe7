# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The identity, footprint and type of a road user."""

from collections.abc import Iterable
from dataclasses import dataclass

from scenario_gen.base.errors import InputError
from scenario_gen.base.road_users import CAR, OTHER, usual_type, VEHICLE_TYPES, VehicleType


@dataclass(frozen=True)
class Vehicle:
    """A road user.

    Attributes:
        id: unique within an encounter or a scenario.
        length, width: of the footprint [m].
        type: a name in `VEHICLE_TYPES`; the default follows from the length: a car or a truck.

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
    def half(self) -> tuple[float, float]:
        """Half its length and half its width [m]."""
        return 0.5 * self.length, 0.5 * self.width


def most_exposed(vehicles: Iterable[Vehicle]) -> str:
    """Return the type of the most exposed road user: the type with the smallest usual width."""
    types = {vehicle.type for vehicle in vehicles}
    return min(types, key=lambda name: (VEHICLE_TYPES[name].width, name))
