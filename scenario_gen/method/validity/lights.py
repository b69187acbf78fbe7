# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The certificate of traffic lights: nobody runs red, and who waits at red waits for it."""

from collections.abc import Collection, Iterator, Sequence
import math

from scenario_gen.situation import faced_light, runs_red, WAIT_SPEED_MPS
from scenario_gen.types import Cause, Scenario, SignalStop, TrafficLight, Violation


def light_violations(
    scenario: Scenario, at_red: Collection[int], stops: Sequence[SignalStop]
) -> Iterator[Violation]:
    """Yield the vehicles that cross a stop line at red, and those that do not wait at red.

    Args:
        scenario: the vehicles, with the lights of the road.
        at_red: vehicles that may run red, as they do in the template.
        stops: of the template, for lights.
    """
    lights = scenario.facts.lights
    if not lights:
        return
    for n, vehicle in enumerate(scenario.vehicles):
        for light in () if vehicle.kind.walks or n in at_red else lights:
            # The light may not be red within 2 ms of the crossing either.
            time = runs_red(scenario, n, light, 0.002)
            if not math.isnan(time):
                message = f"vehicle {vehicle.id}: crosses the stop line of light {light.id} at red"
                yield Violation(Cause.TRAFFIC_RULE, time, (n,), message)
    for stop in stops:
        passed = _light_without_wait(scenario, stop)
        if passed is not None:
            message = (
                f"vehicle {scenario.vehicles[stop.who].id}: does not wait while light {passed.id} "
                "is red, as it does in the recording"
            )
            yield Violation(Cause.STOP_NOT_KEPT, 0.0, (stop.who,), message)


def _light_without_wait(scenario: Scenario, stop: SignalStop) -> TrafficLight | None:
    """Return the light for which a vehicle should wait at red but does not."""
    faced = faced_light(scenario, stop.who, scenario.facts.lights) if stop.stands else None
    if faced is None:
        return None
    light, crosses = faced
    waits = scenario.is_present[stop.who] & (scenario.speed[stop.who] < WAIT_SPEED_MPS)
    times = scenario.time[waits & (scenario.time <= crosses)].tolist()
    return None if any(light.schedule.at(time).stops for time in times) else light
