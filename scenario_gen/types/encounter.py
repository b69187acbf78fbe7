# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""An encounter: N vehicles near each other on one clock (paper II-A, eqs 1-2)."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TYPE_CHECKING

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.base.road_users import CAR, OTHER, usual_type, VEHICLE_TYPES, VehicleType
from scenario_gen.numerics import Bools, canonical_heading, Floats, freeze, frozen, Ints
from scenario_gen.types.presence import ALWAYS, always, canonical_presence, held, mask

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame

RECOMBINED = (
    " + "  # between the names of the two encounters that a recombined one has its vehicles of
)


@dataclass(frozen=True)
class Vehicle:
    """A road user's identity, footprint and type; length and width in metres.

    Attributes:
        type: a name in `VEHICLE_TYPES`; by default by its length, a car or a truck.

    Raises:
        InputError: there is no such type.
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
                f"vehicle {self.id} is of type {self.type!r}; known are {', '.join(VEHICLE_TYPES.names())}: "
                "install the package that has it"
            )

    @property
    def kind(self) -> VehicleType:
        """What is known of its type."""
        return VEHICLE_TYPES[self.type]

    @property
    def label(self) -> str:
        """Type and id, as in "bus 7"; whose type is none in particular, or a car, is a vehicle."""
        return f"{'vehicle' if self.type in (CAR, OTHER) else self.type} {self.id}"

    @property
    def half(self) -> tuple[float, float]:
        """Half its length and half its width [m]."""
        return 0.5 * self.length, 0.5 * self.width


def most_exposed(vehicles: Iterable[Vehicle]) -> str:
    """Return the type of the most exposed road user: of the smallest width that is usual of its type."""
    return min(
        (vehicle.type for vehicle in vehicles), key=lambda name: (VEHICLE_TYPES[name].width, name)
    )


@dataclass(frozen=True, eq=False)
class Tracks:
    """N >= 1 vehicles on one clock. No NaN is ever inside.

    Attributes:
        name: where it comes from, for people.
        vehicles: N identities and footprints; positions are those of the footprint's centre.
        start_ns: stamp of the first sample, nanoseconds on the log's clock.
        dt_ns: sampling period in nanoseconds (100_000_000 for 10 Hz).
        position: (N, T, 2) metres in a local east-north frame.
        heading: (N, T) rad, counter-clockwise from east, continuous in time (unwrapped).
        speed: (N, T) m/s, >= 0.
        origin: (latitude, longitude) in degrees of the frame's origin, or None if the log came in metres.
        present: (N, 2) first and last sample at which each vehicle is there; outside of it the arrays hold the nearest value
            inside, which says nothing of where the vehicle is. Default: everybody throughout.
    """

    name: str
    vehicles: tuple[Vehicle, ...]
    start_ns: int
    dt_ns: int
    position: Floats
    heading: Floats
    speed: Floats
    origin: tuple[float, float] | None = None
    present: Ints = field(default_factory=lambda: ALWAYS)

    def __post_init__(self) -> None:
        freeze(self, position=frozen(self.position), speed=frozen(self.speed))
        n, t = self.speed.shape
        if n < 1 or t < 2:
            raise InputError(
                f"{self.name!r} has {n} vehicle(s) and {t} sample(s); at least 1 and 2 are needed"
            )
        if (
            self.position.shape != (n, t, 2)
            or self.heading.shape != (n, t)
            or len(self.vehicles) != n
        ):
            raise InputError(f"encounter {self.name!r}: arrays disagree in shape")
        if not all(np.isfinite(a).all() for a in (self.position, self.heading, self.speed)):
            raise InputError(f"encounter {self.name!r} holds a value that is not finite")
        freeze(self, heading=canonical_heading(self.heading))
        if (self.speed < 0.0).any():
            raise InputError(f"encounter {self.name!r} holds a negative speed")
        ids = [vehicle.id for vehicle in self.vehicles]
        if len(set(ids)) != n:
            raise InputError(
                f"encounter {self.name!r}: vehicle ids are not unique: {', '.join(ids)}"
            )
        freeze(self, present=canonical_presence(self.present, n, t, f"encounter {self.name!r}"))
        if self.present[:, 0].min() > 0 or self.present[:, 1].max() < t - 1:
            raise InputError(
                f"encounter {self.name!r}: nobody is present at its first or at its last sample; cut it to its vehicles"
            )
        for name in ("position", "heading", "speed"):
            freeze(self, **{name: held(getattr(self, name), self.present)})

    @property
    def dt(self) -> float:
        """Sampling period in seconds."""
        return self.dt_ns * 1e-9

    @cached_property
    def time(self) -> Floats:
        """(T,) seconds since the first sample."""
        return frozen(np.arange(self.speed.shape[1]) * self.dt)

    @property
    def duration(self) -> float:
        """Seconds from the first to the last sample."""
        return float(self.time[-1])

    @property
    def all_present(self) -> bool:
        """Whether every vehicle is there throughout."""
        return always(self.present, self.speed.shape[1])

    @cached_property
    def there(self) -> Bools:
        """(N, T) whether each vehicle is there at each sample."""
        return mask(self.present, self.speed.shape[1])

    def to_dataframe(self) -> "DataFrame":
        """Return a table: vehicle (id), time [s], x, y [m], heading [rad], speed [m/s]. `read_log` takes such tables."""
        import pandas as pd

        return pd.DataFrame(columns_of(self))

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw the vehicles' paths, as `scenario_gen.plot` does.

        Raises:
            MissingExtraError: matplotlib is not installed.
        """
        import scenario_gen

        return scenario_gen.plot(self, ax)


@dataclass(frozen=True, eq=False)
class Encounter(Tracks):
    """N >= 2 vehicles on one clock. No NaN is ever inside.

    Its attributes are those of `Tracks`.
    """

    def __repr__(self) -> str:
        return f"Encounter({self.name!r}, {len(self.vehicles)} vehicles, {self.duration:.1f} s)"

    def __post_init__(self) -> None:
        n, t = np.shape(self.speed)
        if n < 2 or t < 2:
            raise InputError(
                f"encounter {self.name!r} has {n} vehicle(s) and {t} sample(s); at least 2 of each are needed"
            )
        super().__post_init__()

    @property
    def parents(self) -> tuple[str, ...]:
        """The names of the two encounters that it is recombined of; none if it was recorded."""
        one, _, other = self.name.partition(RECOMBINED)
        return (one, other) if other else ()


def columns_of(motion: Any) -> dict[str, Any]:
    """Return the columns of a table of tracks or of a scenario: a row for each vehicle and instant at which it is there."""
    n, at = np.nonzero(motion.there)
    ids = np.array([vehicle.id for vehicle in motion.vehicles], dtype=object)
    x, y = motion.position[n, at].T
    values = {"heading": motion.heading[n, at], "speed": motion.speed[n, at]}
    return {"vehicle": ids[n], "time": motion.time[at], "x": x, "y": y, **values}
