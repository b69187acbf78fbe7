# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Hashes that say which messages belong together."""

from dataclasses import replace

import pytest
from support.bag_examples import hand_made_run
from support.message_examples import encounter

from msg_conventions.diagnostics import encode_diagnostics, Level, Status
from msg_conventions.hashes import decode_hashes, encode_hashes, hash_of, template_hashes
from msg_conventions.roads import encode_map
from msg_conventions.tracks import encode_tracks
from scenario_gen.base.errors import InputError


def test_a_road_of_the_same_geometry_differs_in_the_templates_hash_only():
    road = hand_made_run().road
    first, second = (
        {"tracks": encode_tracks(e), "map": encode_map(road, e.start_ns)}
        for e in (encounter(1), encounter(2))
    )
    assert first["map"] != second["map"]
    one, other = template_hashes(first), template_hashes(second)
    assert one["map_hash"] == other["map_hash"] and one["template_hash"] != other["template_hash"]
    cells = road.drivable.copy()
    cells[0, 0] = False
    assert hash_of("map", encode_map(replace(road, drivable=cells), 5)) != one["map_hash"]
    assert hash_of("map", first["map"] + b"\x00") == one["map_hash"]


def test_what_belongs_together_is_read_again_and_anything_else_refused():
    messages = {"map": b"\x00\x01\x00\x00" + bytes(80), "fit": b"fit", "fit/info": b"never itself"}
    sent = encode_hashes("fit", messages, 5)
    assert decode_hashes(sent, "fit/info") == {
        topic: hash_of(topic, messages[topic]) for topic in ("fit", "map")
    }
    for values in ({}, {"map": "no hash"}, {"map": "0" * 13}):
        with pytest.raises(InputError, match="fit/info: it must list"):
            decode_hashes(encode_diagnostics([Status("fit", Level.OK, "", values)], 5), "fit/info")
