# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Signs, lights and rights of way of a map, as rules for the traffic of its lanes.

Source: the numbers of signs in CommonRoad's traffic sign ids, in Lanelet2's `LinestringTagging`, and in ASAM OpenDRIVE 1.8,
"Signals", with the sign catalogues of Germany, the USA and Spain.
"""

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
    TrafficRule,
)

_SIGNS = {
    "de": {
        "206": RuleKind.STOP,
        "205": RuleKind.GIVE_WAY,
        "301": RuleKind.PRIORITY,
        "306": RuleKind.PRIORITY,
    },
    "us": {"r1-1": RuleKind.STOP, "r1-2": RuleKind.GIVE_WAY},
    "es": {"r2": RuleKind.STOP, "r1": RuleKind.GIVE_WAY, "r3": RuleKind.PRIORITY},
}
_NAMED = {
    "stop": RuleKind.STOP,
    "stop_sign": RuleKind.STOP,
    "yield": RuleKind.GIVE_WAY,
    "yield_sign": RuleKind.GIVE_WAY,
    "give_way": RuleKind.GIVE_WAY,
}
_COUNTRIES = {
    "deu": "de",
    "germany": "de",
    "usa": "us",
    "esp": "es",
    "spain": "es",
}  # other names of those with a list
_SPEED_LIMITS = ("274", "274.1", "r2-1", "maxspeed")
_SUBJECT = (RuleKind.STOP, RuleKind.GIVE_WAY)
_LEADS = 6  # lanes between a sign and its junction at most


@dataclass(frozen=True, eq=False)
class DraftRule:
    """A rule as a reader finds it; fields as of `TrafficRule`, with the names of lanes, also of those that are not for cars.

    Attributes:
        line: (K, 2) metres.
    """

    id: str
    kind: RuleKind
    lanes: tuple[str, ...]
    over: tuple[str, ...] = ()
    line: Floats = field(default_factory=lambda: np.zeros((0, 2)))


def kind_of_sign(name: str, subtype: str = "", country: str = "") -> RuleKind | None:
    """Return what a sign means; None: another sign.

    Args:
        name: its number or name, with or without its country (206, de206, usR1-1).
        subtype: what the number goes on with (R1 and 1: R1-1), "" or -1 if it does not.
        country: whose number it is, in two or three letters; a country without a list of signs may have those of any.
    """
    numbers, own = _numbers(name, subtype, country)
    tables = [_SIGNS[own]] if own in _SIGNS else list(_SIGNS.values())
    return next(
        (table[number] for number in numbers for table in (*tables, _NAMED) if number in table),
        None,
    )


def is_speed_limit(name: str, subtype: str = "", country: str = "") -> bool:
    """Return whether a sign sets a speed limit; arguments as of `kind_of_sign`."""
    return any(number in _SPEED_LIMITS for number in _numbers(name, subtype, country)[0])


def _numbers(name: str, subtype: str, country: str) -> tuple[list[str], str]:
    """The numbers, in lower case, by which a sign may be listed, and the country's two letters."""
    text, own = name.strip().lower(), country.strip().lower()
    prefix = re.match(r"[a-z]{2}(?=[r0-9])", text)
    if prefix:
        text, own = text[2:], prefix[0]
    if subtype.strip().lower() in ("", "-1", "none"):
        return [text], _COUNTRIES.get(own, own)
    whole = f"{text}-{subtype.strip().lower()}"
    return [whole, text] if text.isdigit() else [whole], _COUNTRIES.get(own, own)


def with_rules(network: LaneNetwork, drafts: Sequence[DraftRule]) -> LaneNetwork:
    """Return a network with its rules, whose lanes are found by name.

    A stop sign without a line gets the end of each lane as its line. A stop or give-way sign whose map does not say who goes
    first gets the lanes that lead into the same junction and have no such sign.
    """
    index = {lane.id: k for k, lane in enumerate(network.lanes)}
    rules: list[TrafficRule] = []
    for draft in drafts:
        lanes, over = (
            tuple(dict.fromkeys(index[name] for name in names if name in index))
            for names in (draft.lanes, draft.over)
        )
        if not lanes:
            continue
        if draft.kind == RuleKind.STOP and not len(draft.line):
            ends = (
                (k, np.stack((network.lanes[k].left[-1], network.lanes[k].right[-1])))
                for k in lanes
            )
            rules += (TrafficRule(draft.id, draft.kind, (k,), over, line) for k, line in ends)
        else:
            rules.append(TrafficRule(draft.id, draft.kind, lanes, over, draft.line))
    known = tuple(_over_others(network, rules))
    notes = network.notes
    if known:
        counts = {kind: len({rule.id for rule in known if rule.kind == kind}) for kind in RuleKind}
        words = ", ".join(
            f"{count} {kind.replace('_', ' ')}" for kind, count in counts.items() if count
        )
        notes += (Note.of(NoteKind.TRAFFIC_RULES, rules=words),)
        if counts[RuleKind.TRAFFIC_LIGHT]:
            notes += (Note.of(NoteKind.LIGHTS_OFF),)
    return replace(network, rules=known, notes=notes)


def _over_others(network: LaneNetwork, rules: Sequence[TrafficRule]) -> Iterator[TrafficRule]:
    """Yield the rules, those without `over` with the lanes into the same junction that no stop or give-way sign concerns."""
    subject = {
        lane
        for rule in rules
        if rule.kind in _SUBJECT
        for k in rule.lanes
        for lane in _mouths(network, k)
    }
    into: dict[str, list[int]] = {}
    for k, lane in enumerate(network.lanes):
        for name in dict.fromkeys(network.lanes[after].junction for after in lane.successors):
            if name and name != lane.junction:
                into.setdefault(name, []).append(k)
    for rule in rules:
        if rule.kind not in _SUBJECT or rule.over:
            yield rule
            continue
        mouths = [mouth for k in rule.lanes for mouth in _mouths(network, k)]
        names = dict.fromkeys(
            network.lanes[after].junction
            for mouth in mouths
            for after in network.lanes[mouth].successors
        )
        over = dict.fromkeys(k for name in names for k in into.get(name, ()) if k not in subject)
        yield replace(rule, over=tuple(over))


def _mouths(network: LaneNetwork, first: int) -> list[int]:
    """Return the lanes by which traffic of a lane comes into the next junction."""
    mouths: list[int] = []
    level = [first]
    for _ in range(_LEADS):
        mouths += [
            k
            for k in level
            if any(network.lanes[after].junction for after in network.lanes[k].successors)
        ]
        level = [
            after
            for k in level
            if k not in mouths
            for after in network.lanes[k].successors
            if not network.lanes[after].junction
        ]
    return list(dict.fromkeys(mouths))


def rules_of_pieces(
    rules: Sequence[TrafficRule], pieces: Mapping[int, Sequence[int]]
) -> tuple[TrafficRule, ...]:
    """Return the rules of a part of a network.

    Args:
        rules: of the whole.
        pieces: of each lane of which something is left, the lanes of the part.
    """

    def kept(lanes: Sequence[int]) -> tuple[int, ...]:
        return tuple(piece for k in lanes for piece in pieces.get(k, ()))

    parts = (replace(rule, lanes=kept(rule.lanes), over=kept(rule.over)) for rule in rules)
    return tuple(rule for rule in parts if rule.lanes)
