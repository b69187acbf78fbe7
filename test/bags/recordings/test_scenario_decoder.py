# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Live scenarios are whole in whatever order their messages come, and only then."""

from dataclasses import replace

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from support.message_examples import scenario

from msg_conventions.scenario_info import encode_info, scenario_entry
from msg_conventions.scenarios import encode_scenario, messages_of
from scenario_gen.bags.recordings.scenario_decoder import INFO, ScenarioDecoder, SCENARIOS, WITNESS
from scenario_gen.base.errors import InputError
from scenario_gen.types import join_ego, with_witness
from scenario_gen.types.scenario import BoundaryStates, EgoSlot


def set_of(count):
    """Scenarios of four vehicles that come and go, without one; and their messages, by topic."""
    made, messages = [], []
    for index in range(count):
        all_of_it = scenario(7 + index, n=4)
        last = len(all_of_it.time) - 1
        present = np.array([[0, last], [2, last], [2, last - 3], [1, last]])
        one = with_witness(replace(all_of_it, seed=3, index=index, present=present), 3)
        data = encode_scenario(one, 17)
        slot = EgoSlot(one.reference_drive.vehicles[0], np.zeros(4), np.ones(4))
        asked = BoundaryStates(np.zeros((4, 4)), np.ones((4, 4)))
        entry = scenario_entry(one, data, "r", template=all_of_it.vehicles, asked=asked, ego=slot)
        messages += [(SCENARIOS, part) for part in messages_of(data)]
        messages += [
            (WITNESS, encode_scenario(one.reference_drive, 17)),
            (INFO, encode_info(entry)),
        ]
        made.append(one)
    return made, messages


MADE, MESSAGES = set_of(2)


@given(st.permutations(range(len(MESSAGES))))
@settings(max_examples=25)
def test_whatever_comes_first(order):
    arriving = ScenarioDecoder()
    found = [one for k in order if (one := arriving.add(*MESSAGES[k]))]
    assert sorted(entry.index for entry, _, _ in found) == [0, 1] and arriving.unmatched == 0
    for entry, stamp, got in found:
        assert stamp == 17 and entry.ego.id == got.reference_drive.vehicles[0].id
        wanted = join_ego(MADE[entry.index])
        assert encode_scenario(join_ego(got), 17) == encode_scenario(wanted, 17)
    assert not any(arriving.add(*MESSAGES[k]) for k in order), "what comes twice counts once"


def test_what_is_not_whole_waits():
    arriving = ScenarioDecoder()
    assert all(arriving.add(*message) is None for message in MESSAGES if message[0] != WITNESS)
    assert arriving.unmatched > 0
    with pytest.raises(InputError):
        arriving.add(INFO, b"damaged")
