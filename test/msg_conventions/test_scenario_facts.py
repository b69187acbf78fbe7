# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Facts about a scenario as key-values of its entry."""

from dataclasses import replace

import pytest

from msg_conventions.scenario_facts import decode_facts, fact_values
from scenario_gen.base.errors import InputError
from scenario_gen.types import (
    Decision,
    Facts,
    Failure,
    FOLLOW,
    NamedReaction,
    OrderChange,
    Outcome,
    PassingOrder,
    YIELD,
)

FACTS = Facts(
    closest_approach_m=1.25,
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


def test_facts_survive_as_key_values():
    values = fact_values(FACTS)
    assert decode_facts(values, "entry") == FACTS
    assert values["reactions"] == "2 yields to 1; 3 follows 2"
    assert values["reactions_lost"] == "3>1"
    assert values["target.pet"] == "0.5" and values["closest_approach"] == "1.250"
    assert values["passing_order"].startswith("1 before 2, as in the recording; 2 before 1, swap")


def test_unknown_facts_are_left_out():
    assert fact_values(Facts()) == {} and decode_facts({"index": "1"}, "entry") == Facts()
    assert decode_facts({"reactions": "odd"}, "entry") == Facts()
    one = replace(FACTS, failure=Failure("rear-end", 2.5))
    assert "search.weight" not in fact_values(one)


@pytest.mark.parametrize(("key", "text"), [("pet", "soon"), ("order", "late"), ("weight", "")])
def test_damaged_values_are_refused(key, text):
    with pytest.raises(InputError, match=f"entry: {key} is '{text}'"):
        decode_facts({key: text}, "entry")
    with pytest.raises(InputError, match="entry: decision"):
        decode_facts({"decision": '{"who": "2"}'}, "entry")
