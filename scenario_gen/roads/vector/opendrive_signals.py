# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The traffic rules of an OpenDRIVE map: signals, stop lines and priorities at junctions.

Source: ASAM OpenDRIVE 1.8, chapters "Signals" and "Junctions".
"""

from collections.abc import Iterator
import math
import re

import numpy as np

from scenario_gen.base.xml_reader import Element
from scenario_gen.numerics import Floats
from scenario_gen.roads.vector.drafts import Faults
from scenario_gen.roads.vector.sections import OpenDriveRoad, SectionLane
from scenario_gen.roads.vector.signs import DraftRule, is_speed_limit, kind_of_sign
from scenario_gen.types import RuleKind

# Types in the catalogue of OpenDRIVE.
_STOP_LINE_TYPE = "294"
_PEDESTRIAN_TYPES = ("1000002", "1000003")  # light, crossing
_LIGHT_TYPES = ("1000001", "1000009", "1000010", "1000011", "1000012")  # for vehicles
_MAX_STOP_LINE_DISTANCE_M = 15.0  # from its sign


def signal_rules(roads: dict[str, OpenDriveRoad], faults: Faults) -> Iterator[DraftRule]:
    """Yield the rules of signals where they are placed and where roads refer to them."""
    kinds: dict[str, RuleKind] = {}
    for signal in _signals(roads):
        kind = _kind_of_signal(signal)
        if kind is not None:
            kinds[signal.get("id", "?")] = kind
    for road in roads.values():
        signals = road.element.findall("signals/signal")
        signals += road.element.findall("signals/signalReference")
        lines = [*signals, *road.element.findall("objects/object")]
        lines = [line for line in lines if _is_stop_line(line)]
        for signal in [signal for signal in signals if signal.get("id", "?") in kinds]:
            name = signal.get("id", "?")
            with faults.leaving_out("signal", name):
                yield from _rules_of_signal(road, signal, kinds[name], lines)


def _rules_of_signal(
    road: OpenDriveRoad, signal: Element, kind: RuleKind, lines: list[Element]
) -> Iterator[DraftRule]:
    """Yield the rule of a signal for each lane that it applies to."""
    s = _station_of_stop(signal, lines)
    for lane in _lanes_at(road, signal, s):
        yield DraftRule(signal.get("id", "?"), kind, (lane.name,), line=_cross_section(lane, s))


def _signals(roads: dict[str, OpenDriveRoad]) -> list[Element]:
    """Return the signals of all roads."""
    return [each for road in roads.values() for each in road.element.findall("signals/signal")]


def other_signals(roads: dict[str, OpenDriveRoad]) -> int:
    """Return how many signals have a meaning that is not read."""
    return sum(not _is_known(signal) for signal in _signals(roads))


def priorities(root: Element, roads: dict[str, OpenDriveRoad]) -> Iterator[DraftRule]:
    """Yield the priorities at junctions: traffic of the low road gives way to the high road."""
    for priority in root.findall("junction/priority"):
        name = f"junction {priority.getparent().get('id', '?')}"
        high, low = (roads.get(priority.get(level, "")) for level in ("high", "low"))
        if high is not None and low is not None:
            giving_way = tuple(lane.name for lane in low.lanes)
            going_first = tuple(lane.name for lane in high.lanes)
            yield DraftRule(name, RuleKind.GIVE_WAY, giving_way, going_first)


def _kind_of_signal(signal: Element) -> RuleKind | None:
    if signal.get("dynamic") == "yes":
        return RuleKind.TRAFFIC_LIGHT if signal.get("type") in _LIGHT_TYPES else None
    return kind_of_sign(*_sign(signal))


def _sign(signal: Element) -> tuple[str, str, str]:
    """Return the number of a signal's sign, its subtype, and the country of the number."""
    return signal.get("type", ""), signal.get("subtype", ""), signal.get("country", "")


def _is_stop_line(element: Element) -> bool:
    """Return whether a signal or an object is a stop line; some tools give it a name, no type."""
    name = re.sub("[^a-z]", "", element.get("name", "").lower())
    return element.get("type") == _STOP_LINE_TYPE or name.startswith("stopline")


def _is_known(signal: Element) -> bool:
    """Return whether the meaning of a signal is known, whether or not it is a rule."""
    return (
        signal.get("type") in _PEDESTRIAN_TYPES
        or _is_stop_line(signal)
        or is_speed_limit(*_sign(signal))
        or _kind_of_signal(signal) is not None
    )


def _share_direction(a: Element, b: Element) -> bool:
    """Return whether two signals are for traffic in the same direction."""
    directions = {signal.get("orientation", "none") for signal in (a, b)}
    return "none" in directions or len(directions) == 1


def _station_of_stop(signal: Element, lines: list[Element]) -> float:
    """Return the arc length [m] of the stop line near a sign, or that of the sign itself."""
    s = signal.number("s")
    stations = [line.number("s") for line in lines if _share_direction(signal, line)]
    nearest = min(stations, key=lambda station: abs(station - s), default=math.inf)
    return nearest if abs(nearest - s) <= _MAX_STOP_LINE_DISTANCE_M else s


def _lanes_at(road: OpenDriveRoad, signal: Element, s: float) -> Iterator[SectionLane]:
    """Yield the lanes of the section at s to whose traffic a signal applies."""
    section_at_s: dict[bool, int] = {}  # by side
    ranges = [
        sorted((int(record.number("fromLane")), int(record.number("toLane"))))
        for record in signal.findall("validity")
    ]
    direction = signal.get("orientation", "none")
    for lane in road.lanes:
        _, section, number = lane.key
        if not lane.s[0] - 1e-6 <= s <= lane.s[-1] + 1e-6:
            continue
        if section_at_s.setdefault(number > 0, section) != section:
            continue
        valid = not ranges or any(low <= number <= high for low, high in ranges)
        applies = direction == "none" or lane.forward == (direction == "+")
        if valid and applies and lane.is_car_lane:
            yield lane


def _cross_section(lane: SectionLane, s: float) -> Floats:
    """Return the cross-section (2, 2) [m] of a lane at s."""
    borders = (lane.inner, lane.outer)
    return np.array([[np.interp(s, lane.s, column) for column in border.T] for border in borders])
