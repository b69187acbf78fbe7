# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Hostile messages on every input of every node: all nodes live, stay small, and say why.

`SCENARIO_GEN_SOAK_MESSAGES` well-typed messages per input (10,000 unless given), one after the other: each that a decoder refuses
must be named on /diagnostics by every node that hears it. What was measured is kept in `state`.
"""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
import json
import os
from pathlib import Path
import random
import time
from typing import Any

from figures import Figure
from fuzzing.mutators import BYTES
from rosbags.typesys import get_typestore, Stores
from support.suite_processes import Client, memory, Processes, RESOURCES

from msg_conventions.cdr import CdrReader
from msg_conventions.diagnostics import decode_diagnostics, Level
from msg_conventions.streams import decode_fix, decode_speed, encode_fix, encode_speed
from msg_conventions.topics import topic_entry
from msg_conventions.tracks import encode_tracks
from scenario_gen.base.errors import ScenarioGenError
from scenario_gen.base.ros_domain import free_domain
from scenario_gen.logs import read_log
from scenario_gen.ros.common.stage_node import refuse_damaged

MESSAGES = int(os.environ.get("SCENARIO_GEN_SOAK_MESSAGES", "10000"))
HEAD = 160  # bytes
GIBIBYTE = 1 << 20  # kB
IDLE = 1.0  # s in which a machine with nothing else to do names what it refuses
STORE = get_typestore(Stores.ROS2_JAZZY)
NODES = {
    "road_server": ["-p", "road_name:=straight", "-p", "wait_for_tracks:=true"],
    "segmenter": ["-p", "live.silence:=1.0"],
    "planner": [],
    "gp_sampler": ["-p", "count:=1"],
    "evaluator": [],
}
STREAMS: dict[str, Callable[[bytes, str], object]] = {"fix": decode_fix, "speed": decode_speed}
ROAD = ("planner", "gp_sampler")
LISTENERS = {
    "tracks": tuple(NODES),
    "map": ROAD,
    "road/lanes": ROAD,
    "changepoints": (*ROAD, "evaluator"),
    "fit/info": ("gp_sampler",),
    "vehicle_1/fix": ("segmenter",),
    "vehicle_1/speed": ("segmenter",),
    "scenarios": ("evaluator",),
    "scenarios/info": ("evaluator",),
}


def hostile(rng: random.Random, kind: str, seeds: list[bytes]) -> bytes:
    """A damaged message that is still of its type: what any publisher of ROS could send."""
    while True:
        data = rng.choice(seeds)
        size = rng.choice(
            (HEAD, len(data))
        )  # what a message says of itself stands at its beginning
        head, rest = data[:size], data[size:]
        for _ in range(rng.choice((1, 1, 2, 4))):
            head = rng.choice(BYTES)(rng, head, seeds)
        try:
            return bytes(STORE.serialize_cdr(STORE.deserialize_cdr(head + rest, kind), kind))
        except Exception:  # whatever a decoder says of bytes that are not of the type
            continue


def is_refused(topic: str, data: bytes) -> bool:
    """Say whether a node refuses a message as it arrives; scenarios and accounts it judges later, together."""
    stream = STREAMS.get(topic.rpartition("/")[2])
    try:
        if stream:
            stream(data, topic)
        else:
            refuse_damaged(topic, data)
    except ScenarioGenError:
        return True
    return False


class Suite:
    """The nodes at work on a good encounter, a client, and seeds of all that they said."""

    def __init__(self, folder: Path, domain: int) -> None:
        (self.good,) = read_log(RESOURCES / "synthetic_c").encounters
        self.client = Client(domain)
        self.client.hear(
            "/diagnostics",
            "/report",
            *(f"/{topic}" for topic in LISTENERS if not topic.endswith(("fix", "speed"))),
        )
        self.made = Processes(folder, domain, NODES)
        self._served = 0
        self.serve()
        self.seeds = {topic: list(self.client.heard[f"/{topic}"]) for topic in LISTENERS}
        self.seeds["vehicle_1/fix"] = [encode_fix(42.0, -83.0, 10**18, "a")]
        self.seeds["vehicle_1/speed"] = [encode_speed(8.3, 10**18, "a")]

    def serve(self) -> None:
        """Say good tracks of a new stamp, and wait until the whole chain has dealt with them."""
        self._served += 1
        stamp = self.good.start_ns + self._served * 10**9
        self.client.say("/tracks", encode_tracks(replace(self.good, start_ns=stamp)))

        def is_reported() -> bool:
            return any(
                CdrReader(data, "report").stamp() == stamp
                for data in list(self.client.heard["/report"])
            )

        self.client.until(is_reported, f"the report of good tracks {self._served}", 300.0)

    def is_named(self, topic: str, after: int) -> set[str]:
        """The nodes that have said an error of the topic since so many messages of /diagnostics."""
        statuses = [
            s
            for data in self.client.heard["/diagnostics"][after:]
            for s in decode_diagnostics(data)[1]
        ]
        named = {s.name for s in statuses if s.level is Level.ERROR}
        return {
            node
            for node in LISTENERS[topic]
            if {f"/{node}: {topic}", f"/{node}: /{topic}"} & named
        }

    def end(self) -> dict[str, int]:
        """End the nodes; return their exit codes."""
        codes = self.made.end()
        self.client.close()
        return codes


def storm(suite: Suite, topic: str, rng: random.Random) -> dict[str, Any]:
    """Send hostile messages on one topic; return how many were refused, who was silent, and how long the slowest took."""
    kind, _ = topic_entry(topic)
    client, refused, silent, slowest = suite.client, 0, 0, 0.0
    client.announce(f"/{topic}")
    client.until(
        lambda: client.node.count_subscribers(f"/{topic}") >= len(LISTENERS[topic]),
        f"listeners of {topic}",
    )
    last = b""
    for _ in range(MESSAGES):
        data = hostile(rng, kind, suite.seeds[topic])
        if data == last:  # of a latched topic, the same word for word is no news
            continue
        last, after, began = data, len(client.heard["/diagnostics"]), time.monotonic()
        client.say(f"/{topic}", data)
        if not is_refused(topic, data):
            continue
        refused += 1
        try:
            client.until(
                lambda after=after: suite.is_named(topic, after) == set(LISTENERS[topic]),
                f"a refusal on {topic}",
                30.0,
            )
        except AssertionError:
            silent += 1
        slowest = max(slowest, time.monotonic() - began)
        del client.heard["/diagnostics"][:-1000]
    del client.heard[f"/{topic}"][:]
    served = False
    with suppress(AssertionError):
        suite.serve()
        served = True
    peaks = {node: memory(pid, "VmHWM") for node, pid in suite.made.pids.items()}
    return {
        "refused": refused,
        "silent": silent,
        "slowest": slowest,
        "served": served,
        "peaks": peaks,
    }


def _storms(state: Path) -> Iterator[Figure]:
    file = state / f"messages_{MESSAGES}.json"
    found: dict[str, dict[str, Any]] = json.loads(file.read_text()) if file.exists() else {}
    codes = dict.fromkeys(NODES, 0)
    left = [topic for topic in LISTENERS if topic not in found]
    if left:
        with free_domain() as domain:
            suite = Suite(state, domain)
            for topic in left:
                found[topic] = storm(suite, topic, random.Random(topic))
                file.write_text(json.dumps(found, indent=1))
                print(topic, found[topic], flush=True)
            codes = suite.end()
    asked = f"named on /diagnostics by every listener; idle within {IDLE:g} s; the next good tracks served"
    for topic, one in found.items():
        seen = (
            f"{one['refused']} refused, {one['silent']} not named, slowest {one['slowest']:.2f} s"
        )
        seen += "" if one["served"] else "; good tracks NOT served"
        yield Figure(
            f"{MESSAGES:,} hostile messages on {topic}",
            asked,
            seen,
            one["silent"] == 0 and one["served"],
        )
    peaks = {node: max(one["peaks"].get(node, 0) for one in found.values()) for node in NODES}
    seen = ", ".join(f"{node} {peak / 1024:.0f} MiB" for node, peak in peaks.items())
    is_small = all(0 < peak < GIBIBYTE for peak in peaks.values()) and not any(codes.values())
    yield Figure("every node lives, in", "less than 1 GiB each, exit code 0", seen, is_small)


def run(state: Path) -> Iterator[Figure]:
    """Measure what has not been measured yet."""
    yield from _storms(state)
