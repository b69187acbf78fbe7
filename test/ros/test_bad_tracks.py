# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Tracks that no road user drove hurt nobody: every node says what is wrong with them, and serves the next good ones."""

from dataclasses import replace

import numpy as np
import pytest
from support.suite_processes import memory, Processes, RESOURCES

from msg_conventions.cdr import stamp_of
from msg_conventions.diagnostics import Level
from msg_conventions.tracks import encode_tracks
from scenario_gen.logs import read_log
from scenario_gen.types import ALWAYS
from scenario_gen.types.encounter import Encounter

pytestmark = pytest.mark.dds
NODES = {
    "road_server": ["-p", "road_name:=corridor", "-p", "wait_for_tracks:=true"],
    "segmenter": [],
    "planner": [],
    "gp_sampler": ["-p", "count:=1"],
    "evaluator": [],
}
GIBIBYTE = 1 << 20  # kB


def _offset(encounter: Encounter, metres: float) -> bytes:
    position = encounter.position.copy()
    position[1, :, 1] += metres
    return encode_tracks(replace(encounter, position=position))


def _repeated(encounter: Encounter, samples: int) -> bytes:
    """The first sample over and over, a thousand times a second."""
    return encode_tracks(
        replace(
            encounter,
            time=np.arange(samples) * 1e-3,
            position=np.repeat(encounter.position[:, :1], samples, axis=1),
            heading=np.repeat(encounter.heading[:, :1], samples, axis=1),
            speed=np.repeat(encounter.speed[:, :1], samples, axis=1),
            present=ALWAYS,
        )
    )


def test_bad_tracks_are_named_by_nodes(tmp_path, domain, client):
    (good,) = read_log(RESOURCES / "synthetic_c").encounters
    client.hear("/diagnostics", "/fit", "/report")
    made = Processes(tmp_path, domain, NODES)
    try:
        client.say("/tracks", encode_tracks(good))
        client.wait("/report")
        for data, words in (
            (_offset(good, 1e4), "never nearer than"),
            (_offset(good, 1e7), "never nearer than"),
            (_repeated(good, 100_000), "bytes, at most"),
            (_repeated(good, 25_000), "50000 samples, 45000 are possible"),
        ):
            client.heard["/diagnostics"].clear()
            client.say("/tracks", data)
            for node in NODES:
                client.until(
                    lambda node=node, words=words: _named(client, node, words),
                    f"{words!r} of {node}",
                )
        later = replace(good, start_ns=good.start_ns + 10**9)
        client.say("/tracks", encode_tracks(later))
        client.wait("/report", 2)
        assert stamp_of(client.heard["/fit"][-1], "fit") == later.start_ns
        assert {
            node: peak
            for node, pid in made.pids.items()
            if (peak := memory(pid, "VmHWM")) >= GIBIBYTE
        } == {}
        client.until(
            lambda: _levels(client) == dict.fromkeys(NODES, Level.OK),
            "the end of what was wrong with the tracks",
        )
    finally:
        codes = made.end()
    assert codes == dict.fromkeys(NODES, 0)


def _levels(client) -> dict[str, Level]:
    """What each node said last of its tracks."""
    return {
        s.name[1:].removesuffix(": tracks"): s.level
        for s in client.statuses()
        if s.name.endswith(": tracks")
    }


def _named(client, node: str, words: str) -> bool:
    return any(
        s.level is Level.ERROR and s.name == f"/{node}: tracks" and words in s.message
        for s in client.statuses()
    )
