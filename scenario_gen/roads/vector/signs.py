# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Signs, lights and rights of way of a map as rules for the traffic of its lanes.

Source: the numbers of signs in CommonRoad's traffic sign ids, in Lanelet2's `LinestringTagging`
and in ASAM OpenDRIVE 1.8, "Signals", with the sign catalogues of Germany, the USA and Spain.
"""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
import re

import numpy as np

from scenario_gen.numerics import Floats
from scenario_gen.types import (
    LaneNetwork,
    Note,
    NoteKind,
    RuleKind,
    SignalSchedule,
    TrafficRule,
)

YIELDING_KINDS = (RuleKind.STOP, RuleKind.GIVE_WAY)
_SIGNS_BY_COUNTRY = {
    "de": {
        "206": RuleKind.STOP,
        "205": RuleKind.GIVE_WAY,
        "301": RuleKind.PRIORITY,
        "306": RuleKind.PRIORITY,
    },
    "us": {"r1-1": RuleKind.STOP, "r1-2": RuleKind.GIVE_WAY},
    "es": {"r2": RuleKind.STOP, "r1": RuleKind.GIVE_WAY, "r3": RuleKind.PRIORITY},
}
_SIGNS_BY_NAME = {
    "stop": RuleKind.STOP,
    "stop_sign": RuleKind.STOP,
    "yield": RuleKind.GIVE_WAY,
    "yield_sign": RuleKind.GIVE_WAY,
    "give_way": RuleKind.GIVE_WAY,
}
_COUNTRY_CODES = {"deu": "de", "germany": "de", "usa": "us", "esp": "es", "spain": "es"}
_SPEED_LIMIT_SIGNS = ("274", "274.1", "r2-1", "maxspeed")


@dataclass(frozen=True, eq=False)
class DraftRule:
    """A rule as a reader returns it, with the names of lanes; see `TrafficRule`.

    Attributes:
        id: its name.
        kind: what its traffic has to do.
        lanes: whose traffic it applies to, including lanes that are closed to cars.
        over: whose traffic goes first.
        line: (K, 2) [m] the stop line.
        schedule: what a light shows, if that is known.
        turns: the movements that a light is for; (): all.
    """

    id: str
    kind: RuleKind
    lanes: tuple[str, ...]
    over: tuple[str, ...] = ()
    line: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    schedule: SignalSchedule | None = None
    turns: tuple[str, ...] = ()


def kind_of_sign(name: str, subtype: str = "", country: str = "") -> RuleKind | None:
    """Return the meaning of a sign; None if it is not known.

    Args:
        name: its number or name, with or without its country (206, de206, usR1-1).
        subtype: the second part of the number (R1 and 1: R1-1); "" or -1 if there is none.
        country: of the number, in two or three letters; a country without a list of signs may
            have those of any.
    """
    numbers, code = _numbers(name, subtype, country)
    tables = list(_SIGNS_BY_COUNTRY.values())
    if code in _SIGNS_BY_COUNTRY:
        tables = [_SIGNS_BY_COUNTRY[code]]
    for number in numbers:
        for table in (*tables, _SIGNS_BY_NAME):
            if number in table:
                return table[number]
    return None


def is_speed_limit(name: str, subtype: str = "", country: str = "") -> bool:
    """Return whether a sign sets a speed limit; arguments as in `kind_of_sign`."""
    numbers, _ = _numbers(name, subtype, country)
    return any(number in _SPEED_LIMIT_SIGNS for number in numbers)


def _numbers(name: str, subtype: str, country: str) -> tuple[list[str], str]:
    """Return the numbers, in lower case, by which a sign may be listed, and the country's code."""
    text, code = name.strip().lower(), country.strip().lower()
    prefix = re.match(r"[a-z]{2}(?=[r0-9])", text)
    if prefix:
        text, code = text[2:], prefix[0]
    code = _COUNTRY_CODES.get(code, code)
    subtype = subtype.strip().lower()
    if subtype in ("", "-1", "none"):
        return [text], code
    numbers = [f"{text}-{subtype}"]
    if text.isdigit():
        numbers.append(text)
    return numbers, code


