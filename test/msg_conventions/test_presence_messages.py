# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Messages of vehicles that arrive late or leave early: no phantoms, and the same scenario again."""

from dataclasses import replace
import hashlib
import json
from pathlib import Path
import re

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from msg_conventions.scenario_info import decode_info, encode_info, scenario_entry
from msg_conventions.scenarios import decode_scenario, digest, encode_scenario, messages_of
from msg_conventions.tracks import decode_tracks, encode_tracks
from msg_conventions.trajectory import decode
from scenario_gen.base.errors import InputError
from scenario_gen.types import Encounter, Vehicle
from scenario_gen.types.scenario import BoundaryStates, Scenario

TIME = np.round(0.1 * np.arange(41), 9)
FIELDS = ("position", "heading", "speed", "acceleration", "present")


def scenario(present):
    rng = np.random.Generator(np.random.PCG64(1))
    n = len(present)
    vehicles = tuple(Vehicle(f"v{i}") for i in range(n))
    arrays = (rng.uniform(-9, 9, (n, 41, 2)), *(rng.uniform(0, 3, (n, 41)) for _ in range(3)))
    return Scenario(vehicles, TIME, *arrays, seed=4, index=7, present=np.array(present))


@st.composite
def presences(draw):
    rows = st.tuples(st.integers(0, 39), st.integers(1, 40)).filter(lambda row: row[0] < row[1])
    return [(0, 40), *draw(st.lists(st.one_of(st.just((0, 40)), rows), min_size=1, max_size=4))]


@given(presences())
@settings(max_examples=30)
def test_scenario_comes_back_from_messages(present):
    before = scenario(present)
    _, after = decode_scenario(encode_scenario(before, 5), seed=4, index=7)
    assert after.vehicles == before.vehicles
    assert after.time.tobytes() == before.time.tobytes()
    for name in FIELDS:
        assert getattr(after, name).tobytes() == getattr(before, name).tobytes()


@given(presences())
@settings(max_examples=30)
def test_standard_consumers_see_true_presence(present):
    """A consumer that knows the standard type and nothing of presence."""
    made = scenario(present)
    seen = {}
    for message in messages_of(encode_scenario(made, 5)):
        heard = decode(message, "scenarios")
        for vehicle, xy in zip(heard.vehicles, heard.position, strict=True):
            seen |= {
                (vehicle.id, t): tuple(place)
                for t, place in zip(heard.time_ns.tolist(), xy.tolist(), strict=True)
            }
    there = {
        (vehicle.id, round(t * 1e9)): tuple(place)
        for vehicle, xy, row in zip(
            made.vehicles, made.position.tolist(), made.is_present, strict=True
        )
        for t, place, is_there in zip(TIME.tolist(), xy, row, strict=True)
        if is_there
    }
    assert seen == there


def test_late_message_alone_is_no_scenario():
    late = messages_of(encode_scenario(scenario([(0, 40), (5, 40)]), 5))[1]
    with pytest.raises(InputError, match=r"begins at 0.5 s.*arrives late"):
        decode_scenario(late)
    _, alone = decode_scenario(late, may_start_late=True)  # as the track of an ego
    assert alone.present.tolist() == [[1, 36]]


def entry_of(made, data):
    asked = BoundaryStates(np.zeros((len(made.vehicles), 4)), np.zeros((len(made.vehicles), 4)))
    entry = scenario_entry(made, data, "1", template=made.vehicles, asked=asked)
    return decode_info(encode_info(entry))


def test_entry_states_presence_and_messages():
    made = scenario([(0, 40), (5, 30)])
    data = encode_scenario(made, 5)
    entry = entry_of(made, data)
    assert entry.sha256 == digest(data)
    assert entry.hashes == tuple(map(digest, messages_of(data)))
    assert entry.present.tolist() == [[0.0, 4.0], [0.5, 3.0]]
    whole = scenario([(0, 40), (0, 40)])
    entry = entry_of(whole, encode_scenario(whole, 5))
    assert entry.hashes == (entry.sha256,)
    assert not len(entry.present) and not entry.messages


def test_tracks_show_nobody_absent():
    made = scenario([(0, 40), (5, 40), (0, 20)])
    arrays = (made.position, made.heading, made.speed)
    encounter = Encounter.sampled(
        made.vehicles, 0.1, *arrays, name="tracks", start_ns=5, present=made.present
    )
    data = encode_tracks(encounter)
    again = decode_tracks(data)
    for name in ("position", "heading", "speed", "present"):
        assert getattr(again, name).tobytes() == getattr(encounter, name).tobytes()
    assert encode_tracks(again) == data
    assert (decode(data, "tracks").present == encounter.is_present).all()


def test_documented_code_joins_scenarios():
    """The lines of docs/interfaces.md, with an entry that comes before its scenario, which has several messages."""
    from rclpy.serialization import deserialize_message
    from std_msgs.msg import String

    made = scenario([(0, 40), (5, 30), (0, 40)])
    data, asked = encode_scenario(made, 5), BoundaryStates(np.zeros((3, 4)), np.zeros((3, 4)))
    recorded = (replace(made.vehicles[0], length=12.0), *made.vehicles[1:])
    entry = scenario_entry(made, data, "1", template=recorded, asked=asked)
    text = (Path(__file__).resolve().parents[2] / "docs" / "interfaces.md").read_text()
    consumer = {"hashlib": hashlib, "json": json}
    exec(re.search(r"```python\n(scenarios, entries = .*?)```", text, re.DOTALL)[1], consumer)
    consumer["take_info"](deserialize_message(encode_info(entry), String))
    (own,) = consumer["entries"]
    assert own["sizes"] == [[4.8, 1.9]] * 3, "they are not those of the tracks"
    for message in messages_of(data):
        assert consumer["scenario_of"](own) is None
        consumer["take_scenario"](message)
    assert consumer["scenario_of"](own) == list(messages_of(data))
