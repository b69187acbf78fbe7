# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Traffic lights in exports: the schedule of each light of a road, and its states at steps."""

from collections.abc import Sequence
from itertools import groupby

from scenario_gen.numerics import Floats
from scenario_gen.types import (
    LaneNetwork,
    Scenario,
    SignalSchedule,
    SignalState,
    TrafficLight,
    TrafficRule,
)


def light_of(
    rule: TrafficRule,
    network: LaneNetwork,
    lights: Sequence[TrafficLight],
    lanes: Sequence[int] = (),
) -> TrafficLight | None:
    """Return what the light of a rule shows in a scenario; None if no state is known.

    Some of the lanes of a rule may have a light of their own.
    """
    ids = {network.lanes[k].id for k in lanes or rule.lanes}
    for light in lights:
        is_known = any(state is not SignalState.UNKNOWN for state in light.schedule.states)
        if light.id == rule.id and ids & set(light.lanes) and is_known:
            return light
    return None


def phases_within(
    schedule: SignalSchedule, duration: float
) -> list[tuple[float, float, SignalState]]:
    """Return begin, end [s] and state of the phases of a scenario with a duration [s]."""
    inner = [start for start in schedule.between(0.0, duration).starts if 0.0 < start < duration]
    if 0.0 < schedule.end < duration and not schedule.repeats:
        inner.append(schedule.end)
    starts = [0.0, *inner]
    return [
        (start, end, schedule.at(start))
        for start, end in zip(starts, [*inner, duration], strict=True)
    ]


def states_at(schedule: SignalSchedule, times: Floats) -> list[SignalState]:
    """Return the states at times (T,) [s]."""
    return [schedule.at(time) for time in times.tolist()]


def runs_of_states(schedule: SignalSchedule, scenario: Scenario) -> list[tuple[SignalState, int]]:
    """Return the states at the instants of a scenario, each with its number of instants."""
    states = states_at(schedule, scenario.time)
    return [(state, len(list(equal))) for state, equal in groupby(states)]
