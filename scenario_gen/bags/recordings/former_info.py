# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`scenarios/info` of drafts, key-values of diagnostics, in the present layout; see former.py."""

from collections.abc import Mapping
import json
import re
from typing import Any

import numpy as np

from msg_conventions.diagnostics import decode_diagnostics
from msg_conventions.documents import typed
from msg_conventions.scenario_info import (
    EgoEntry,
    encode_info,
    INFO,
    RequestSummary,
    ScenarioEntry,
)
from scenario_gen.base.errors import guarded, InputError
from scenario_gen.types import (
    BoundaryStates,
    Decision,
    Facts,
    Failure,
    FOLLOW,
    NamedReaction,
    OrderChange,
    PassingOrder,
    recorded_notes,
    split_pieces,
    TrafficLight,
    YIELD,
)

_REACTION = re.compile(r"(\S+) (follows|yields to) (\S+)")
_PASSING_ORDER = re.compile(r"(\S+) before (\S+), (.+)")
_IDENTITY = {"request", "seed", "requested", "published", "candidates", "map_hash"}
_OUTCOME = ("refused.", "adaptation.", "target.", "reaction.", "decided.", "ego_")
Values = Mapping[str, str]


def upgraded_info(data: bytes) -> bytes:
    """Return the entry or the summary of a message.

    Raises:
        InputError: it is damaged, or neither.
    """
    stamp_ns, statuses = decode_diagnostics(data, INFO)
    for status in statuses:
        with guarded(f"{INFO}: {status.message} is damaged"):
            if "published" in status.values:
                return encode_info(_summary(status.values, stamp_ns))
            if "sha256" in status.values:
                return encode_info(_entry(status.values, stamp_ns))
    raise InputError(f"{INFO}: neither an entry nor a summary")


def _inputs(values: Values) -> dict[str, str]:
    keys = {"tracks": "template_hash", "map": "map_hash"}
    return {topic: values[key] for topic, key in keys.items() if key in values}


def _entry(values: Values, stamp_ns: int) -> ScenarioEntry:
    def numbers(key: str) -> Any:
        return np.array(json.loads(values.get(key, "[]")), dtype=np.float64)

    requested = None
    if "asked_start" in values:
        start, end = numbers("asked_start"), numbers("asked_end")
        relaxed = np.zeros((len(start), 2, 2))
        freed = numbers("freed").reshape(-1, 2, 2)
        relaxed[: len(freed)] = freed
        requested = BoundaryStates(start, end, relaxed)
    return ScenarioEntry(
        stamp_ns,
        _inputs(values),
        values["request"],
        int(values["index"]),
        int(values["seed"]),
        values["sha256"],
        tuple(json.loads(values.get("messages", "[]"))),
        values.get("template", ""),
        values.get("road", ""),
        _facts(values),
        requested,
        np.stack([numbers("achieved_start"), numbers("achieved_end")]),
        numbers("present").reshape(-1, 2),
        numbers("sizes").reshape(-1, 2),
        _ego(values),
    )


def _ego(values: Values) -> EgoEntry | None:
    if "ego_start" not in values:
        return None
    start, goal = (np.array(json.loads(values[key])) for key in ("ego_start", "ego_goal"))
    relaxed = np.array(json.loads(values.get("ego_freed", "[[[0, 0], [0, 0]]]")), dtype=float)[0]
    return EgoEntry(values["ego"], start, goal, relaxed, values.get("ego_witness", ""))


def _facts(values: Values) -> Facts:
    def number(key: str) -> float | None:
        return float(values[key]) if key in values else None

    failure = None
    if "search.kind" in values:
        deviation = number("search.deviation") or 0.0
        failure = Failure(values["search.kind"], deviation, number("search.weight"))
    reactions = map(_REACTION.fullmatch, split_pieces(values.get("reactions", "")))
    lost = [piece.split(">") for piece in split_pieces(values.get("reactions_lost", ""))]
    decision = json.loads(values.get("decision", "null"))
    return Facts(
        number("closest_approach"),
        number("pet"),
        number("rarity"),
        number("weight"),
        {key[7:]: float(text) for key, text in values.items() if key.startswith("target.")},
        values.get("order", "keep"),
        _passing_orders(values.get("passing_order", "")),
        tuple(
            NamedReaction(FOLLOW if match[2] == "follows" else YIELD, match[1], match[3])
            for match in reactions
            if match
        ),
        tuple((pair[0], pair[1]) for pair in lost),
        failure,
        decision and Decision.of_document(decision),
        tuple(map(TrafficLight.of_document, json.loads(values.get("lights", "[]")))),
    )


def _passing_orders(text: str) -> tuple[PassingOrder, ...]:
    orders = []
    for match in map(_PASSING_ORDER.fullmatch, split_pieces(text)):
        if match is None:
            continue
        change, pair = OrderChange(match[3]), (match[1], match[2])
        first, second = pair[::-1] if change is OrderChange.SWAPPED else pair
        orders.append(PassingOrder(first, second, change))
    return tuple(orders)


def _summary(values: Values, stamp_ns: int) -> RequestSummary:
    def under(prefix: str) -> dict[str, str]:
        return {
            key.removeprefix(prefix): text
            for key, text in values.items()
            if key.startswith(prefix)
        }

    notes = under("adaptation.")
    kinds = notes.pop("kinds", "")
    edges = {key: json.loads(text) for key, text in under("reaction.").items()}
    decided = None
    if "decided.decision" in values:
        decision = typed(Decision, json.loads(values["decided.decision"]))
        decided = (values["decided.encounter"], decision)
    return RequestSummary(
        stamp_ns,
        _inputs(values),
        values["request"],
        int(values["seed"]),
        int(values["requested"]),
        int(values["published"]),
        int(values["candidates"]),
        {cause: int(count) for cause, count in under("refused.").items()},
        "cancelled" in values,
        recorded_notes(notes.values(), kinds),
        tuple(edge for key, edge in edges.items() if not key.startswith("cut.")),
        tuple(edge for key, edge in edges.items() if key.startswith("cut.")),
        under("target."),
        decided,
        _ego(values),
        {
            key: text
            for key, text in values.items()
            if key not in (*_IDENTITY, "template_hash", "cancelled")
            and not key.startswith(_OUTCOME)
        },
    )
