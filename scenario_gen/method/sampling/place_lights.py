# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Which light of a road shows what: recorded states by the vehicles that face it, or its cycle."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
import math

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.sampling.candidates import CandidateModel
from scenario_gen.method.sampling.lights import Departure, PlacedLights
from scenario_gen.method.sampling.plan import Plan
from scenario_gen.method.sampling.time_warp import Clock
from scenario_gen.method.sampling.vehicle_model import NoiseScale
from scenario_gen.roads import lights_of
from scenario_gen.situation import faced_light
from scenario_gen.types import (
    Encounter,
    ReactionGraph,
    Scenario,
    SignalSchedule,
    SignalState,
    TrafficLight,
)

_MAX_LATENESS_S = 1.0  # of a departure that is like the recorded one
_SAME_LIGHT_M = 20.0  # of two places of a stop line
_SLACK_SHARE = 0.01  # of a second, against one by which a departure is unlike the recorded one


def with_lights(model: CandidateModel, plan: Plan) -> CandidateModel:
    """Return the model with the lights of the road, if their states are known.

    Raises:
        RefusedError: the cycle of a road has no offset at which nobody runs red.
    """
    network, encounter = plan.road.lanes, plan.encounter
    if network is None or not network.rules_kept:
        return model
    lights = _with_recorded_lines(lights_of(network), encounter.lights)
    has_cycle = any(light.schedule.repeats for light in lights)
    if not lights or not (has_cycle or encounter.lights):
        return model
    batch = model.draw(np.zeros((1, model.size)), NoiseScale())
    (nominal,) = batch.scenarios(0, [0], plan.road.frame_id)
    if nominal is None:
        return model
    graph = plan.situation.reactions
    if encounter.lights and not (network.drawn and has_cycle):
        shown = _recorded(lights, nominal, encounter)
        placed = PlacedLights(shown, departures=_departures(shown, nominal, graph))
        return replace(model, lights=placed)
    begin = float(batch.presence.begin[0])
    return replace(model, lights=_with_offset(lights, nominal, model.warp.nominal, begin, graph))


def _with_recorded_lines(
    lights: Sequence[TrafficLight], recorded: Sequence[TrafficLight]
) -> tuple[TrafficLight, ...]:
    """Return lights, those of the recording's own map at the stop lines of the recording."""
    lines = {(light.id, light.lanes): light.line for light in recorded if light.lanes}
    moved = []
    for light in lights:
        line = lines.get((light.id, light.lanes), light.line)
        is_near = np.abs(line - light.line).max() < _SAME_LIGHT_M
        moved.append(replace(light, line=line) if is_near else light)
    return tuple(moved)


def _recorded(
    lights: tuple[TrafficLight, ...], nominal: Scenario, encounter: Encounter
) -> tuple[TrafficLight, ...]:
    """Return the lights with the recorded states of the lights that the vehicles face.

    A light that nobody faces has the states of a recorded light with the same stop line. Where
    the recorded lights of movements differ, so do those of the road.
    """
    shown: dict[int, dict[tuple[str, ...], SignalSchedule]] = {}
    for n in range(len(encounter.vehicles)):
        faced = faced_light(nominal, n, lights)
        recorded = faced_light(encounter, n, encounter.lights)
        if faced is not None and recorded is not None:
            by_turns = shown.setdefault(lights.index(faced[0]), {})
            by_turns.setdefault(recorded[0].turns, recorded[0].schedule)
    for k, light in enumerate(lights):
        for other in encounter.lights:
            if np.abs(other.line - light.line).max() < 1.0:  # m
                shown.setdefault(k, {}).setdefault(other.turns, other.schedule)
    unknown = SignalSchedule((0.0,), (SignalState.UNKNOWN,), encounter.duration)
    return tuple(
        replace(light, schedule=_known_from_start(schedule, encounter), turns=turns)
        for k, light in enumerate(lights)
        for turns, schedule in shown.get(k, {light.turns: unknown}).items()
    )


def _known_from_start(schedule: SignalSchedule, encounter: Encounter) -> SignalSchedule:
    """Return a schedule without a cycle.

    The state at the template's start also holds before: scenarios may begin earlier.
    """
    phases = schedule.between(0.0, encounter.duration)
    first, *others = phases.starts
    return replace(phases, starts=(min(first, -60.0 * (first <= encounter.dt)), *others))


def _with_offset(
    lights: tuple[TrafficLight, ...],
    nominal: Scenario,
    clock: Clock,
    begin: float,
    graph: ReactionGraph,
) -> PlacedLights:
    """Return lights with cycles, later by the offset that suits the encounter best.

    Who stopped at red in the recording departs as late after green as there, who ran red runs
    red, and all others cross as far from red as possible.

    Raises:
        RefusedError: no offset does that for all vehicles.
    """
    cycles = [light for light in lights if light.schedule.repeats]
    crossings = {  # which light each vehicle faces, and when [s] it crosses the line
        n: faced
        for n in range(len(nominal.vehicles))
        if (faced := faced_light(nominal, n, cycles)) is not None and math.isfinite(faced[1])
    }
    if not crossings:
        return PlacedLights(tuple(cycles))
    departures = _departures(cycles, nominal, graph)
    offset = _best_offset(cycles, nominal, crossings, departures, graph)
    first = min(time for _, time in crossings.values()) + begin
    anchor = float(np.interp(first, clock.time, clock.grid))
    by = offset + begin - (first - anchor)
    moved = tuple(light.retimed(lambda at: at + by) for light in cycles)
    return PlacedLights(moved, anchor, departures)


def _best_offset(
    cycles: Sequence[TrafficLight],
    nominal: Scenario,
    crossings: Mapping[int, tuple[TrafficLight, float]],
    departures: Sequence[Departure],
    graph: ReactionGraph,
) -> float:
    """Return the offset [s] of cycles that suits the crossings of vehicles best.

    Raises:
        RefusedError: no offset suits all vehicles.
    """
    period = max(light.schedule.end - light.schedule.starts[0] for light in cycles)
    offsets = np.arange(0.0, period, 0.1).tolist()  # s
    slacks = np.array(
        [
            [light.schedule.slack(time - offset) for light, time in crossings.values()]
            for offset in offsets
        ]
    )
    runners = {who for who, _, slack in graph.crossings if slack == 0.0}
    runs = np.array([n in runners for n in crossings])
    least = np.min(slacks, axis=1, where=~runs, initial=period)
    delays = [
        [abs(each.lateness(cycles, nominal, offset)) for each in departures] for offset in offsets
    ]
    latest = np.max(delays, axis=1, initial=0.0)
    suits = (least > 0.0) & ~(slacks[:, runs] > 0.0).any(axis=1) & (latest < _MAX_LATENESS_S)
    if not suits.any():
        raise RefusedError(
            "traffic lights: at no offset of their cycle all vehicles cross and wait as recorded;"
            " set road.signals=recorded, or road.traffic_rules=ignored"
        )
    best = int(np.argmin(np.where(suits, latest - _SLACK_SHARE * least, np.inf)))
    return float(offsets[best])


def _departures(
    lights: Sequence[TrafficLight], nominal: Scenario, graph: ReactionGraph
) -> tuple[Departure, ...]:
    """Return the departures of the first vehicles in line that stopped at red."""
    stops = [stop for stop in graph.stops if stop.stands and not stop.queue]
    return tuple(
        Departure(stop.who, lights.index(faced[0]), stop.lag)
        for stop in stops
        if math.isfinite(stop.lag) and (faced := faced_light(nominal, stop.who, lights))
    )
