# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The traffic lights of a road on the clocks of scenarios."""

from dataclasses import dataclass

import numpy as np

from scenario_gen.method.sampling.time_warp import Clock
from scenario_gen.numerics import Floats
from scenario_gen.types import TrafficLight


@dataclass(frozen=True, eq=False)
class PlacedLights:
    """The lights of the road on the template's clock.

    Attributes:
        lights: in the road's frame. Recorded states move with the clock that all vehicles share;
            a cycle moves as a whole.
        anchor: template time [s] at which a cycle and the vehicles fit together.
    """

    lights: tuple[TrafficLight, ...]
    anchor: float = 0.0

    def on_clock(self, clock: Clock, s: int, begin: float) -> tuple[TrafficLight, ...]:
        """Return the lights of a scenario that begins at `begin` [s] of the clock's sample s."""
        grid, times = clock.grid, np.atleast_2d(clock.time)[s]

        def retimed(at: Floats) -> Floats:
            beyond = at - np.clip(at, grid[0], grid[-1])
            return np.asarray(np.interp(at, grid, times) + beyond - begin)

        by = float(retimed(np.array([self.anchor]))[0]) - self.anchor
        return tuple(
            light.retimed((lambda at: at + by) if light.schedule.repeats else retimed)
            for light in self.lights
        )