def with_rules(network: LaneNetwork, drafts: Sequence[DraftRule]) -> LaneNetwork:
    """Return a network with its rules, whose lanes are found by name.

    A stop sign without a line gets the end of each lane as its line. If a map does not tell who
    goes before a stop or give-way sign, traffic from the lanes that lead into the same junction
    and have no such sign does.
    """
    index = {lane.id: k for k, lane in enumerate(network.lanes)}
    rules = [rule for draft in drafts for rule in _rules_of(draft, index, network)]
    rules = _with_going_first(network, rules)
    if not rules:
        return network
    counts = {kind: len({rule.id for rule in rules if rule.kind == kind}) for kind in RuleKind}
    listed = [f"{count} {kind.replace('_', ' ')}" for kind, count in counts.items() if count]
    notes = [*network.notes, Note.of(NoteKind.TRAFFIC_RULES, rules=", ".join(listed))]
    if any(rule.kind is RuleKind.TRAFFIC_LIGHT and rule.schedule is None for rule in rules):
        notes.append(Note.of(NoteKind.LIGHTS_OFF))
    return replace(network, rules=tuple(rules), notes=tuple(notes))


def _rules_of(
    draft: DraftRule, index: Mapping[str, int], network: LaneNetwork
) -> Iterator[TrafficRule]:
    """Yield the rule of a draft, or a rule for each of its lanes if it lacks a stop line."""
    lanes = tuple(dict.fromkeys(index[name] for name in draft.lanes if name in index))
    over = tuple(dict.fromkeys(index[name] for name in draft.over if name in index))
    if draft.kind == RuleKind.STOP and not len(draft.line):
        for k in lanes:
            line = np.stack((network.lanes[k].left[-1], network.lanes[k].right[-1]))
            yield TrafficRule(draft.id, draft.kind, (k,), over, line)
    elif lanes:
        yield TrafficRule(
            draft.id, draft.kind, lanes, over, draft.line, draft.schedule, draft.turns
        )


def _with_going_first(network: LaneNetwork, rules: Sequence[TrafficRule]) -> list[TrafficRule]:
    """Return the rules; those without `over` get the unsigned lanes into the same junction."""
    yielding = [rule for rule in rules if rule.kind in YIELDING_KINDS]
    signed = {k for rule in yielding for k in _all_mouths(network, rule.lanes)}
    into = _lanes_into_junctions(network)
    completed = []
    for rule in rules:
        if rule.kind not in YIELDING_KINDS or rule.over:
            completed.append(rule)
            continue
        junctions = _junctions_after(network, _all_mouths(network, rule.lanes))
        over = dict.fromkeys(k for name in junctions for k in into[name] if k not in signed)
        completed.append(replace(rule, over=tuple(over)))
    return completed


def _lanes_into_junctions(network: LaneNetwork) -> dict[str, list[int]]:
    """Return the lanes that lead into each junction from outside of it."""
    into: dict[str, list[int]] = defaultdict(list)
    for k, lane in enumerate(network.lanes):
        for name in _junctions_after(network, [k]):
            if name != lane.junction:
                into[name].append(k)
    return into


def _all_mouths(network: LaneNetwork, lanes: Sequence[int]) -> list[int]:
    """Return the lanes by which traffic from some lanes enters the next junctions."""
    return [mouth for k in lanes for mouth in _mouths(network, k)]


def _junctions_after(network: LaneNetwork, lanes: Sequence[int]) -> list[str]:
    """Return the names of the junctions that the successors of lanes belong to."""
    following = [k for lane in lanes for k in network.lanes[lane].successors]
    names = [network.lanes[k].junction for k in following]
    return list(dict.fromkeys(name for name in names if name))


def _mouths(network: LaneNetwork, first: int) -> list[int]:
    """Return the lanes by which traffic from a lane enters the next junction."""
    mouths: list[int] = []
    level = [first]
    for _ in range(6):  # lanes from a sign to its junction
        mouths += [k for k in level if _junctions_after(network, [k])]
        level = [
            following
            for k in level
            if k not in mouths
            for following in network.lanes[k].successors
        ]
    return list(dict.fromkeys(mouths))


def rules_of_pieces(
    rules: Sequence[TrafficRule], pieces: Mapping[int, Sequence[int]]
) -> tuple[TrafficRule, ...]:
    """Return the rules for a part of a network.

    Args:
        rules: of the whole.
        pieces: the lanes of the part by the lane of the whole that they are pieces of.
    """

    def pieces_of(lanes: Sequence[int]) -> tuple[int, ...]:
        return tuple(piece for k in lanes for piece in pieces.get(k, ()))

    cut = [replace(rule, lanes=pieces_of(rule.lanes), over=pieces_of(rule.over)) for rule in rules]
    return tuple(rule for rule in cut if rule.lanes)
