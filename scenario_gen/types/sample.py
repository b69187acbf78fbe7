# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Where the vehicles of a live stream are at one instant."""

from dataclasses import dataclass

from scenario_gen.numerics import Floats
from scenario_gen.types.vehicle import Vehicle


@dataclass(frozen=True, eq=False)
class Sample:
    """The vehicles that are there at one tick of the common clock.

    Attributes:
        stamp_ns: the tick, a whole multiple of the period.
        vehicles: N >= 2, in the natural order of their ids.
        position: (N, 2) metres east and north of the streams' origin.
        speed: (N,) m/s.
    """

    stamp_ns: int
    vehicles: tuple[Vehicle, ...]
    position: Floats
    speed: Floats
