# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The traffic lights of a road on the clocks of scenarios."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from scenario_gen.method.sampling.time_warp import Clock, SAMPLE_PERIOD_S
from scenario_gen.numerics import Floats
from scenario_gen.situation.tracks import STANDSTILL_SPEED_MPS
from scenario_gen.types import fronts, Scenario, SignalState, TrafficLight

_MAX_SHIFT_S = 1.5  # of the lights of one scenario
_HELD_S = 2.0  # before a vehicle crosses, since a state was known
_OVERRUN_M = 3.0  # beyond the line, where a vehicle still waits for its light


@dataclass(frozen=True)
class Departure:
    """The first vehicle in line departs after green.

    Attributes:
        who: index of the vehicle.
        light: index of the light.
        lag: seconds from green to its departure in the recording.
    """

    who: int
    light: int
    lag: float

    def lateness(
        self, lights: Sequence[TrafficLight], scenario: Scenario, offset: float = 0.0
    ) -> float:
        """Return how much later [s] it departs in a scenario, if lights are later by `offset`."""
        light, n = lights[self.light], self.who
        stands = scenario.is_present[n] & (scenario.speed[n] <= STANDSTILL_SPEED_MPS)
        stands &= light.before(fronts(scenario, n)) > -_OVERRUN_M
        if not stands.any():
            return 0.0
        departs = float(scenario.time[stands][-1]) - self.lag - offset
        phases = light.schedule.between(departs - 100.0, departs + 100.0)
        delays = [
            departs - start
            for start, state in zip(phases.starts, phases.states, strict=True)
            if state is SignalState.GREEN
        ]
        return min(delays, key=abs, default=0.0)


@dataclass(frozen=True, eq=False)
class PlacedLights:
    """The lights of the road on the template's clock.

    Attributes:
        lights: in the road's frame. Recorded states move with the clock that all vehicles share;
            a cycle moves as a whole.
        anchor: template time [s] at which a cycle and the vehicles fit together.
        departures: at green, of which each scenario keeps the lag.
    """

    lights: tuple[TrafficLight, ...]
    anchor: float = 0.0
    departures: tuple[Departure, ...] = ()

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

    def with_departures(self, scenario: Scenario) -> Scenario:
        """Return a scenario with all of its lights so late that vehicles depart as recorded.

        A state that was recorded until a vehicle crossed is known until it crosses here.
        """
        lights = scenario.facts.lights
        delays = [departure.lateness(lights, scenario) for departure in self.departures]
        delays = [each for each in delays if abs(each) <= _MAX_SHIFT_S]
        by = sum(delays) / max(len(delays), 1)
        moved = [replace(light, schedule=light.schedule.moved(by)) for light in lights]
        known = tuple(_known_until_crossed(light, scenario) for light in moved)
        return scenario.with_facts(replace(scenario.facts, lights=known))


def _known_until_crossed(light: TrafficLight, scenario: Scenario) -> TrafficLight:
    """Return a light whose last recorded state lasts until the vehicles behind it have crossed."""
    schedule = light.schedule
    if schedule.repeats:
        return light
    crossings = [light.crossing(scenario, n) for n in range(len(scenario.vehicles))]
    held = [time for time in crossings if 0.0 <= time - schedule.end < _HELD_S]
    end = max(held, default=schedule.end - SAMPLE_PERIOD_S) + SAMPLE_PERIOD_S
    return replace(light, schedule=replace(schedule, end=end))
