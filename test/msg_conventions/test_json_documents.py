# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Dataclasses as JSON, and back to the same values."""

import numpy as np

from msg_conventions.documents import decode_document, encode_document, json_of, plain
from scenario_gen.types import (
    Decision,
    Facts,
    Failure,
    FOLLOW,
    NamedReaction,
    OrderChange,
    Outcome,
    PassingOrder,
    TrafficLight,
    YIELD,
)
from scenario_gen.types.traffic_light import SignalSchedule, SignalState

FACTS = Facts(
    closest_approach_m=0.1 + 0.2,
    pet_s=0.5,
    rarity=0.75,
    weight=0.1,
    targets={"pet": 0.5, "ttc[1,2]": 1.5},
    order="swap",
    passing_order=tuple(PassingOrder("1", "2", change) for change in OrderChange),
    reactions=(NamedReaction(YIELD, "2", "1"), NamedReaction(FOLLOW, "3", "2")),
    lost_reactions=(("3", "1"),),
    failure=Failure("rear-end", 2.5, 0.01),
    decision=Decision("2", "1", Outcome.GOES_FIRST, 2.9, 0.25),
)


def test_changed_values_are_exact():
    data = encode_document(FACTS)
    assert len(data) % 4 == 0 and decode_document(Facts, data, "facts") == FACTS
    said = json_of(data, "facts")
    assert said["closest_approach_m"] == 0.1 + 0.2 and "lights" not in said
    assert said["reactions"][0] == {"kind": "yield", "who": "2", "whom": "1"}
    assert plain(Facts()) == {} and decode_document(Facts, encode_document(Facts()), "") == Facts()


def test_arrays_and_what_is_within_travel():
    states = (SignalState("red"), SignalState("green"))
    schedule = SignalSchedule((0.0, 4.0), states, 9.0, True)
    light = TrafficLight("é", schedule, np.array([[0.0, 1.0], [2.0, 3.0]]), ("a",), ("left",))
    (got,) = decode_document(Facts, encode_document(Facts(lights=(light,))), "").lights
    assert (got.id, got.schedule, got.lanes, got.turns) == ("é", schedule, ("a",), ("left",))
    assert got.line.tobytes() == light.line.tobytes()
