# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Traffic lights of SUMO: the links of a net, and their states over time.

| quantity | element: attribute | unit |
|---|---|---|
| stop line | lane: shape, width; its end | m |
| light | connection: tl, linkIndex, from, fromLane, dir | |
| cycle, of static programs | tlLogic: offset; phase: duration, state | s |
| recorded states | tlsState: time, id, state (SaveTLSStates) | s |

The states of `tlsState` come before those of the cycle. A state has a letter for each link. Links
from one lane share a stop line; those that turn otherwise have a light of their own if its states
differ. Of several links that turn alike the most permissive state counts.

Source: SUMO's user documentation, Traffic Lights, Networks, Output/Traffic Lights.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.base.xml_reader import Element
from scenario_gen.logs.signals import (
    line_across,
    most_permissive,
    naming,
    RawSignal,
    sampled_schedule,
    state_of,
)
from scenario_gen.numerics import Floats
from scenario_gen.types import SignalSchedule, SignalState

_TURNS = {"l": "left", "t": "left", "r": "right"}  # L and R: less than a turn


def read_lights(
    net: Element | None, states: Element | None, notes: list[str]
) -> Sequence[RawSignal]:
    """Return the lights of the lanes of a net; notes on others are appended.

    Args:
        net: the root of the net; without it no stop line is known.
        states: the root of the recorded states.
        notes: of the log.

    Raises:
        InputError: an attribute is missing, or a state is not known; names the line.
    """
    if net is None:
        if states is not None:
            notes.append(
                "the states of traffic lights are left out: give the net (.net.xml), too, which "
                "has their stop lines"
            )
        return ()
    lanes = {lane.attribute("id"): lane for lane in net.findall("edge/lane")}
    schedule_of = _schedules(net, states)
    links: dict[tuple[str, str], dict[str, list[int]]] = {}
    for link in net.findall("connection[@tl]"):
        lane = f"{link.attribute('from')}_{link.attribute('fromLane')}"
        turn = _TURNS.get(link.get("dir", "s"), "straight")
        by_turn = links.setdefault((link.attribute("tl"), lane), {})
        by_turn.setdefault(turn, []).append(int(link.number("linkIndex")))

    signals: list[RawSignal] = []
    for (name, lane), by_turn in sorted(links.items()):
        if name in schedule_of and lane in lanes:
            turns = _turns_by_schedule(schedule_of[name], by_turn)
            signals += _signals_of(f"{name}/{lane}", lanes[lane], turns)
    unknown = sorted({name for name, _ in links} - set(schedule_of))
    if unknown:
        notes.append(
            f"traffic lights whose states are not known are left out: {', '.join(unknown)}"
            '; record them with <timedEvent type="SaveTLSStates">'
        )
    return signals


def _turns_by_schedule(
    schedule_of: Callable[[Sequence[int]], SignalSchedule], by_turn: Mapping[str, Sequence[int]]
) -> dict[SignalSchedule, tuple[str, ...]]:
    """Return the turns that share a schedule, of the links of a lane by turn."""
    turns: dict[SignalSchedule, tuple[str, ...]] = {}
    for turn, indices in sorted(by_turn.items()):
        schedule = schedule_of(indices)
        turns[schedule] = (*turns.get(schedule, ()), turn)
    return turns


def _signals_of(
    name: str, lane: Element, turns: Mapping[SignalSchedule, tuple[str, ...]]
) -> Iterator[RawSignal]:
    """Yield the lights of a lane, one for each schedule."""
    for schedule, chosen in turns.items():
        only = chosen if len(turns) > 1 else ()
        light = " ".join([name, *only])
        lanes = (lane.attribute("id"),)
        yield RawSignal(light, schedule, lane.file, _line(lane), lanes, turns=only)


def _schedules(
    net: Element, states: Element | None
) -> dict[str, Callable[[Sequence[int]], SignalSchedule]]:
    """Return by light the function that gives the schedule of some of its links."""
    schedules: dict[str, Callable[[Sequence[int]], SignalSchedule]] = {
        logic.attribute("id"): partial(_cycle_of, logic)
        for logic in net.findall("tlLogic")
        if logic.get("type", "static") == "static"
    }
    for name, samples in _recorded(states).items():
        schedules[name] = partial(_schedule_of, samples)
    return schedules


def _recorded(states: Element | None) -> Mapping[str, list[Element]]:
    """Return the recorded states by light."""
    recorded: dict[str, list[Element]] = {}
    for state in () if states is None else states.findall("tlsState"):
        recorded.setdefault(state.attribute("id"), []).append(state)
    return recorded


def _schedule_of(samples: Sequence[Element], indices: Sequence[int]) -> SignalSchedule:
    times = [sample.number("time") for sample in samples]
    place = f"{samples[0].file}: traffic light {samples[0].attribute('id')}"
    return sampled_schedule(times, [_state(sample, indices) for sample in samples], place)


def _cycle_of(logic: Element, indices: Sequence[int]) -> SignalSchedule:
    phases = logic.findall("phase")
    durations = [phase.number("duration") for phase in phases]
    states = [_state(phase, indices) for phase in phases]
    with naming(f"{logic.place}: traffic light {logic.attribute('id')}"):
        return SignalSchedule.cycle(durations, states, logic.number("offset", 0.0))


def _state(element: Element, indices: Sequence[int]) -> SignalState:
    """Return the most permissive state of some links.

    Raises:
        InputError: the state has no letter for a link, or an unknown one.
    """
    letters = element.attribute("state")
    if not 0 <= min(indices) <= max(indices) < len(letters):
        raise InputError(
            f"{element.place}: its state has {len(letters)} letters, and the net has links "
            f"with indices {min(indices)} to {max(indices)}; give the net of this simulation"
        )
    # `s` is red with a green arrow: who turns right may go after a stop.
    states = {
        SignalState.OFF if letters[k] == "s" else state_of(letters[k], element.place)
        for k in indices
    }
    return most_permissive(states)


def _line(lane: Element) -> Floats:
    """Return the stop line (2, 2) [m] at the end of a lane.

    Raises:
        InputError: its shape is damaged.
    """
    words = lane.attribute("shape").split()
    try:
        points = np.array([word.split(",")[:2] for word in words[-2:]], dtype=float)
    except ValueError:
        points = np.zeros((0, 2))
    if points.shape != (2, 2) or not np.isfinite(points).all():
        raise InputError(f"{lane.place}: its shape is not a list of points x,y")
    step = points[1] - points[0]
    width = lane.number("width", 3.2)  # SUMO's default
    return line_across(points[1], float(np.arctan2(step[1], step[0])), width)
