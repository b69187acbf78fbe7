# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Facts about a scenario ⇄ the key-values of its entry in `scenarios/info`."""

from collections.abc import Mapping
import json
import re

from scenario_gen.base.errors import guarded, InputError
from scenario_gen.types import (
    Decision,
    Facts,
    Failure,
    FOLLOW,
    join_pieces,
    NamedReaction,
    OrderChange,
    ORDERS,
    PassingOrder,
    split_pieces,
    TrafficLight,
    YIELD,
)

_NUMBERS = {"closest_approach": "closest_approach_m", "pet": "pet_s", "rarity": "rarity"}
_TARGET = "target."
_REACTION = re.compile(r"(\S+) (follows|yields to) (\S+)")
_PASSING_ORDER = re.compile(r"(\S+) before (\S+), (.+)")


def fact_values(facts: Facts) -> dict[str, str]:
    """Return the key-values of facts; unknown facts are left out."""
    numbers = {key: getattr(facts, name) for key, name in _NUMBERS.items()}
    values = {key: f"{number:.3f}" for key, number in numbers.items() if number is not None}
    if facts.weight is not None:
        values["weight"] = repr(facts.weight)
    values |= {f"{_TARGET}{label}": f"{number:.6g}" for label, number in facts.targets.items()}
    if facts.order != "keep":
        values["order"] = facts.order
        values["passing_order"] = join_pieces(facts.passing_order)
    if facts.reactions:
        values["reactions"] = join_pieces(facts.reactions)
    if facts.lost_reactions:
        pairs = [f"{who}>{whom}" for who, whom in facts.lost_reactions]
        values["reactions_lost"] = join_pieces(pairs)
    if facts.decision is not None:
        values["decision"] = json.dumps(facts.decision.document())
    if facts.lights:
        values["lights"] = json.dumps([light.document() for light in facts.lights])
    return values | _failure_values(facts.failure)


def _failure_values(failure: Failure | None) -> dict[str, str]:
    """Return the key-values of a failure; none if there is none."""
    if failure is None:
        return {}
    values = {
        "search.kind": failure.kind,
        "search.deviation": f"{failure.deviation:.4g}",
    }
    if failure.weight is not None:
        values["search.weight"] = repr(failure.weight)
    return values


def decode_facts(values: Mapping[str, str], origin: str) -> Facts:
    """Return the facts among the key-values of an entry; names without a meaning here are skipped.

    Args:
        values: of the entry.
        origin: names the entry in messages.

    Raises:
        InputError: a number or the order is damaged.
    """

    def number(key: str) -> float | None:
        text = values.get(key)
        try:
            return None if text is None else float(text)
        except ValueError:
            raise InputError(f"{origin}: {key} is {text!r}; a number is needed") from None

    targets = {key.removeprefix(_TARGET): number(key) for key in values if key.startswith(_TARGET)}
    order = values.get("order", "keep")
    if order not in ORDERS:
        raise InputError(f"{origin}: order is {order!r}; choose one of {', '.join(ORDERS)}")
    failure = None
    if "search.kind" in values:
        deviation = number("search.deviation") or 0.0
        failure = Failure(values["search.kind"], deviation, number("search.weight"))
    return Facts(
        **{name: number(key) for key, name in _NUMBERS.items()},
        weight=number("weight"),
        targets={label: value for label, value in targets.items() if value is not None},
        order=order,
        passing_order=_passing_orders(values.get("passing_order", "")),
        reactions=_reactions(values.get("reactions", "")),
        lost_reactions=_pairs(values.get("reactions_lost", "")),
        failure=failure,
        decision=decode_decision(values["decision"], origin) if "decision" in values else None,
        lights=_lights(values.get("lights", "[]"), origin),
    )


def _lights(text: str, origin: str) -> tuple[TrafficLight, ...]:
    with guarded(f"{origin}: lights"):
        return tuple(map(TrafficLight.of_document, json.loads(text)))


def decode_decision(text: str, origin: str) -> Decision:
    """Return a decision from JSON; `origin` names it in messages.

    Raises:
        InputError: it is damaged.
    """
    with guarded(f"{origin}: decision"):
        return Decision.of_document(json.loads(text))


def _passing_orders(text: str) -> tuple[PassingOrder, ...]:
    orders = []
    for match in map(_PASSING_ORDER.fullmatch, split_pieces(text)):
        if match is None or match[3] not in set(OrderChange):
            continue
        change = OrderChange(match[3])
        first, second = match[1], match[2]
        if change is OrderChange.SWAPPED:
            first, second = second, first
        orders.append(PassingOrder(first, second, change))
    return tuple(orders)


def _reactions(text: str) -> tuple[NamedReaction, ...]:
    matches = map(_REACTION.fullmatch, split_pieces(text))
    return tuple(
        NamedReaction(FOLLOW if match[2] == "follows" else YIELD, match[1], match[3])
        for match in matches
        if match is not None
    )


def _pairs(text: str) -> tuple[tuple[str, str], ...]:
    pairs = [piece.split(">") for piece in split_pieces(text)]
    return tuple((pair[0], pair[1]) for pair in pairs if len(pair) == 2)
