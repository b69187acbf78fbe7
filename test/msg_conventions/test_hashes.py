# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Hashes that say which messages belong together."""

from dataclasses import replace

from support.bag_examples import hand_made_run
from support.message_examples import encounter

from msg_conventions.documents import hash_of
from msg_conventions.roads import encode_map
from msg_conventions.tracks import encode_tracks


def test_same_geometry_changes_template_hash_only():
    road = hand_made_run().road
    first, second = (
        {"tracks": encode_tracks(e), "map": encode_map(road, e.start_ns)}
        for e in (encounter(1), encounter(2))
    )
    assert first["map"] != second["map"]
    one, other = (
        {topic: hash_of(topic, data) for topic, data in each.items()} for each in (first, second)
    )
    assert one["map"] == other["map"] and one["tracks"] != other["tracks"]
    cells = road.drivable.copy()
    cells[0, 0] = False
    assert hash_of("map", encode_map(replace(road, drivable=cells), 5)) != one["map"]
    assert hash_of("map", first["map"] + b"\x00") == one["map"]
