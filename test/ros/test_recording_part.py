# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A recording that is too long for a map: all nodes continue with its part."""

from dataclasses import replace
from pathlib import Path

import pytest
from support.map_builders import opendrive, write
from support.suite_processes import Processes

from msg_conventions.diagnostics import decode_diagnostics
from msg_conventions.documents import hash_of, head_of
from msg_conventions.tracks import decode_tracks
from scenario_gen.base.errors import RefusedError
from scenario_gen.logs import read_log
from scenario_gen.method.fitting import FittingConfig
from scenario_gen.method.shortening import cut
from scenario_gen.ros.common.recording_part import request_part, send_part, TOPIC
from scenario_gen.types import Encounter

LOG = Path(__file__).resolve().parents[2] / "examples" / "my_log.csv"


class Node:
    """Stands in for a node: keeps what it sends."""

    def __init__(self) -> None:
        self.sent: dict[str, bytes] = {}
        self.outputs = self
        self.statuses: list[str] = []

    def send(self, topic: str, data: bytes) -> None:
        self.sent[topic] = data

    def status(self, _level: object, message: str, *_: object) -> None:
        self.statuses.append(message)


def test_sender_sends_the_requested_part() -> None:
    (whole,) = read_log(LOG).encounters
    limit = whole.duration

    def attempt(part: Encounter) -> None:
        if part.duration >= limit:
            raise RefusedError("too long")

    planner, sender = Node(), Node()
    request_part(planner, attempt, whole, RefusedError("too long"), FittingConfig())
    data = planner.sent[TOPIC]
    assert decode_tracks(data).start_ns > whole.start_ns, "stages pair messages by their stamp"
    assert f"of {whole.duration:.1f} s (too long)" in planner.statuses[0]
    other = cut(whole, whole.time[whole.present] - [0.0, 1.0])
    for sent in (None, replace(whole, position=whole.position + 1.0), other):
        send_part(sender, sent, data)
        assert not sender.sent or sent is other
    send_part(sender, whole, data)
    assert sender.sent == {"tracks": data}


@pytest.mark.dds
@pytest.mark.long
def test_nodes_continue_with_the_part(tmp_path, domain, client) -> None:
    (whole,) = read_log(LOG).encounters
    road = write(tmp_path, ".xodr", opendrive())
    nodes = {
        "log_player": ["-p", f"log_path:={LOG}"],
        "road_server": ["-p", f"road_name:={road}", "-p", "wait_for_tracks:=true"],
        "segmenter": [],
        "planner": [],
    }
    client.hear("/tracks", "/fit/info", "/diagnostics")
    made = Processes(tmp_path, domain, nodes)
    fitted = head_of(client.wait("/fit/info")[-1], "fit/info").inputs
    tracks = client.wait("/tracks")[-1]
    assert fitted["tracks"] == hash_of("tracks", tracks)
    assert whole.duration > decode_tracks(tracks).duration > 5.0
    statuses = [
        status
        for data in list(client.heard["/diagnostics"])
        for status in decode_diagnostics(data)[1]
    ]
    assert any(status.message.startswith("shortened to fit the road") for status in statuses)
    assert made.end() == dict.fromkeys(nodes, 0)
