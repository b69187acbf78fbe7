# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The layout of the vector z of standard normal numbers from which a candidate is computed.

Its parts::

    z = (shared clock, vehicle 0, vehicle 1, …, trimming)
    vehicle = (lateral, speed, clock (shift, pace, waits, gaps), place, end speeds, size,
               strength)

All code reads these numbers through named slices.
"""

from collections.abc import Iterable
from itertools import accumulate, pairwise
from typing import NamedTuple


def consecutive(counts: Iterable[int]) -> list[slice]:
    """Return slices of these lengths, one behind the other from 0 on."""
    return [slice(begin, end) for begin, end in pairwise(accumulate(counts, initial=0))]


class VehicleNumbers(NamedTuple):
    """The numbers of one vehicle.

    Attributes:
        lateral: deviations across the route.
        speed: deviations along the route.
        clock: of the vehicle's clock: shift, pace, one for each wait, one for the driver's gap in
            each reaction.
        place: in the lane.
        end_speeds: at the start and at the end.
        size: of the vehicle.
        strength: of braking and of acceleration.
    """

    lateral: slice
    speed: slice
    clock: slice
    place: slice
    end_speeds: slice
    size: slice
    strength: slice

    @classmethod
    def of(
        cls, lateral: int, speed: int, clock: int | None, strength: int = 0
    ) -> "VehicleNumbers":
        """Lay out the numbers of a vehicle.

        Args:
            lateral: number of deviations across the route.
            speed: number of deviations along it.
            clock: numbers of its clock; None if only the deviations vary.
            strength: 2 if braking and acceleration vary from driver to driver, else 0.
        """
        free = (0, 0, 0, 0, 0) if clock is None else (clock, 1, 2, 1, strength)
        return cls(*consecutive((lateral, speed, *free)))

    @property
    def total(self) -> int:
        """Number of standard normal numbers."""
        return int(max(part.stop for part in self))


class ModelNumbers(NamedTuple):
    """The numbers of a candidate.

    Attributes:
        clock: of the clock that all vehicles share.
        vehicles: of each vehicle, laid out as `VehicleNumbers`.
        trimming: of the scenario's begin and end.
    """

    clock: slice
    vehicles: tuple[slice, ...]
    trimming: slice

    @classmethod
    def of(cls, clock: int, vehicles: Iterable[VehicleNumbers], trimming: int) -> "ModelNumbers":
        """Lay out the numbers of a candidate."""
        parts = consecutive((clock, *(numbers.total for numbers in vehicles), trimming))
        return cls(parts[0], tuple(parts[1:-1]), parts[-1])

    @property
    def total(self) -> int:
        """Number of standard normal numbers."""
        return int(self.trimming.stop)
